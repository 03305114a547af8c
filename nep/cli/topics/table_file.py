"""Output of `nep topic echo TOPIC FIELD... --csv`: selected fields as a table (RFC 4180)."""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Protocol

from nep.cli.screen import print_status
from nep.cli.values import encode_json
from nep.errors import DecodeError
from nep.i18n import _, ngettext
from nep.messages.fields import MISSING, Path, parse_path, value_at
from nep.messages.message import Message
from nep.text import escaped

STAMP_COLUMN = "stamp_s"


class TextSink(Protocol):
    """Writable text stream."""

    def write(self, text: str, /) -> object:
        """Write text."""

    def flush(self) -> object:
        """Flush buffered text."""


class FieldExtractor:
    """Extractor of fields from messages, which also counts messages in which a field is missing."""

    def __init__(self, names: Sequence[str]) -> None:
        # Raises `NepError` for an invalid field path.
        self.names = tuple(names)
        self._paths: tuple[Path, ...] = tuple(parse_path(name) for name in names)
        self.missing_counts: Counter[str] = Counter()
        self.message_count = 0
        self.undecodable_count = 0

    def extract(self, message: Message) -> list[object] | None:
        """Return the field values of a message, with `MISSING` for missing fields.

        Returns None if the message can't be decoded.
        """
        try:
            payload = message.payload_or_extension
        except DecodeError:
            self.undecodable_count += 1
            return None
        self.message_count += 1
        values = [value_at(payload, path) for path in self._paths]
        self.missing_counts.update(
            name for name, value in zip(self.names, values, strict=True) if value is MISSING
        )
        return values

    def as_dict(self, values: Sequence[object]) -> dict[str, object]:
        """Return the result of `extract` as a dict by field name, without missing fields."""
        return {name: value for name, value in zip(self.names, values, strict=True) if value is not MISSING}

    def report_missing(self) -> None:
        """Print the counts of missing fields and of undecodable messages to stderr."""
        for name in self.names:
            if self.missing_counts[name]:
                print_status(
                    _("'{name}' was missing in {missing} of {messages} messages").format(
                        name=name, missing=self.missing_counts[name], messages=self.message_count
                    )
                )
        if self.undecodable_count:
            template = ngettext(
                "skipped {count} undecodable message",
                "skipped {count} undecodable messages",
                self.undecodable_count,
            )
            print_status(template.format(count=self.undecodable_count))


class CsvMessageWriter:
    """Writer of comma-separated values: the time of publication (s since 1970), followed by the fields."""

    def __init__(
        self, fields: FieldExtractor, out: TextSink | None = None, *, includes_topic: bool = False
    ) -> None:
        self._fields = fields
        self._includes_topic = includes_topic
        # escape control characters only on a terminal; files get the original text
        self._clean = escaped if out is None and sys.stdout.isatty() else str
        self._out = out or _binary_safe_stdout()
        self._write = csv.writer(self._out, lineterminator="\r\n").writerow
        self._write([STAMP_COLUMN, *(["topic"] if includes_topic else []), *fields.names])
        self._out.flush()

    def __call__(self, message: Message) -> None:
        """Write one row for a message; skip an undecodable message."""
        values = self._fields.extract(message)
        if values is not None:
            topic = [message.topic] if self._includes_topic else []
            self._write(
                [
                    self._clean(each)
                    for each in (_format_stamp(message.stamp_ns), *topic, *map(_format_cell, values))
                ]
            )
            self._out.flush()


def _binary_safe_stdout() -> TextSink:
    # csv ends lines itself; newline translation would double them on Windows.
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(newline="", encoding="utf-8", errors="backslashreplace")
    return sys.stdout


def _format_stamp(stamp_ns: int | None) -> str:
    return "" if stamp_ns is None else f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def _format_cell(value: object) -> str:
    if value is MISSING or value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (Mapping, list, tuple)):
        return encode_json(value).decode()
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex()
    return str(value)
