"""Surveys: a surveyor asks all respondents at once. Made by `Node.new_surveyor` and `Node.new_respondent`."""

from __future__ import annotations

import contextlib
import logging
import queue
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from nep.backends.services import OpenCall, Outcome, SurveyTransport
from nep.errors import ClosedError, NepError, WaitTimeoutError
from nep.i18n import _
from nep.messages.codecs import Codec, codec_numbered
from nep.patterns.services.client import SLICE_S, Limit
from nep.patterns.services.server import Server
from nep.patterns.services.typed import UNTYPED, CallTypes
from nep.protocol.service_wire import SURVEY, CallKind, read_failure
from nep.system.arguments import at_least, seconds
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Respondent", "Surveyor"]

_logger = logging.getLogger("nep.patterns.services")


class Surveyor:
    """Asks all respondents of a survey; gives the answers that come until the time is up. From any thread.

    Respondents are those that were registered when it asks; when all of them have answered it waits no
    longer. One that fails, refuses or ends has no answer: it is counted in `failures` and logged.
    """

    def __init__(
        self,
        transport: SurveyTransport,
        survey: str,
        codec: Codec,
        timeout_s: float | None,
        on_close: Callable[[Surveyor], object],
        types: CallTypes = UNTYPED,
    ) -> None:
        self._transport = transport
        self._types = types
        self.survey = survey.removeprefix(SURVEY)
        self.timeout_s = timeout_s
        self._codec = types.request.codec(codec)
        self._on_close = on_close
        self._is_forked = False
        self._sent: Iterator[object] | None = None
        self.failures = 0
        """Respondents that were asked and had no answer but an error."""

    @property
    def respondents(self) -> int:
        """How many there are now."""
        return self._transport.respondents

    @property
    def late(self) -> int:
        """Answers that came after their time; they were dropped."""
        return self._transport.late

    @property
    def is_closed(self) -> bool:
        """Whether it, or its node, was closed."""
        return self._transport.is_closed

    def ask(
        self, question: object, timeout_s: Limit = "default", *, expect: int | None = None
    ) -> list[object]:
        """The answers, in the order in which they came; of `expect` respondents at most.

        Raises `EncodeError`, `ClosedError`, and `NepError` when too much is under way.
        """
        return list(self.answers(question, timeout_s, expect=expect))

    def answers(
        self, question: object, timeout_s: Limit = "default", *, expect: int | None = None
    ) -> Iterator[object]:
        """Each answer as it comes. The question is sent before this returns. Raises as `ask` does."""
        limit_s = self.timeout_s if timeout_s == "default" else seconds("timeout_s", timeout_s)
        if expect is not None:
            at_least("expect", expect, 1)
        if self._transport.is_closed:
            raise self._closed_error()
        outcomes: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        deadline = None if limit_s is None else time.monotonic() + limit_s
        calls = self._transport.begin_all(self._codec.encode(question).data, limit_s, outcomes.put)
        return self._collected(calls, outcomes, deadline, expect)

    def _collected(
        self,
        calls: Sequence[OpenCall],
        outcomes: queue.SimpleQueue[Outcome],
        deadline: float | None,
        expect: int | None,
    ) -> Iterator[object]:
        left, wanted = len(calls), len(calls) if expect is None else expect
        try:
            while left and wanted:
                wait_s = SLICE_S if deadline is None else min(SLICE_S, deadline - time.monotonic())
                outcome = None
                with contextlib.suppress(queue.Empty):
                    outcome = outcomes.get(timeout=wait_s) if wait_s > 0.0 else outcomes.get_nowait()
                if self._is_forked:
                    raise self._closed_error()
                if outcome is None:
                    if wait_s <= 0.0:
                        return
                    continue
                if isinstance(outcome, ClosedError):
                    raise outcome
                left -= 1
                with contextlib.suppress(NepError):
                    answer = self._read(outcome)
                    wanted -= 1
                    yield answer
        finally:
            self._transport.forget_all(calls)

    def _read(self, outcome: Outcome) -> object:
        """The answer. Raises `NepError` when it is none."""
        try:
            if isinstance(outcome, NepError):
                raise outcome
            if outcome.kind != CallKind.ANSWER:
                name, reason = read_failure(outcome.data)
                raise NepError(f"{name}: {reason}" if name else reason)
            codec = codec_numbered(outcome.codec)
            if codec is None:
                raise NepError(_("this version has no such codec; update nep"))
            return self._types.answer.read(codec.decode(outcome.data, {}), len(outcome.data))
        except WaitTimeoutError:  # it may be slow: that is no failure
            raise
        except NepError as error:
            self.failures += 1
            if is_logged(self.failures):
                _logger.warning(
                    "a respondent of '%s' has no answer (%d so far): %s", self.survey, self.failures, error
                )
            raise

    # ---- as the original NEP has it

    def send_json(self, question: object) -> None:
        """Ask; `listen_json` gives the answers. What has not come of the last question is forgotten."""
        self._sent = self.answers(question)

    def listen_json(self) -> tuple[bool, object]:
        """(True, the next answer), or (False, {}) when the time is up or all have answered."""
        if self._sent is None:
            raise NepError(_("nothing was asked; call 'send_json' first"))
        for answer in self._sent:
            return True, answer
        return False, {}

    # ---- the end

    def close(self) -> None:
        """Unregister and end. May be called twice."""
        if self._is_forked:
            return
        self._transport.close()
        self._on_close(self)

    def forked(self) -> None:
        """In a child that was forked. See `nep.system.forks`."""
        self._is_forked = True
        self._transport.forked()

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("surveyor of '{survey}'").format(survey=self.survey), is_forked=self._is_forked)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Surveyor({self.survey!r})"


class Respondent(Server):
    """Answers a survey's questions: by its callback, or by `listen_json` and `send_json`. See `Server`."""

    @property
    def survey(self) -> str:
        """The survey's name."""
        return self.service.removeprefix(SURVEY)

    def listen_json(self, block_mode: bool = False) -> tuple[bool, object]:
        """(True, the next question), or (False, {}) when none is there. With `block_mode` it waits for one.

        `send_json` answers it. Raises as `listen_info` does.
        """
        question = self.listen_info(None if block_mode else 0.0)
        return (False, {}) if self._asked is None else (True, question)

    def send_json(self, answer: object) -> None:
        """Answer the question that `listen_json` gave. Raises as `send_info` does."""
        self.send_info(answer)

    def __repr__(self) -> str:
        return f"Respondent({self.survey!r})"
