"""Surveys over a SURVEYOR socket without a master, as in the original NEP.

The surveyor binds the port. Requests and replies are plain JSON. If a respondent's callback raises, the
reply is `{"nep_error": …}`, as in services of the original NEP.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from nep.backends.connection import Direct
from nep.backends.nanomsg.direct import attach
from nep.backends.nanomsg.library import Connections, load_pynng, new_socket
from nep.backends.nanomsg.server import close_context, receive
from nep.backends.services import ClientSpec, OpenCall, Outcome, check_call_limits
from nep.backends.zeromq.transport import close_on_error
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.service_wire import ORIGINAL

_JSON_CODEC = 1
_MAX_SURVEY_TIMEOUT_MS = 2**31 - 1
_JOIN_TIMEOUT_S = 2.0

OutcomeCallback = Callable[[Outcome], None]


@dataclass(eq=False)
class _Survey:
    # Survey in progress; a thread receives the replies in its pynng context.
    number: int
    context: Any
    remaining_replies: int
    callback: OutcomeCallback
    is_finished: bool = False
    thread: threading.Thread | None = field(default=None)
    send_lock: threading.Lock = field(default_factory=threading.Lock)


class NanomsgSurveyor:
    """Surveyor on a SURVEYOR socket. Implements `SurveyTransport`."""

    def __init__(
        self, spec: ClientSpec, direct: Direct, on_close: Callable[[NanomsgSurveyor], object]
    ) -> None:
        if spec.codec.number != _JSON_CODEC:
            raise NepError(_("surveys without a master use JSON; omit msg_type"))
        self.spec = spec
        self.is_closed = False
        self.late = 0
        """Always 0, because pynng drops late replies."""
        self._on_close = on_close
        self._lock = threading.Lock()
        self._surveys: dict[int, _Survey] = {}
        self._survey_count = 0
        self._socket: Any = new_socket("Surveyor0")
        self._connections = Connections(self._socket)
        with close_on_error(self._socket.close):
            attach(self._socket, direct, is_publisher=True, owner=f"a surveyor of '{spec.service}'")

    @property
    def respondents(self) -> int:
        """Number of connected respondents."""
        return len(self._connections)

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for a respondent to connect."""
        self._connections.wait_for_any(timeout_s)

    def start_survey(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> list[OpenCall]:
        """Send a request to all connected respondents; return one entry for each of them.

        All entries are the same object, because nng has no separate call for each respondent. The list
        is empty if no respondent is connected. See `SurveyTransport.start_survey`.
        """
        with self._lock:
            if self.is_closed:
                raise self._closed_error()
            check_call_limits(self.spec.service, len(self._surveys), 0, len(data))
            count = len(self._connections)
            if not count:
                return []
            limit_ms = (
                _MAX_SURVEY_TIMEOUT_MS
                if timeout_s is None
                else min(_MAX_SURVEY_TIMEOUT_MS, round(timeout_s * 1000))
            )
            self._socket.survey_time = max(1, limit_ms)
            self._survey_count += 1
            survey = _Survey(self._survey_count, self._socket.new_context(), count, callback)
            survey.thread = threading.Thread(
                target=self._receive_replies, args=(survey,), name=f"nep-{self.spec.service}", daemon=True
            )
            self._surveys[survey.number] = survey
        # Without the lock: callbacks in pynng's threads acquire it, and sending may wait for them.
        with survey.send_lock, contextlib.suppress(load_pynng().NNGException):  # already closed
            survey.context.send(bytes(data))
            survey.thread.start()
        return [survey] * count

    def _receive_replies(self, survey: _Survey) -> None:
        while survey.remaining_replies and (data := receive(survey.context)) is not None:
            survey.remaining_replies -= 1
            if survey.is_finished:
                return
            survey.callback(ORIGINAL.read_reply([b"", data]).reply)

    def cancel_all(self, calls: Sequence[OpenCall]) -> None:
        """Cancel the survey; its callback isn't called."""
        for call in calls[:1]:
            with self._lock:
                survey = self._surveys.pop(call.number, None)
            if survey is not None:
                self._finish(survey)

    def _finish(self, survey: _Survey) -> None:
        survey.is_finished = True
        with survey.send_lock:  # nng aborts the process if a context is closed while it sends
            close_context(survey.context)
        thread = survey.thread
        if thread is not None and thread.ident is not None and thread is not threading.current_thread():
            thread.join(_JOIN_TIMEOUT_S)

    def close(self) -> None:
        """Close the surveyor; surveys in progress fail with `ClosedError`. Idempotent."""
        with self._lock:
            if self.is_closed:
                return
            self.is_closed = True
            surveys, self._surveys = list(self._surveys.values()), {}
        self._on_close(self)
        for survey in surveys:
            self._finish(survey)
            survey.callback(self._closed_error())
        self._socket.close()

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("surveyor of '{survey}'").format(survey=self.spec.service))
