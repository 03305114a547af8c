"""Console: the newest 5000 log records of Studio and of programs on the network.

Records from the network (`nep.nodes.log_handler`) are stored as messages and decoded when
`Console.records` is read, so a hidden console needs hardly any CPU time.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from nep.errors import NepError
from nep.i18n import _, ngettext
from nep.messages.message import Message
from nep.nodes import log_handler
from nep.text import shortened

CAPACITY = 5000
MAX_TEXT_LENGTH = 2000
MAX_IGNORED_PROCESSES = 50
_LEVELS = {"warning": "warn"}


@dataclass(frozen=True, slots=True)
class ConsoleRecord:
    """One log record.

    Attributes:
        stamp_s: Time in seconds since 1970.
        level: "debug", "info", "warn", "error" or "critical".
        origin: Name of the program that logged the record.
        number: Serial number of the record, starting at 1.
        logger: Name of the logger; "" if unknown.
        location: Source file and line number; "" if unknown.
    """

    stamp_s: float
    level: str
    origin: str
    text: str
    number: int = 0
    logger: str = ""
    location: str = ""


class Console:
    """Ring buffer of log records, oldest first. Not thread-safe; use it from the main thread."""

    def __init__(self, clock: Callable[[], float] = time.time, capacity: int = CAPACITY) -> None:
        self._clock = clock
        self._lines: deque[ConsoleRecord | Message] = deque(maxlen=capacity)
        self._pending_count = 0
        self._ignored_pids: deque[int] = deque(maxlen=MAX_IGNORED_PROCESSES)
        self._error_filter = log_handler.NewErrorFilter()
        self._last_number = 0
        self.dropped_count = 0
        """Number of records from the network that were dropped because too many arrived at once."""
        self.revision = 0

    @property
    def records(self) -> Sequence[ConsoleRecord]:
        """All records, oldest first. Pending messages are decoded at access."""
        self._decode_pending()
        return self._lines  # type: ignore[return-value]  # all entries are decoded

    def add(self, level: str, origin: str, text: str) -> None:
        """Append a record. Text longer than `MAX_TEXT_LENGTH` is shortened."""
        self._append([ConsoleRecord(self._clock(), level, origin, _truncate(text))])

    def add_messages(self, messages: Sequence[Message], dropped: int = 0) -> None:
        """Add log messages from the network.

        Args:
            messages: Log messages, oldest first.
            dropped: Number of messages dropped before ``messages`` because too many arrived at once.
        """
        if dropped:
            self.dropped_count += dropped
            message = ngettext(
                "{count} log record was dropped: too many at once",
                "{count} log records were dropped: too many at once",
                dropped,
            )
            self.add("warn", "studio", message.format(count=dropped))
        if messages:
            self._append(messages)

    def ignore_process(self, pid: int | None) -> None:
        """Ignore log messages of a process whose output Studio already reads through a pipe.

        Args:
            pid: Process id; None has no effect.
        """
        if pid is not None:
            self._ignored_pids.append(pid)

    def clear(self) -> None:
        """Remove all records."""
        self._lines.clear()
        self._pending_count = 0
        self.revision += 1

    def reset(self) -> None:
        """Remove all records and the list of known errors.

        Called when a replay seeks, because the records are then sent again.
        """
        self._error_filter = log_handler.NewErrorFilter()
        self.clear()

    def _append(self, lines: Sequence[ConsoleRecord | Message]) -> None:
        self._lines.extend(lines)
        self._pending_count = min(self._pending_count + len(lines), len(self._lines))
        self.revision += 1

    def _decode_pending(self) -> None:
        pending = [self._lines.pop() for _index in range(self._pending_count)]
        self._pending_count = 0
        for line in reversed(pending):
            for record in self._decode_records(line) if isinstance(line, Message) else (line,):
                self._last_number += 1
                self._lines.append(replace(record, number=self._last_number))

    def _decode_records(self, message: Message) -> Sequence[ConsoleRecord]:
        try:
            if message.topic == log_handler.LAST_ERRORS_TOPIC:
                records = self._error_filter.new_records(message.payload)
            else:
                record = log_handler.LogRecord.from_plain(message.payload, message.stamp_ns)
                records = [record] if self._error_filter.is_new(record) else []
        except NepError:
            return ()  # an alert reports it, as for every topic
        return [
            self._decode_record(each)
            for each in records
            if each.pid is None or each.pid not in self._ignored_pids
        ]

    def _decode_record(self, log_record: log_handler.LogRecord) -> ConsoleRecord:
        location = (
            f"{log_record.file}:{log_record.line}"
            if log_record.file and log_record.line
            else log_record.file or ""
        )
        return ConsoleRecord(
            log_record.stamp_ns / 1e9 if log_record.stamp_ns else self._clock(),
            _LEVELS.get(log_record.level, log_record.level),
            log_record.node or log_record.name or _("unknown sender"),
            _truncate(log_record.text),
            logger="" if log_record.name == log_record.node else log_record.name,
            location=location,
        )


def _truncate(text: str) -> str:
    return shortened(text, MAX_TEXT_LENGTH)
