"""Surveys without a master, by SP's SURVEYOR and RESPONDENT, as the original NEP and libnanomsg have them.

The surveyor binds the port. A question and an answer are JSON with nothing around it; what a callback raises
travels as the answer `{"nep_error": …}`, as with the original's services.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from nep.backends.connection import Direct
from nep.backends.nanomsg.direct import attach
from nep.backends.nanomsg.library import keep_for_ever, library, new_socket
from nep.backends.services import (
    CallQueue,
    ClientSpec,
    IncomingCall,
    OpenCall,
    Outcome,
    ServerSpec,
    Tally,
    check_calls,
    fitting,
    refusal,
)
from nep.backends.zeromq.sockets import wait_until
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.service_wire import ORIGINAL, Reply

__all__ = ["NanomsgRespondent", "NanomsgSurveyor", "Surveys"]

_logger = logging.getLogger("nep")
_JSON = 1
_LONGEST_MS = 2**31 - 1
_JOIN_S = 2.0
_LINGER_S = 0.2
"""pynng throws away what it has queued when it is closed: the last answer gets so long."""

Then = Callable[[Outcome], None]


@dataclass(eq=False)
class _Question:
    """A question that is open: `context` of pynng hears its answers, in a thread of its own."""

    number: int
    context: Any
    left: int
    then: Then
    is_over: bool = False
    thread: threading.Thread | None = field(default=None)


class NanomsgSurveyor:
    """Owns a SURVEYOR. See `SurveyTransport`."""

    def __init__(
        self, spec: ClientSpec, direct: Direct, on_close: Callable[[NanomsgSurveyor], object]
    ) -> None:
        if spec.codec.number != _JSON:
            raise NepError(_("a survey without a master is JSON; leave out msg_type"))
        self.spec = spec
        self.is_closed = False
        self.late = 0
        """Nobody can know: pynng drops them."""
        self._on_close = on_close
        self._changed = threading.Condition(threading.Lock())
        self._pipes: set[int] = set()
        self._questions: dict[int, _Question] = {}
        self._asked = 0
        self._socket: Any = new_socket("Surveyor0")
        self._socket.add_post_pipe_connect_cb(self._came)
        self._socket.add_post_pipe_remove_cb(self._went)
        try:
            attach(self._socket, direct, is_publisher=True, what=f"a surveyor of '{spec.service}'")
        except BaseException:
            self._socket.close()
            raise

    @property
    def respondents(self) -> int:
        """How many are connected."""
        return len(self._pipes)

    def _came(self, pipe: Any) -> None:  # noqa: ANN401 - pynng has no types
        with self._changed:
            self._pipes.add(pipe.id)
            self._changed.notify_all()

    def _went(self, pipe: Any) -> None:  # noqa: ANN401 - pynng has no types
        with self._changed:
            self._pipes.discard(pipe.id)

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait until somebody is connected."""
        with self._changed:
            wait_until(self._changed, lambda: bool(self._pipes), timeout_s)

    def begin_all(self, data: bytes | memoryview, timeout_s: float | None, then: Then) -> list[OpenCall]:
        """Ask. An item for each that is connected, all of them the same question."""
        with self._changed:
            if self.is_closed:
                raise self._closed_error()
            check_calls(self.spec.service, len(self._questions), 0, len(data))
            count = len(self._pipes)
            if not count:
                return []
            limit_ms = _LONGEST_MS if timeout_s is None else min(_LONGEST_MS, round(timeout_s * 1000))
            self._socket.survey_time = max(1, limit_ms)
            self._asked += 1
            question = _Question(self._asked, self._socket.new_context(), count, then)
            question.thread = threading.Thread(
                target=self._hear, args=(question,), name=f"nep-{self.spec.service}", daemon=True
            )
            self._questions[question.number] = question
        # Without the lock: pynng's threads take it when somebody connects, and sending may wait for them.
        with contextlib.suppress(library().NNGException):  # it is closed just now
            question.context.send(bytes(data))
            question.thread.start()
        return [question] * count

    def _hear(self, question: _Question) -> None:
        while question.left and (data := _heard(question.context)) is not None:
            question.left -= 1
            if question.is_over:
                return
            question.then(ORIGINAL.read_answer([b"", data]).reply)

    def forget_all(self, calls: Sequence[OpenCall]) -> None:
        """The question is over."""
        for call in calls[:1]:
            with self._changed:
                question = self._questions.pop(call.number, None)
            if question is not None:
                self._end(question)

    def _end(self, question: _Question) -> None:
        question.is_over = True
        _close(question.context)
        thread = question.thread
        if thread is not None and thread.ident is not None and thread is not threading.current_thread():
            thread.join(_JOIN_S)

    def close(self) -> None:
        """End; questions that are open end with `ClosedError`. May be called twice."""
        with self._changed:
            if self.is_closed:
                return
            self.is_closed = True
            questions, self._questions = list(self._questions.values()), {}
        self._on_close(self)
        for question in questions:
            self._end(question)
            question.then(self._closed_error())
        self._socket.close()

    def forked(self) -> None:
        """In a child that was forked: nothing of nng may be touched."""
        self.is_closed = True
        self._changed = threading.Condition(threading.Lock())
        for question in self._questions.values():
            keep_for_ever(question.context)

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("surveyor of '{survey}'").format(survey=self.spec.service))


class NanomsgRespondent:
    """Owns a RESPONDENT, and a thread that hears questions. See `ServerTransport`."""

    def __init__(
        self, spec: ServerSpec, direct: Direct, on_close: Callable[[NanomsgRespondent], object]
    ) -> None:
        self.spec = spec
        self.calls = CallQueue()
        self.tally = Tally()
        self.is_closed = False
        self._on_close = on_close
        self._lock = threading.Lock()
        self._answered_at = 0.0
        self._contexts: set[Any] = set()
        """Those that hear a question, or whose question has no answer yet."""
        self._pause = threading.Event()
        self._socket: Any = new_socket("Respondent0")
        try:
            endpoint = attach(
                self._socket, direct, is_publisher=False, what=f"a respondent of '{spec.service}'"
            )
        except BaseException:
            self._socket.close()
            raise
        self.endpoints: tuple[str, ...] = (endpoint,)
        self._thread = threading.Thread(target=self._hear, name=f"nep-{spec.service}", daemon=True)
        self._thread.start()

    def _hear(self) -> None:
        while (context := self._new_context()) is not None and (data := _heard(context)) is not None:
            call = IncomingCall(data, _JSON, None, self._answerer(context))
            if not self.calls.put(call):
                call.answer(refusal(self.spec.service, is_closed=self.calls.is_closed))

    def _new_context(self) -> Any:  # noqa: ANN401 - pynng has no types
        """None when it is closed."""
        with self._lock:
            if self.is_closed:
                return None
            context = self._socket.new_context()
            self._contexts.add(context)
            return context

    def _answerer(self, context: Any) -> Callable[[Reply], bool]:  # noqa: ANN401 - pynng has no types
        def answer(reply: Reply) -> bool:
            fit = fitting(reply)
            self.tally.add(fit)
            with self._lock:
                if self.is_closed:
                    return False
                self._answered_at = time.monotonic()
                self._contexts.discard(context)
                try:
                    context.send(bytes(ORIGINAL.answer(0, fit)[1]))
                except library().NNGException as error:  # nobody waits for it any more
                    _logger.debug("an answer of '%s' could not be sent: %s", self.spec.service, error)
                    return False
                finally:
                    _close(context)
            return True

        return answer

    def begin_close(self) -> None:
        """Nothing is answered any more; who waits is told."""
        for call in self.calls.close():
            call.answer(refusal(self.spec.service, is_closed=True))

    def close(self, timeout_s: float) -> None:
        """The same, and end. May be called twice."""
        self.begin_close()
        with self._lock:
            if self.is_closed:
                return
            self.is_closed = True
        self._on_close(self)
        left = min(timeout_s, self._answered_at + _LINGER_S - time.monotonic())
        if left > 0.0:
            self._pause.wait(left)
        for context in self._contexts:  # before the socket: pynng cannot do so afterwards
            _close(context)
        self._contexts.clear()
        self._socket.close()
        self._thread.join(_JOIN_S)

    def forked(self) -> None:
        """In a child that was forked: nothing of nng may be touched."""
        self.is_closed = True
        self._lock = threading.Lock()
        self.calls.forked()
        for context in self._contexts:
            keep_for_ever(context)


def _heard(context: Any) -> bytes | None:  # noqa: ANN401 - pynng has no types
    """The next that comes; None when its time is up, or it is closed."""
    try:
        data: bytes = context.recv()
    except (library().NNGException, TypeError):  # the latter is what pynng says of one that was closed before
        return None
    return data


def _close(context: Any) -> None:  # noqa: ANN401 - pynng has no types
    with contextlib.suppress(library().NNGException):  # it is closed already
        context.close()


class Surveys:
    """The surveyors and respondents of one node that need no master. Part of `NanomsgTransport`."""

    def __init__(self, node_name: str) -> None:
        self._node_name = node_name
        self._lock = threading.Lock()
        self._surveyors: set[NanomsgSurveyor] = set()
        self._respondents: set[NanomsgRespondent] = set()
        self._is_closed = False

    def surveyor(self, spec: ClientSpec, direct: Direct, wait_s: float) -> NanomsgSurveyor:
        """A new one; waits for somebody who is connected."""
        self._check_open()
        surveyor = NanomsgSurveyor(spec, direct, self._surveyors.discard)
        with self._lock:
            self._surveyors.add(surveyor)
        try:
            surveyor.wait_for_any(wait_s)
            self._check_open()
        except BaseException:
            surveyor.close()
            raise
        return surveyor

    def respondent(self, spec: ServerSpec, direct: Direct) -> NanomsgRespondent:
        """A new one."""
        self._check_open()
        respondent = NanomsgRespondent(spec, direct, self._respondents.discard)
        with self._lock:
            self._respondents.add(respondent)
        try:
            self._check_open()
        except BaseException:
            respondent.close(0.0)
            raise
        return respondent

    def _check_open(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self._node_name}'")

    def begin_close(self) -> None:
        """Nothing is answered any more; who waits is told."""
        with self._lock:
            self._is_closed = True
            respondents = tuple(self._respondents)
        for respondent in respondents:
            respondent.begin_close()

    def close(self, timeout_s: float) -> None:
        """End all of them."""
        with self._lock:
            surveyors, respondents = tuple(self._surveyors), tuple(self._respondents)
        for surveyor in surveyors:
            surveyor.close()
        deadline = time.monotonic() + timeout_s
        for respondent in respondents:
            respondent.close(max(0.0, deadline - time.monotonic()))

    def forked(self) -> None:
        """In a child that was forked. See `nep.system.forks`."""
        self._is_closed = True
        self._lock = threading.Lock()
        for surveyor in self._surveyors:
            surveyor.forked()
        for respondent in self._respondents:
            respondent.forked()
