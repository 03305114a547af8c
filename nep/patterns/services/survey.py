"""`Surveyor` and `Respondent`. See `Node.new_surveyor` and `Node.new_respondent`."""

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
from nep.messages.codecs import Codec, codec_by_number
from nep.patterns.services.client import WAIT_SLICE_S, TimeLimit
from nep.patterns.services.server import Server
from nep.patterns.services.typed import UNTYPED, CallTypes
from nep.protocol.service_wire import SURVEY_PREFIX, CallKind, read_error_reply
from nep.system.arguments import check_at_least, check_optional_time_limit
from nep.system.forks import current_generation
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from typing_extensions import Self


_logger = logging.getLogger("nep.patterns.services")


class Surveyor:
    """Client that asks all respondents of a survey and collects the answers within a time limit. Thread-safe.

    Only respondents registered when the question is sent are asked. Iteration ends early when all have
    answered. Errors of respondents are counted in `failures` and logged. Usable as a context manager.

        for answer in surveyor.answers({"unit": "%"}, timeout_s=0.5):
            print(answer)

    Attributes:
        survey: Name of the survey.
        timeout_s: Default time limit of questions in seconds; None for no limit.
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
        self.survey = survey.removeprefix(SURVEY_PREFIX)
        self.timeout_s = timeout_s
        self._codec = types.request.codec(codec)
        self._on_close = on_close
        self._generation = current_generation()
        self._answers: Iterator[object] | None = None
        self.failures = 0
        """Number of respondents that replied with an error or stopped before replying."""

    @property
    def respondents(self) -> int:
        """Number of registered respondents of the survey."""
        return 0 if self._generation.is_inherited else self._transport.respondents

    @property
    def late(self) -> int:
        """Number of answers that were dropped because they arrived after the time limit."""
        return 0 if self._generation.is_inherited else self._transport.late

    @property
    def is_closed(self) -> bool:
        """True if the surveyor or its node was closed."""
        return self._generation.is_inherited or self._transport.is_closed

    def ask(
        self, question: object, timeout_s: TimeLimit = "default", *, expect: int | None = None
    ) -> list[object]:
        """Send a question and return the answers in the order of their arrival.

        Args:
            question: Value of the question.
            timeout_s: Time limit in seconds; None waits for all respondents. Default: the surveyor's.
            expect: Return after this number of answers.

        Raises:
            EncodeError: The question can't be encoded.
            ClosedError: The surveyor is closed.
            NepError: Too many calls are in flight.
        """
        return list(self.answers(question, timeout_s, expect=expect))

    def answers(
        self, question: object, timeout_s: TimeLimit = "default", *, expect: int | None = None
    ) -> Iterator[object]:
        """Send a question and iterate over the answers as they arrive. See `ask`.

        The question is sent before this method returns.
        """
        limit_s = (
            self.timeout_s if timeout_s == "default" else check_optional_time_limit("timeout_s", timeout_s)
        )
        if expect is not None:
            check_at_least("expect", expect, 1)
        if self.is_closed:
            raise self._closed_error()
        outcomes: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        deadline = None if limit_s is None else time.monotonic() + limit_s
        calls = self._transport.start_survey(self._codec.encode(question).data, limit_s, outcomes.put)
        return self._collect(calls, outcomes, deadline, expect)

    def _collect(
        self,
        calls: Sequence[OpenCall],
        outcomes: queue.SimpleQueue[Outcome],
        deadline: float | None,
        expect: int | None,
    ) -> Iterator[object]:
        pending, remaining = len(calls), len(calls) if expect is None else expect
        try:
            while pending and remaining:
                wait_s = WAIT_SLICE_S if deadline is None else min(WAIT_SLICE_S, deadline - time.monotonic())
                outcome = None
                with contextlib.suppress(queue.Empty):
                    outcome = outcomes.get(timeout=wait_s) if wait_s > 0.0 else outcomes.get_nowait()
                if self._generation.is_inherited:
                    raise self._closed_error()
                if outcome is None:
                    if wait_s <= 0.0:
                        return
                    continue
                if isinstance(outcome, ClosedError):
                    raise outcome
                pending -= 1
                with contextlib.suppress(NepError):
                    reply = self._decode_reply(outcome)
                    remaining -= 1
                    yield reply
        finally:
            if not self._generation.is_inherited:
                self._transport.cancel_all(calls)

    def _decode_reply(self, outcome: Outcome) -> object:
        # Raises `NepError` for a failure.
        try:
            if isinstance(outcome, NepError):
                raise outcome
            if outcome.kind != CallKind.REPLY:
                name, reason = read_error_reply(outcome.data)
                raise NepError(f"{name}: {reason}" if name else reason)
            codec = codec_by_number(outcome.codec)
            if codec is None:
                raise NepError(_("this version doesn't know the codec of the reply; update nep"))
            return self._types.reply.read(codec.decode(outcome.data, {}), len(outcome.data))
        except WaitTimeoutError:  # slow, but not a failure
            raise
        except NepError as error:
            self.failures += 1
            if is_logged(self.failures):
                _logger.warning(
                    "a respondent of '%s' failed (%d so far): %s", self.survey, self.failures, error
                )
            raise

    # ---- API of the original NEP

    def send_json(self, question: object) -> None:
        """Send a question; `listen_json` returns the answers.

        Unread answers of the last question are discarded.
        """
        self._answers = self.answers(question)

    def listen_json(self) -> tuple[bool, object]:
        """Return (True, next answer), or (False, {}) after the time limit or the last answer.

        Raises `NepError` if no question was sent.
        """
        if self._answers is None:
            raise NepError(_("no request was sent; call 'send_json' first"))
        for reply in self._answers:
            return True, reply
        return False, {}

    # ---- closing

    def close(self) -> None:
        """Unregister and close the surveyor. Idempotent."""
        if self._generation.is_inherited:
            return
        self._transport.close()
        self._on_close(self)

    def _closed_error(self) -> ClosedError:
        return ClosedError(
            _("surveyor of '{survey}'").format(survey=self.survey), is_forked=self._generation.is_inherited
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Surveyor({self.survey!r})"


class Respondent(Server):
    """Respondent of a survey, with a callback or with `listen_json` and `send_json`. Thread-safe.

    The callback runs in the same threads as the callback of a `Server`. An exception is logged in this
    program, and counted at the surveyor in `Surveyor.failures`.

        node.new_respondent("battery", lambda question: {"percent": 87})
        node.spin()
    """

    @property
    def survey(self) -> str:
        """Name of the survey."""
        return self.service.removeprefix(SURVEY_PREFIX)

    def listen_json(self, block_mode: bool = False) -> tuple[bool, object]:
        """Return (True, next question), or (False, {}) if no question is waiting. Reply with `send_json`.

        Args:
            block_mode: Wait for a question without time limit.

        Raises:
            NepError: As `listen_info` does.
        """
        question = self.listen_info(None if block_mode else 0.0)
        return (False, {}) if self._open_request is None else (True, question)

    def send_json(self, answer: object) -> None:
        """Reply to the question that `listen_json` returned. Raises the exceptions of `send_info`."""
        self.send_info(answer)

    def __repr__(self) -> str:
        return f"Respondent({self.survey!r})"
