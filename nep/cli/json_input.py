"""JSON from the command line, the standard input and files: parsed, or an error that says what is wrong."""

from __future__ import annotations

import json
import os
import shlex
import subprocess

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.messages.json_fault import JsonFault, find_json_fault, looks_like_json
from nep.text import control_in, escaped, quotable

__all__ = ["parse_json", "text_of"]

_MAX_SHOWN = 40


def parse_json(
    text: str,
    *,
    file: str | None = None,
    first_line: int = 1,
    allow_nan: bool = False,
    other_types: bool = False,
) -> object:
    """Return the value of a JSON text. Raises `NepError` that names the position and the reason.

    Args:
        text: What was typed, or what `file` contains.
        file: The file's name, for the error.
        first_line: Number of the text's first line, for lines of the standard input.
        allow_nan: Take NaN and Infinity, as Python's `json` writes them.
        other_types: Whether `--type string` and `--type msgpack` are ways out.
    """
    fault = find_json_fault(text, allow_nan=allow_nan)
    if fault is None:
        value: object = json.loads(text) if allow_nan else orjson.loads(text)
        return value
    if file is None and text.strip() and not looks_like_json(text):
        raise NepError(_not_json(text, other_types=other_types))
    raise NepError(
        _faulty(fault, quotable(file) if file else _shown(text), first_line, other_types=other_types)
    )


def text_of(data: bytes, file: str) -> str:
    """Decode the contents of a text file. Raises `NepError`."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        said = _("byte {start} of '{text}' is no UTF-8; save it as UTF-8")
        raise NepError(said.format(start=error.start + 1, text=escaped(file))) from error


def _faulty(fault: JsonFault, shown: str, first_line: int, *, other_types: bool) -> str:
    said = _("'{text}' is not valid JSON: line {line}, column {column}: {reason}")
    if fault.is_nan and other_types:
        said = _("'{text}' is not valid JSON: line {line}, column {column}: {reason}, or use --type msgpack")
    line = fault.line + first_line - 1
    return said.format(text=shown, line=line, column=fault.column, reason=fault.reason)


def _not_json(text: str, *, other_types: bool) -> str:
    example = text if len(text) <= _MAX_SHOWN else _("some text")
    quoted = _shell_quoted(json.dumps(example, ensure_ascii=bool(control_in(example))))
    said = _("'{text}' is not JSON; put a text in quotes, such as {quoted}")
    if other_types:
        said = _("'{text}' is not JSON; put a text in quotes, such as {quoted}, or use --type string")
    return said.format(text=_shown(text), quoted=quoted)


def _shown(text: str) -> str:
    return escaped(text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]} …")


def _shell_quoted(word: str) -> str:
    """`word` as it is typed in this system's shell."""
    return subprocess.list2cmdline([word]) if os.name == "nt" else shlex.quote(word)
