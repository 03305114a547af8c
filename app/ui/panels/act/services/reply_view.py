"""View of a service's reply as table or JSON, or the reason why there is none."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QSize
from PySide6.QtGui import QGuiApplication, QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QSizePolicy, QStackedWidget, QVBoxLayout, QWidget

from app.core.run.acting.acting import call_text, duration_text
from app.core.run.acting.calling import CallRecord
from app.ui.panels.base import ShowToast
from app.ui.text.numbers import seconds_text, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Chip, ElidedLabel, IconButton, Segments, label
from app.ui.widgets.inputs.json_edit import JsonEdit
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy
from nep.text import shortened

MAX_ROWS = 500
MAX_DEPTH = 12
MAX_TEXT_CHARS = 200
INDENT_PX = 14
# px at 100 % text size: minimum width, and width from which the header is one row
MIN_WIDTH_PX, ONE_ROW_WIDTH_PX = 200, 420


@dataclass(frozen=True, slots=True)
class ReplyRow:
    """Row of a reply.

    Attributes:
        path: Path of the value in the reply.
        depth: Nesting depth of the value; 0 for a field of the reply itself.
        name: Key or index of the value.
        text: Formatted value, such as "{2}" for an object with two fields.
    """

    path: str
    depth: int
    name: str
    text: str


def reply_rows(reply: object) -> list[ReplyRow]:
    """Convert a reply to rows, with children below their parents.

    At most `MAX_ROWS` rows are returned, followed by a note if the reply has more. Values that are
    nested more than `MAX_DEPTH` levels deep are omitted.
    """
    rows: list[ReplyRow] = []
    for row in (
        _iter_rows("", 0, "", reply)
        if _is_container(reply)
        else [ReplyRow("", 0, _("reply"), _value_text(reply))]
    ):
        if len(rows) == MAX_ROWS:
            rows.append(ReplyRow("…", 0, "…", _("truncated; see the JSON for the rest")))
            break
        rows.append(row)
    return rows


def _is_container(value: object) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, Sequence) and not isinstance(value, (str, bytes)))


def _iter_rows(path: str, depth: int, name: str, value: object) -> Iterator[ReplyRow]:
    if name:
        yield ReplyRow(path, depth - 1, name, _value_text(value))
    if depth >= MAX_DEPTH or not _is_container(value):
        return
    entries = value.items() if isinstance(value, Mapping) else enumerate(value)  # type: ignore[arg-type]
    for key, part in entries:
        child_path = f"{path}[{key}]" if isinstance(key, int) else f"{path}.{key}" if path else str(key)
        yield from _iter_rows(child_path, depth + 1, str(key), part)


def _value_text(value: object) -> str:
    if isinstance(value, Mapping):
        return "{}" if not value else f"{{{len(value)}}}"
    if _is_container(value):
        return f"[{len(value) or ''}]"  # type: ignore[arg-type]
    if isinstance(value, bytes):
        return shortened(value.hex(" "), MAX_TEXT_CHARS)
    return shortened(json.dumps(value, ensure_ascii=False, default=str), MAX_TEXT_CHARS)


def duration_cell(record: CallRecord) -> Cell:
    """Return the cell with the duration of a successful call, or with the state or error of other calls."""
    match record.state:
        case "waiting":
            return Cell(_("waiting"), "circle-dashed", "textSecondary")
        case "answered":
            return Cell(duration_text(record.duration_s), "circle-check", "ok")
        case "canceled":
            return Cell(_("cancelled"), "circle-x", "textSecondary")
        case _:
            return Cell(record.error, "circle-x", "error")


def clock_text(record: CallRecord) -> str:
    """Format the time of a call, such as "8:41:50"."""
    started_at = dt.datetime.fromtimestamp(record.started_s, tz=dt.timezone.utc).astimezone()
    return started_at.strftime("%H:%M:%S").lstrip("0")


class ReplyView(QWidget):
    """View of one call and its reply, as a table or JSON."""

    def __init__(self, theme: Theme, toast: ShowToast) -> None:
        super().__init__()
        self._theme, self._toast = theme, toast
        self.record: CallRecord | None = None
        self.chip = Chip(theme)
        self.details = ElidedLabel("small", "textTertiary")
        self.details.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.format_switch = Segments(
            theme,
            [("fields", _("Fields"), None), ("json", _("JSON"), None)],
            size="small",
            name=_("Reply as"),
        )
        self.format_switch.changed.connect(self._set_mode)
        self.copy_button = IconButton(theme, "copy", _("Copy reply"), size=26)
        self.copy_button.clicked.connect(self._copy)
        self.model: TableModel[ReplyRow] = TableModel(
            (
                Column("name", lazy("Field"), 90, _name_cell, stretch=True, tip=lambda row: row.path),
                Column("value", lazy("Value"), 150, _value_cell, is_numeric=True, tip=lambda row: row.text),
            ),
            lambda row: row.path,
        )
        self.table = TableView(theme, self.model)
        self.table.horizontalHeader().hide()
        self.table.setAccessibleName(_("Reply"))
        self.text = JsonEdit(theme, _("Reply as JSON"), min_lines=3)
        self.text.edit.setReadOnly(True)
        self.message_label = label("", "body", role="textSecondary", wrap=True)
        self.message_label.setMinimumWidth(0)
        self.message_label.setContentsMargins(12, 4, 12, 4)
        self.pages = QStackedWidget()
        for page in (self.message_label, self.table, self.text):
            self.pages.addWidget(page)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(self._make_header())
        column.addWidget(self.pages, 1)
        self.show_record(None)

    def _make_header(self) -> QBoxLayout:
        # In a narrow panel the header wraps into two rows.
        result_row, control_row = QHBoxLayout(), QHBoxLayout()
        for row in (result_row, control_row):
            row.setSpacing(8)
        result_row.addWidget(label(_("Reply"), "title"))
        result_row.addWidget(self.chip)
        result_row.addWidget(self.details, 1)
        control_row.addStretch(1)
        control_row.addWidget(self.format_switch)
        control_row.addWidget(self.copy_button)
        self._header = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._header.setContentsMargins(12, 4, 8, 0)
        self._header.setSpacing(4)
        self._header.addLayout(result_row, 1)
        self._header.addLayout(control_row)
        return self._header

    def minimumSizeHint(self) -> QSize:
        # With a wider minimum width the values of the reply would be clipped.
        return QSize(round(self._theme.scaled(MIN_WIDTH_PX)), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        is_narrow = self.width() < self._theme.scaled(ONE_ROW_WIDTH_PX)
        direction = QBoxLayout.Direction.TopToBottom if is_narrow else QBoxLayout.Direction.LeftToRight
        if self._header.direction() != direction:
            self._header.setDirection(direction)

    def show_record(self, record: CallRecord | None, waited_s: float = 0.0) -> None:
        """Show a call and its reply.

        Args:
            record: Call to show; None shows an empty view.
            waited_s: Time in s since the start of a pending call.
        """
        if record is not None and record.state == "waiting":
            self.chip.set(_("waiting {time}").format(time=seconds_text(waited_s)), "info", "circle-dashed")
        if record == self.record and record is not None:
            return
        self.record = record
        has_reply = record is not None and record.state == "answered" and record.is_retained
        self.format_switch.setVisible(has_reply)
        self.copy_button.setVisible(has_reply)
        if record is None:
            self.chip.set("")
            self.details.setText("")
            self.message_label.setText(_("No calls yet."))
        elif record.state != "waiting":
            status = "ok" if record.state == "answered" else "off" if record.state == "canceled" else "error"
            self.chip.set(call_text(record), status)
        self._update_details(record)
        if has_reply and record is not None:
            self.model.set_rows(reply_rows(record.reply) if not record.is_truncated else [])
            self.text.set_text(record.text)
        self._set_mode(self.format_switch.value)

    def _update_details(self, record: CallRecord | None) -> None:
        if record is None:
            return
        self.details.setText(clock_text(record))
        if record.state == "waiting":
            self.message_label.setText(_("Waiting for the reply…"))
        elif record.state != "answered":
            self.message_label.setText(record.error)
        elif not record.is_retained:
            self.message_label.setText(_("The reply was discarded to make room for newer ones."))
        else:
            size = size_text(len(record.text.encode("utf-8", "replace")))
            self.details.setText(_("{time}, {size}").format(time=clock_text(record), size=size))

    def _set_mode(self, mode: str) -> None:
        record = self.record
        if record is None or record.state != "answered" or not record.is_retained:
            self.pages.setCurrentIndex(0)
        else:
            self.pages.setCurrentIndex(2 if mode == "json" or record.is_truncated else 1)

    def _copy(self) -> None:
        if self.record is not None:
            QGuiApplication.clipboard().setText(self.record.text)
            self._toast(_("Copied the reply of {service}").format(service=self.record.service))


def _name_cell(row: ReplyRow) -> Cell:
    return Cell(row.name, mono=True, role="textSecondary", indent=row.depth * INDENT_PX)


def _value_cell(row: ReplyRow) -> Cell:
    return Cell(row.text, mono=True)
