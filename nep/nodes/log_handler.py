"""Log records on the bus: what programs log travels on `/nep/log`, to Studio's Console and to `nep log`.

    node.log.warning("the battery is at %d %%", 9)
    logging.getLogger().addHandler(node.log_handler)      # all that this program logs

A node that logs errors also keeps the last of them, latched on `/nep/log/errors`, as long as it lives.
A node that never logs has no thread and no publisher for it. A flood is cut to `RATE_HZ` records a second;
what is left out is counted, and the count is a record of its own.
"""

from __future__ import annotations

import logging
import os
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from nep.errors import ClosedError, NepError
from nep.i18n import _, ngettext, number
from nep.system.forks import watch
from nep.text import bounded_str, shortened

__all__ = [
    "BURST",
    "LAST_ERRORS_TOPIC",
    "LAST_ERRORS_TYPE",
    "LEVELS",
    "LOG_TOPIC",
    "LOG_TYPE",
    "RATE_HZ",
    "LogHandler",
    "LogRecord",
    "ShownErrors",
    "level_of",
]

LOG_TOPIC = "/nep/log"
LOG_TYPE = "nep/log"
LAST_ERRORS_TOPIC = "/nep/log/errors"
LAST_ERRORS_TYPE = "nep/log_errors"
"""A latched list of the last errors of a node, for whoever comes later; there once it has logged one."""
LAST_ERRORS = 20
LEVELS = ("debug", "info", "warning", "error", "critical")
"""The levels of a record, the quietest first."""
RATE_HZ = 100.0
BURST = 200
"""How many records a node may publish at once; after that `RATE_HZ` of them a second."""
TEXT_LIMIT = 8_000
"""Letters of a record's text; a longer one is cut and says so."""

_ERROR_TEXT_LIMIT = 1_000
_SHOWN = 2_000
_SAY_LEFT_OUT_S = 1.0
_FLUSH_S = 1.0
_AGAIN_S = 1.0
_WAITING = 1_000
_OWN = "nep_published_by"
_ERRORS = ("error", "critical")
_ALIASES = {"warn": "warning", "fatal": "critical", "err": "error", "trace": "debug"}


@dataclass(frozen=True, slots=True)
class LogRecord:
    """One record: `level` (one of `LEVELS`), `text`, `name` of the logger, `node`, `stamp_ns` since 1970.

    `file` and `line` say where it was logged, `pid` in which process; None where that is not known.
    """

    level: str
    text: str
    name: str
    node: str
    stamp_ns: int
    file: str | None = None
    line: int | None = None
    pid: int | None = None

    def to_plain(self) -> dict[str, object]:
        """The payload of a message; what is not known is left out."""
        plain: dict[str, object] = {
            "level": self.level,
            "text": self.text,
            "name": self.name,
            "node": self.node,
            "stamp_ns": self.stamp_ns,
        }
        more = {"file": self.file, "line": self.line, "pid": self.pid}
        return plain | {key: value for key, value in more.items() if value is not None}

    @classmethod
    def from_plain(cls, payload: object, stamp_ns: int | None = None) -> LogRecord:
        """A payload as a record. Whatever somebody published becomes one: what does not fit is left out.

        `stamp_ns` stands in for a record that has no stamp of its own.
        """
        given = payload if isinstance(payload, Mapping) else {"text": payload}
        text, stamp = given.get("text"), _number(given.get("stamp_ns"))
        return cls(
            level_of(given.get("level")),
            "" if text is None else bounded_str(text, TEXT_LIMIT),
            _word(given.get("name")),
            _word(given.get("node")),
            stamp if stamp is not None and 0 < stamp < 1 << 63 else stamp_ns or 0,
            _word(given.get("file")) or None,
            _number(given.get("line")),
            _number(given.get("pid")),
        )


def level_of(given: object) -> str:
    """The level of that name, also as others write it ("WARN"); "info" for what is none."""
    word = given.strip().lower() if isinstance(given, str) else ""
    word = _ALIASES.get(word, word)
    return word if word in LEVELS else "info"


class ShownErrors:
    """Which errors were shown already: each comes live and again in the lists of the last ones.

    Keeps the newest 2000.
    """

    def __init__(self) -> None:
        self._shown: dict[tuple[str, int, str], None] = {}

    def is_new(self, record: LogRecord) -> bool:
        """Whether it is to be shown: any that is no error, and each error once."""
        if record.level not in _ERRORS:
            return True
        key = (record.node, record.stamp_ns, record.text[:100])
        if key in self._shown:
            return False
        self._shown[key] = None
        if len(self._shown) > _SHOWN:
            del self._shown[next(iter(self._shown))]
        return True

    def new_in(self, payload: object) -> list[LogRecord]:
        """Those in a list of last errors that were not shown yet, oldest first."""
        given = payload[-LAST_ERRORS:] if isinstance(payload, list) else []
        records = sorted(map(LogRecord.from_plain, given), key=lambda record: record.stamp_ns)
        return [record for record in records if record.stamp_ns and self.is_new(record)]


class LogPublisher(Protocol):
    """What a handler needs of a publisher."""

    def publish(self, payload: object) -> None:
        """Publish one payload."""


class LogNode(Protocol):
    """What a node's handler needs of the node."""

    name: str

    def new_pub(self, topic: str, msg_type: str, *, latched: bool = False) -> LogPublisher:
        """A publisher."""


class LogHandler(logging.Handler):
    """Publishes what is logged, as records of `node`. Never blocks who logs and never raises.

    `open_publisher` is called in a thread of the handler's own when the first record comes, and again each
    second until it succeeds; so long records wait, 1000 of them at most. `open_errors` is called when the
    first error comes, for a latched publisher of the last ones; without it nobody keeps them.
    """

    def __init__(
        self,
        node: str,
        open_publisher: Callable[[], LogPublisher],
        *,
        open_errors: Callable[[], LogPublisher] | None = None,
        rate_hz: float = RATE_HZ,
        burst: int = BURST,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.logger = logging.Logger(node, logging.INFO)  # noqa: LOG001 - lives as long as its node
        """What it logs from INFO on is published, and also goes where the program logs."""
        self.logger.parent = logging.getLogger()
        self.logger.addHandler(self)
        self._node = node
        self._open = open_publisher
        self._open_errors = open_errors
        self._errors: deque[dict[str, object]] = deque(maxlen=LAST_ERRORS)
        self._errors_publisher: LogPublisher | None = None
        self._rate_hz, self._burst, self._clock = rate_hz, burst, clock
        self._tokens, self._counted_at = float(burst), clock()
        self._waiting: deque[dict[str, object]] = deque()
        self._left_out = 0
        self._told_at = float("-inf")
        self._has_work = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_closed = False
        watch(self)

    @property
    def left_out(self) -> int:
        """Records that were left out and not told yet."""
        return self._left_out

    def emit(self, record: logging.LogRecord) -> None:
        """Hand one record over to the handler's thread."""
        if getattr(record, _OWN, None) is self or threading.current_thread() is self._thread:
            return  # it came twice (by the node's logger and by the root), or is about our own publishing
        setattr(record, _OWN, self)
        with self._has_work:
            if self._is_closed:
                return
            if not self._may():
                self._left_out += 1
                return
        try:
            plain = self._plain(record)
        except Exception:  # noqa: BLE001 - a program must not end because of how it logs
            self.handleError(record)
            return
        with self._has_work:
            if len(self._waiting) >= _WAITING:
                self._left_out += 1
                return
            try:
                self._begin()
            except RuntimeError:  # the interpreter is ending (from 3.12 on), or no thread can be had
                self._left_out += 1
                return
            self._waiting.append(plain)
            self._has_work.notify()

    def close(self, timeout_s: float = _FLUSH_S) -> None:
        """Publish what waits, within `timeout_s`; what is logged later is dropped. May be called twice."""
        with self._has_work:
            self._is_closed = True
            thread = self._thread
            self._has_work.notify()
        if thread is not None and thread is not threading.current_thread():
            thread.join(max(0.0, timeout_s))
        super().close()

    def forked(self) -> None:
        """In a child that was forked: its node is closed there. See `nep.system.forks`."""
        self._is_closed = True
        self._has_work = threading.Condition()
        self._thread = None
        self._waiting.clear()
        self._left_out = 0

    # ---- inside

    def _may(self) -> bool:
        """Whether one more record may be published now; called under the lock."""
        now = self._clock()
        self._tokens = min(float(self._burst), self._tokens + (now - self._counted_at) * self._rate_hz)
        self._counted_at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def _plain(self, record: logging.LogRecord) -> dict[str, object]:
        text = record.getMessage()
        if record.exc_info and record.exc_info[0] is not None:
            text += "\n" + "".join(traceback.format_exception(*record.exc_info)).rstrip()
        if len(text) > TEXT_LIMIT:
            text = _("{text}… ({count} characters)").format(text=text[:TEXT_LIMIT], count=len(text))
        return LogRecord(
            _named(record.levelno),
            text,
            record.name,
            self._node,
            int(record.created * 1e9),
            Path(record.pathname).name or None,
            record.lineno,
            os.getpid(),
        ).to_plain()

    def _begin(self) -> None:
        if self._thread is None:
            thread = threading.Thread(target=self._run, name=f"{self._node} log", daemon=True)
            thread.start()
            self._thread = thread

    def _run(self) -> None:
        publisher = self._opened()
        if publisher is None:
            return
        while (records := self._next()) is not None:
            for record in records:
                try:
                    publisher.publish(record)
                except NepError:
                    return  # the node is closed
            self._keep_errors([record for record in records if record["level"] in _ERRORS])

    def _keep_errors(self, records: list[dict[str, object]]) -> None:
        """Publish the last errors again, with these, for whoever comes later."""
        if not records or self._open_errors is None:
            return
        for record in records:
            text = shortened(str(record["text"]), _ERROR_TEXT_LIMIT)
            self._errors.append({**record, "text": text})
        with suppress(NepError):  # with the next error it is tried again
            if self._errors_publisher is None:
                self._errors_publisher = self._open_errors()
            self._errors_publisher.publish(list(self._errors))

    def _opened(self) -> LogPublisher | None:
        """The publisher, as soon as there is one; None when the handler was closed meanwhile."""
        while True:
            try:
                return self._open()
            except ClosedError:
                return None
            except NepError:
                with self._has_work:
                    if self._is_closed or self._has_work.wait_for(lambda: self._is_closed, _AGAIN_S):
                        return None

    def _next(self) -> list[dict[str, object]] | None:
        """What is to be published now; None at the end. Waits."""
        with self._has_work:
            while not self._waiting and not self._is_closed:
                # how many were left out is told once a second while it goes on, and when it is over
                told = self._has_work.wait(_SAY_LEFT_OUT_S if self._left_out else None)
                if not told and self._left_out:
                    break
            records = list(self._waiting)
            self._waiting.clear()
            if not records and not self._left_out:
                return None
            if self._left_out and (self._is_closed or self._is_time()):
                records.append(self._left_out_record())
            return records

    def _is_time(self) -> bool:
        return self._clock() - self._told_at >= _SAY_LEFT_OUT_S

    def _left_out_record(self) -> dict[str, object]:
        count, self._left_out = self._left_out, 0
        self._told_at = self._clock()
        text = ngettext(
            "{count} log record was left out: more than {rate_hz} a second",
            "{count} log records were left out: more than {rate_hz} a second",
            count,
        ).format(count=count, rate_hz=number(self._rate_hz))
        return LogRecord("warning", text, "nep.log", self._node, time.time_ns(), pid=os.getpid()).to_plain()


def handler_of(node: LogNode) -> LogHandler:
    """A handler that publishes on `LOG_TOPIC` as this node."""
    return LogHandler(
        node.name,
        lambda: node.new_pub(LOG_TOPIC, LOG_TYPE),
        open_errors=lambda: node.new_pub(LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, latched=True),
    )


def _named(level: int) -> str:
    return LEVELS[0] if level < logging.INFO else LEVELS[min(4, level // 10 - 1)]


def _word(given: object) -> str:
    return given[:200] if isinstance(given, str) else ""


def _number(given: object) -> int | None:
    return given if isinstance(given, int) and not isinstance(given, bool) else None
