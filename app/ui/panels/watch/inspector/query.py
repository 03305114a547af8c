"""Query strip of the inspector. Queries are evaluated in a background thread."""

from __future__ import annotations

import time
from dataclasses import dataclass

from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.core.messages.newest_only import NewestJobWorker
from app.core.messages.query import JsonQuery, QueryResult
from app.errors import QueryError
from app.ui.widgets import label
from app.ui.widgets.labels import set_role
from app.ui.widgets.paint import show_when
from nep.i18n import ngettext

LOAD_DIVISOR = 4
"""Inverse of the maximum share of a core for queries; determines the pause after each query."""


@dataclass(frozen=True, slots=True)
class _QueryJob:
    query: JsonQuery
    value: object


@dataclass(frozen=True, slots=True)
class _QueryOutcome:
    result: QueryResult
    duration_s: float


def _evaluate(job: _QueryJob) -> _QueryOutcome:
    start_s = time.perf_counter()
    result = job.query.evaluate(job.value)
    return _QueryOutcome(result, time.perf_counter() - start_s)


class QueryStrip(QWidget):
    """Strip with the number of results, such as ``12 found``, or a syntax error. Hidden without a query."""

    def __init__(self) -> None:
        super().__init__()
        self._worker = NewestJobWorker(_evaluate, "studio-query")
        self._query: JsonQuery | None = None
        self._query_text = ""
        self._value: object = None
        self._is_due = self._can_show_results = False
        self._not_before_s = 0.0
        self.text_label = label("", "small", role="textSecondary", wrap=True)
        self.text_label.setMinimumWidth(0)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 3, 8, 3)
        row.addWidget(self.text_label, 1)
        self.hide()

    @property
    def has_query(self) -> bool:
        """True if there is a query, even one with invalid syntax."""
        return bool(self._query_text)

    def set_query(self, text: str) -> bool:
        """Set the query; "" removes the query. Return False if the syntax is invalid."""
        self._query_text, self._query = text, None
        self._worker.clear()
        self._not_before_s = 0.0
        message = ""
        if text:
            try:
                self._query = JsonQuery(text)
            except QueryError as error:
                message = error.sentence
        self._set_status(message, is_error=bool(message))
        return not message

    def request_evaluation(self, value: object) -> None:
        """Queue a message for evaluation in place of the pending one; `pop_result` returns the result."""
        self._value, self._is_due = value, True

    def pop_result(self, now: float) -> QueryResult | None:
        """Return a new result, or None. Each result is returned once.

        Call this on every refresh, because it also starts pending evaluations.

        Args:
            now: Monotonic time in s.
        """
        outcome = self._worker.pop_result()
        if outcome is not None:
            self._not_before_s = now + (LOAD_DIVISOR - 1) * outcome.duration_s
            self._set_status(result_text(outcome.result), is_error=False)
        if (
            self._is_due
            and self._query is not None
            and not self._worker.is_busy
            and now >= self._not_before_s
        ):
            self._is_due = False
            self._worker.submit(_QueryJob(self._query, self._value))
        return outcome.result if outcome is not None else None

    def discard_pending(self) -> None:
        """Discard pending evaluations; called before another topic is shown."""
        self._worker.clear()
        self._value, self._is_due = None, False
        self._set_status("", is_error=False)

    def update_visibility(self, *, can_show_results: bool) -> None:
        """Show or hide the strip. It is visible only if it has a text.

        Args:
            can_show_results: True if the current page can show the results of a query.
        """
        self._can_show_results = can_show_results
        show_when(self, can_show_results and bool(self.text_label.text()))

    def close_worker(self) -> None:
        """Stop the background thread."""
        self._worker.close()

    def _set_status(self, text: str, *, is_error: bool) -> None:
        self.text_label.setText(text)
        set_role(self.text_label, "warn" if is_error else "textSecondary")
        self.update_visibility(can_show_results=self._can_show_results)


def result_text(result: QueryResult) -> str:
    """Format the number of results, such as ``12 found``, and the reason if the results are incomplete."""
    count = len(result.values)
    text = ngettext("{count} found.", "{count} found.", count).format(count=count)
    return f"{text} {result.incomplete_reason}".rstrip()
