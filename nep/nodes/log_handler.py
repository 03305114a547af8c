"""Log records as messages: published on `/nep/log`, shown by Studio's Console and by `nep log`.

    node.log.warning("the battery is at %d %%", 9)
    logging.getLogger().addHandler(node.log_handler)      # everything that this program logs

A node that logs errors also publishes the last of them, latched, on `/nep/log/errors`. A node that never logs
has no thread and no publisher for it. The rate is limited to `RATE_HZ` records per second; dropped records
are counted, and the count is published as a record.
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
"""Type of the latched list of a node's last errors, published once the node has logged an error."""
LAST_ERRORS = 20
LEVELS = ("debug", "info", "warning", "error", "critical")
"""Log levels in ascending order of severity."""
RATE_HZ = 100.0
BURST = 200
"""Number of records a node may publish at once, before the limit of `RATE_HZ` applies."""
TEXT_LIMIT = 8_000
"""Maximum length of a record's text in characters; longer texts are truncated."""

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
    """One log record.

    Attributes:
        level: One of `LEVELS`.
        text: The message.
        name: The name of the logger.
        node: The name of the node.
        stamp_ns: Nanoseconds since 1970.
        file: The source file, or None if unknown.
        line: The line number, or None if unknown.
        pid: The process id, or None if unknown.
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
        """Return the payload of a message, without unknown fields."""
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
        """Return the record of a received payload; invalid fields are ignored.

        Args:
            payload: Any received value.
            stamp_ns: The time stamp of a record that has none.
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
    """Return the level of a name, also of common aliases such as "WARN"; "info" for unknown names."""
    word = given.strip().lower() if isinstance(given, str) else ""
    word = _ALIASES.get(word, word)
    return word if word in LEVELS else "info"


class ShownErrors:
    """Filter of errors that were already shown: each error is received live and in the latched list.

    Remembers the newest 2000.
    """

    def __init__(self) -> None:
        self._shown: dict[tuple[str, int, str], None] = {}

    def is_new(self, record: LogRecord) -> bool:
        """Return True for a record that is not an error, and once for each error."""
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
        """Return the errors of a latched list that were not shown yet, oldest first."""
        given = payload[-LAST_ERRORS:] if isinstance(payload, list) else []
        records = sorted(map(LogRecord.from_plain, given), key=lambda record: record.stamp_ns)
        return [record for record in records if record.stamp_ns and self.is_new(record)]


class LogPublisher(Protocol):
    """Publisher as the log handler uses it."""

    def publish(self, payload: object) -> None:
        """Publish one payload."""


class LogNode(Protocol):
    """Node as the log handler uses it."""

    name: str

    def new_pub(self, topic: str, msg_type: str, *, latched: bool = False) -> LogPublisher:
        """Return a new publisher."""


class LogHandler(logging.Handler):
    """Logging handler that publishes records as messages of a node. Never blocks and never raises.

    Args:
        node: The name of the node.
        open_publisher: Called in the handler's thread at the first record, and again every second until it
            succeeds. Up to 1000 records are queued until then.
        open_errors: Called at the first error; opens the latched publisher of the last errors. None: not
            published.
        rate_hz: Maximum rate of records.
        burst: Number of records allowed at once.
        clock: Monotonic clock in seconds.
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
        """Logger whose records from INFO on are published and passed to the root logger."""
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
        """Number of dropped records not yet reported."""
        return self._left_out

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a record for the handler's thread."""
        if getattr(record, _OWN, None) is self or threading.current_thread() is self._thread:
            return  # received twice (from the node's logger and the root), or caused by publishing itself
        setattr(record, _OWN, self)
        with self._has_work:
            if self._is_closed:
                return
            if not self._may():
                self._left_out += 1
                return
        try:
            plain = self._plain(record)
        except Exception:  # noqa: BLE001 - a logging error must not end the program
            self.handleError(record)
            return
        with self._has_work:
            if len(self._waiting) >= _WAITING:
                self._left_out += 1
                return
            try:
                self._begin()
            # the interpreter is shutting down (Python 3.12+), or no thread can be started
            except RuntimeError:
                self._left_out += 1
                return
            self._waiting.append(plain)
            self._has_work.notify()

    def close(self, timeout_s: float = _FLUSH_S) -> None:
        """Publish queued records within `timeout_s` seconds and stop. Later records are dropped.

        Idempotent.
        """
        with self._has_work:
            self._is_closed = True
            thread = self._thread
            self._has_work.notify()
        if thread is not None and thread is not threading.current_thread():
            thread.join(max(0.0, timeout_s))
        super().close()

    def forked(self) -> None:
        """Mark the handler as closed in a forked child process. See `nep.system.forks`."""
        self._is_closed = True
        self._has_work = threading.Condition()
        self._thread = None
        self._waiting.clear()
        self._left_out = 0

    # ---- worker thread

    def _may(self) -> bool:
        # Token bucket. Called with the lock held.
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
        # Republish the latched list with these errors.
        if not records or self._open_errors is None:
            return
        for record in records:
            text = shortened(str(record["text"]), _ERROR_TEXT_LIMIT)
            self._errors.append({**record, "text": text})
        with suppress(NepError):  # retried with the next error
            if self._errors_publisher is None:
                self._errors_publisher = self._open_errors()
            self._errors_publisher.publish(list(self._errors))

    def _opened(self) -> LogPublisher | None:
        # Retry until a publisher can be opened; None when the handler is closed.
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
        # Blocks until there are records; None at the end.
        with self._has_work:
            while not self._waiting and not self._is_closed:
                # the number of dropped records is reported once a second, and at the end of the burst
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
    """Return a handler that publishes on `LOG_TOPIC` as the given node."""
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
