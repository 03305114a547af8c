"""Parsing of JSON from the command line, standard input and files, with detailed error messages."""

from __future__ import annotations

import json
import os
import shlex
import subprocess

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.messages.json_fault import JsonFault, find_json_fault, looks_like_json
from nep.text import escaped, first_control, quotable

_MAX_SHOWN_CHARACTERS = 40


def parse_json(
    text: str,
    *,
    file: str | None = None,
    first_line: int = 1,
    allow_nan: bool = False,
    suggest_types: bool = False,
) -> object:
    """Parse a JSON text.

    Args:
        text: JSON from the command line, or the content of `file`.
        file: Name of the file, for error messages.
        first_line: Line number of the text in standard input, for error messages.
        allow_nan: Accept NaN and Infinity, which Python's `json` writes.
        suggest_types: Suggest ``--type string`` and ``--type msgpack`` in error messages.

    Raises:
        NepError: The text is not valid JSON; the message names the position and the reason.
    """
    fault = find_json_fault(text, allow_nan=allow_nan)
    if fault is None:
        value: object = json.loads(text) if allow_nan else orjson.loads(text)
        return value
    if file is None and text.strip() and not looks_like_json(text):
        raise NepError(_not_json_message(text, suggest_types=suggest_types))
    raise NepError(
        _invalid_json_message(
            fault, quotable(file) if file else _excerpt(text), first_line, suggest_types=suggest_types
        )
    )


def decode_text(data: bytes, file: str) -> str:
    """Decode the content of a text file. Raises `NepError` if the content is not UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = _("byte {start} of '{text}' isn't valid UTF-8; save the file as UTF-8")
        raise NepError(message.format(start=error.start + 1, text=escaped(file))) from error


def _invalid_json_message(fault: JsonFault, shown_text: str, first_line: int, *, suggest_types: bool) -> str:
    message = _("'{text}' isn't valid JSON: line {line}, column {column}: {reason}")
    if fault.is_nan and suggest_types:
        message = _(
            "'{text}' isn't valid JSON: line {line}, column {column}: {reason}, or use --type msgpack"
        )
    line = fault.line + first_line - 1
    return message.format(text=shown_text, line=line, column=fault.column, reason=fault.reason)


def _not_json_message(text: str, *, suggest_types: bool) -> str:
    example = text if len(text) <= _MAX_SHOWN_CHARACTERS else _("some text")
    quoted = _quote_for_shell(json.dumps(example, ensure_ascii=bool(first_control(example))))
    message = _("'{text}' isn't valid JSON; put strings in quotes, such as {quoted}")
    if suggest_types:
        message = _(
            "'{text}' isn't valid JSON; put strings in quotes, such as {quoted}, or use --type string"
        )
    return message.format(text=_excerpt(text), quoted=quoted)


def _excerpt(text: str) -> str:
    return escaped(text if len(text) <= _MAX_SHOWN_CHARACTERS else f"{text[:_MAX_SHOWN_CHARACTERS]} …")


def _quote_for_shell(argument: str) -> str:
    return subprocess.list2cmdline([argument]) if os.name == "nt" else shlex.quote(argument)
