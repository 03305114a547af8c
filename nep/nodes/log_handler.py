"""Log records as messages: published on `/nep/log`, shown by Studio's Console and by `nep log`.

    node.log.warning("the battery is at %d %%", 9)
    logging.getLogger().addHandler(node.log_handler)      # everything that this program logs

A node that logs errors also publishes its last errors, latched, on `/nep/log/errors`. The thread and
the publishers are created when the node logs for the first time. The rate is limited to `MAX_RATE_HZ`
records per second; dropped records are counted, and the count is published as a record.
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
from nep.system.forks import current_generation
from nep.text import bounded_str, shortened

LOG_TOPIC = "/nep/log"
LOG_TYPE = "nep/log"
LAST_ERRORS_TOPIC = "/nep/log/errors"
LAST_ERRORS_TYPE = "nep/log_errors"
"""Type of the latched list of a node's last errors, published once the node has logged an error."""
MAX_LAST_ERRORS = 20
LEVELS = ("debug", "info", "warning", "error", "critical")
"""Log levels in ascending order of severity."""
MAX_RATE_HZ = 100.0
MAX_BURST = 200
"""Number of records that a node may publish at once before the limit of `MAX_RATE_HZ` applies."""
MAX_TEXT_LENGTH = 8_000
"""Maximum length of a record's text in characters; longer texts are truncated."""

_MAX_ERROR_TEXT_LENGTH = 1_000
_MAX_SHOWN_ERRORS = 2_000
_DROP_REPORT_INTERVAL_S = 1.0
_FLUSH_TIMEOUT_S = 1.0
_OPEN_RETRY_DELAY_S = 1.0
_MAX_QUEUED_RECORDS = 1_000
_PUBLISHED_BY_ATTRIBUTE = "nep_published_by"
_ERROR_LEVELS = ("error", "critical")
_LEVEL_ALIASES = {"warn": "warning", "fatal": "critical", "err": "error", "trace": "debug"}


@dataclass(frozen=True, slots=True)
class LogRecord:
    """Log record that is published as a message.

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
        """Return the record as the payload of a message. Fields that are None are omitted."""
        payload: dict[str, object] = {
            "level": self.level,
            "text": self.text,
            "name": self.name,
            "node": self.node,
            "stamp_ns": self.stamp_ns,
        }
        optional = {"file": self.file, "line": self.line, "pid": self.pid}
        return payload | {key: value for key, value in optional.items() if value is not None}

    @classmethod
    def from_plain(cls, payload: object, stamp_ns: int | None = None) -> LogRecord:
        """Return the record in a received payload. Invalid fields are ignored.

        Args:
            payload: Any received value; a value that isn't a map becomes the text of the record.
            stamp_ns: Time stamp to use if the record has none.
        """
        fields = payload if isinstance(payload, Mapping) else {"text": payload}
        text, stamp = fields.get("text"), _int_or_none(fields.get("stamp_ns"))
        return cls(
            parse_level(fields.get("level")),
            "" if text is None else bounded_str(text, MAX_TEXT_LENGTH),
            _short_text(fields.get("name")),
            _short_text(fields.get("node")),
            stamp if stamp is not None and 0 < stamp < 1 << 63 else stamp_ns or 0,
            _short_text(fields.get("file")) or None,
            _int_or_none(fields.get("line")),
            _int_or_none(fields.get("pid")),
        )


def parse_level(value: object) -> str:
    """Return the level for a name or an alias such as "WARN"; "info" for an unknown name."""
    level = value.strip().lower() if isinstance(value, str) else ""
    level = _LEVEL_ALIASES.get(level, level)
    return level if level in LEVELS else "info"


class NewErrorFilter:
    """Filter for errors that were already shown, because each error is received live and in the latched list.

    Remembers the newest 2000 errors.
    """

    def __init__(self) -> None:
        self._shown_errors: dict[tuple[str, int, str], None] = {}

    def is_new(self, record: LogRecord) -> bool:
        """Return True if a record has not been shown yet, or if it is not an error."""
        if record.level not in _ERROR_LEVELS:
            return True
        key = (record.node, record.stamp_ns, record.text[:100])
        if key in self._shown_errors:
            return False
        self._shown_errors[key] = None
        if len(self._shown_errors) > _MAX_SHOWN_ERRORS:
            del self._shown_errors[next(iter(self._shown_errors))]
        return True

    def new_records(self, payload: object) -> list[LogRecord]:
        """Return the records of a latched list that were not shown yet, oldest first, and remember them.

        Records without a time stamp are omitted.
        """
        entries = payload[-MAX_LAST_ERRORS:] if isinstance(payload, list) else []
        records = sorted(map(LogRecord.from_plain, entries), key=lambda record: record.stamp_ns)
        return [record for record in records if record.stamp_ns and self.is_new(record)]


class LogPublisher(Protocol):
    """Interface of the publisher that the log handler uses."""

    def publish(self, payload: object) -> None:
        """Publish one payload."""


class LogNode(Protocol):
    """Interface of the node that the log handler uses."""

    name: str

    def new_pub(self, topic: str, msg_type: str, *, latched: bool = False) -> LogPublisher:
        """Create a publisher."""


class LogHandler(logging.Handler):
    """Logging handler that publishes records as messages of a node. Never blocks, never raises.

    Args:
        node: Name of the node.
        open_publisher: Opens the publisher. Called in the handler's thread at the first record, and then
            every second until it succeeds. Meanwhile up to 1000 records are queued.
        open_errors: Opens the latched publisher of the last errors. Called at the first error. None: the last
            errors are not published.
        rate_hz: Maximum rate in records per second.
        burst: Number of records allowed at once.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        node: str,
        open_publisher: Callable[[], LogPublisher],
        *,
        open_errors: Callable[[], LogPublisher] | None = None,
        rate_hz: float = MAX_RATE_HZ,
        burst: int = MAX_BURST,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.logger = logging.Logger(node, logging.INFO)  # noqa: LOG001 - lives as long as its node
        """Logger of the node. Its records from INFO on are published and passed to the root logger."""
        self.logger.parent = logging.getLogger()
        self.logger.addHandler(self)
        self._node = node
        self._open_publisher = open_publisher
        self._open_errors = open_errors
        self._last_errors: deque[dict[str, object]] = deque(maxlen=MAX_LAST_ERRORS)
        self._errors_publisher: LogPublisher | None = None
        self._rate_hz, self._burst, self._clock = rate_hz, burst, clock
        self._tokens, self._refilled_at = float(burst), clock()
        self._queue: deque[dict[str, object]] = deque()
        self._dropped_count = 0
        self._reported_at = float("-inf")
        self._has_work = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_closed = False
        self._generation = current_generation()

    @property
    def unreported_drops(self) -> int:
        """Number of dropped records that have not been reported yet."""
        return self._dropped_count

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a record for the handler's thread.

        Records beyond the rate limit are dropped and counted.
        """
        if (
            self._generation.is_inherited
            or getattr(record, _PUBLISHED_BY_ATTRIBUTE, None) is self
            or threading.current_thread() is self._thread
        ):
            return  # forked, received twice (also through the root logger), or caused by publishing itself
        setattr(record, _PUBLISHED_BY_ATTRIBUTE, self)
        with self._has_work:
            if self._is_closed:
                return
            if not self._take_token_locked():
                self._dropped_count += 1
                return
        try:
            payload = self._to_plain(record)
        except Exception:  # noqa: BLE001 - a logging error must not end the program
            self.handleError(record)
            return
        with self._has_work:
            if len(self._queue) >= _MAX_QUEUED_RECORDS:
                self._dropped_count += 1
                return
            try:
                self._start_thread_locked()
            # the interpreter is shutting down (Python 3.12+), or no thread can be started
            except RuntimeError:
                self._dropped_count += 1
                return
            self._queue.append(payload)
            self._has_work.notify()

    def close(self, timeout_s: float = _FLUSH_TIMEOUT_S) -> None:
        """Publish queued records within `timeout_s` seconds and close. Idempotent."""
        if not self._generation.is_inherited:
            with self._has_work:
                self._is_closed = True
                thread = self._thread
                self._has_work.notify()
            if thread is not None and thread is not threading.current_thread():
                thread.join(max(0.0, timeout_s))
        super().close()

    # ---- worker thread

    def _take_token_locked(self) -> bool:
        # Token bucket. Called with the lock held.
        now = self._clock()
        self._tokens = min(float(self._burst), self._tokens + (now - self._refilled_at) * self._rate_hz)
        self._refilled_at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def _to_plain(self, record: logging.LogRecord) -> dict[str, object]:
        text = record.getMessage()
        if record.exc_info and record.exc_info[0] is not None:
            text += "\n" + "".join(traceback.format_exception(*record.exc_info)).rstrip()
        if len(text) > MAX_TEXT_LENGTH:
            text = _("{text}… ({count} characters)").format(text=text[:MAX_TEXT_LENGTH], count=len(text))
        return LogRecord(
            _level_name(record.levelno),
            text,
            record.name,
            self._node,
            int(record.created * 1e9),
            Path(record.pathname).name or None,
            record.lineno,
            os.getpid(),
        ).to_plain()

    def _start_thread_locked(self) -> None:
        if self._thread is None:
            thread = threading.Thread(target=self._run, name=f"{self._node} log", daemon=True)
            thread.start()
            self._thread = thread

    def _run(self) -> None:
        publisher = self._open_with_retry()
        if publisher is None:
            return
        while (records := self._next_batch()) is not None:
            for record in records:
                try:
                    publisher.publish(record)
                except NepError:
                    return  # the node is closed
            self._publish_last_errors([record for record in records if record["level"] in _ERROR_LEVELS])

    def _publish_last_errors(self, records: list[dict[str, object]]) -> None:
        # Publishes the latched list again, with these errors added.
        if not records or self._open_errors is None:
            return
        for record in records:
            text = shortened(str(record["text"]), _MAX_ERROR_TEXT_LENGTH)
            self._last_errors.append({**record, "text": text})
        with suppress(NepError):  # retried with the next error
            if self._errors_publisher is None:
                self._errors_publisher = self._open_errors()
            self._errors_publisher.publish(list(self._last_errors))

    def _open_with_retry(self) -> LogPublisher | None:
        # Retry until a publisher can be opened; None when the handler is closed.
        while True:
            try:
                return self._open_publisher()
            except ClosedError:
                return None
            except NepError:
                with self._has_work:
                    if self._is_closed or self._has_work.wait_for(
                        lambda: self._is_closed, _OPEN_RETRY_DELAY_S
                    ):
                        return None

    def _next_batch(self) -> list[dict[str, object]] | None:
        # Blocks until there are records; None at the end.
        with self._has_work:
            while not self._queue and not self._is_closed:
                # the number of dropped records is reported once a second, and at the end of the burst
                was_notified = self._has_work.wait(_DROP_REPORT_INTERVAL_S if self._dropped_count else None)
                if not was_notified and self._dropped_count:
                    break
            records = list(self._queue)
            self._queue.clear()
            if not records and not self._dropped_count:
                return None
            if self._dropped_count and (self._is_closed or self._is_report_due_locked()):
                records.append(self._drop_record_locked())
            return records

    def _is_report_due_locked(self) -> bool:
        return self._clock() - self._reported_at >= _DROP_REPORT_INTERVAL_S

    def _drop_record_locked(self) -> dict[str, object]:
        count, self._dropped_count = self._dropped_count, 0
        self._reported_at = self._clock()
        text = ngettext(
            "{count} log record was dropped: the limit is {rate_hz} per second",
            "{count} log records were dropped: the limit is {rate_hz} per second",
            count,
        ).format(count=count, rate_hz=number(self._rate_hz))
        return LogRecord("warning", text, "nep.log", self._node, time.time_ns(), pid=os.getpid()).to_plain()


def new_log_handler(node: LogNode) -> LogHandler:
    """Return a handler that publishes on `LOG_TOPIC` as `node`."""
    return LogHandler(
        node.name,
        lambda: node.new_pub(LOG_TOPIC, LOG_TYPE),
        open_errors=lambda: node.new_pub(LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, latched=True),
    )


def _level_name(level: int) -> str:
    return LEVELS[0] if level < logging.INFO else LEVELS[min(4, level // 10 - 1)]


def _short_text(value: object) -> str:
    return value[:200] if isinstance(value, str) else ""


def _int_or_none(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None
