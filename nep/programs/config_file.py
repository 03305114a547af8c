"""Configuration files in TOML or JSON: reading, conversion to structs, and errors with line and key.

A reader of files describes them with `ConfigKind`, converts each table with `convert_table`, and raises
`FieldPathError` for whatever else is wrong. `ConfigFile.error` finds the line of the key.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import msgspec

from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.messages import fields
from nep.messages.fields import FieldPathError
from nep.messages.json_fault import find_json_fault
from nep.text import escaped, shortened

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_MAX_REASON_LENGTH = 200
_MAX_KEY_LENGTH = 80
_MSGSPEC_PATH = re.compile(r" - at `\$(.*)`$", re.DOTALL)
_MSGSPEC_STEP = re.compile(r"\.([^.\[]+)|\[(\d+)\]")
_MSGSPEC_EXPECTED = re.compile(r"Expected `(\w+)")
_TOML_POSITION = re.compile(r"\s*\((?:at line (\d+), column \d+|at end of document)\)")
_TOML_BLANK = re.compile(r"(?:\s|#[^\n]*)*")
_TOML_KEY = re.compile(r"""[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'""")
_TOML_SCALAR = re.compile(
    r""""{3}(?:[^\\]|\\.)*?"{3}(?!")|'{3}.*?'{3}(?!')|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[^,\]}\n#]+""", re.DOTALL
)
_JSON_BLANK = re.compile(r"[ \t\r\n]*")
_decode_json = json.JSONDecoder().raw_decode
_Table = TypeVar("_Table", bound=msgspec.Struct)


class FilePosition(NamedTuple):
    """Line and column in a text, from 1."""

    line: int
    column: int


@dataclass(frozen=True)
class ConfigKind:
    """Kind of configuration file.

    Attributes:
        syntax: Syntax of the file.
        example_command: Command that prints an example of such a file.
        max_bytes: Maximum size of a file.
        too_large_text: Message for a larger file, with the fields `path` and `most`; not translated yet.
    """

    syntax: Literal["TOML", "JSON"]
    example_command: str
    max_bytes: int
    too_large_text: str


class ConfigFile:
    """Parsed configuration file.

    Args:
        kind: Kind of the file.
        path: Path of the file, for error messages.
        text: Content of the file.

    Attributes:
        path: Path of the file, escaped.
        value: Parsed content.

    Raises:
        NepError: The text isn't valid TOML or JSON.
    """

    def __init__(self, kind: ConfigKind, path: str, text: str) -> None:
        self._syntax = kind.syntax
        self.path = escaped(path)
        self._text = text
        self._toml_offsets: Mapping[fields.Path, int] | None = None
        parse = self._parse_toml if kind.syntax == "TOML" else self._parse_json
        self.value: Any = parse(kind.example_command)

    @classmethod
    def read(cls, kind: ConfigKind, path: Path) -> ConfigFile:
        """Read a file. Raises `NepError` if the file can't be read or parsed."""
        try:
            with path.open("rb") as file:
                data = file.read(kind.max_bytes + 1)
        except (OSError, ValueError) as error:  # NUL in a file name raises ValueError
            reason = getattr(error, "strerror", None) or str(error)
            raise NepError(
                _("'{path}' can't be read: {reason}; '{command} --example' prints an example").format(
                    path=escaped(str(path)),
                    reason=reason[:1].lower() + reason[1:],
                    command=kind.example_command,
                )
            ) from error
        return cls.decode(kind, str(path), data)

    @classmethod
    def decode(cls, kind: ConfigKind, path: str, data: bytes) -> ConfigFile:
        """Parse the bytes of a file. Raises `NepError` if they are too many, or not valid."""
        if len(data) > kind.max_bytes:
            raise NepError(_(kind.too_large_text).format(path=escaped(path), most=kind.max_bytes))
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            raise NepError(
                _("line {line} of '{path}' isn't UTF-8; save the file as UTF-8").format(
                    line=line, path=escaped(path)
                )
            ) from error
        return cls(kind, path, text)

    def _parse_toml(self, command: str) -> object:
        try:
            return tomllib.loads(self._text)
        except (ValueError, RecursionError) as error:  # ValueError also for numbers with thousands of digits
            match = _TOML_POSITION.search(str(error))
            line = int(match[1]) if match and match[1] else self._text.count("\n") + 1
            reason = shortened(_TOML_POSITION.sub("", str(error)).strip(), _MAX_REASON_LENGTH)
            raise NepError(
                _(
                    "line {line} of '{path}' isn't valid TOML: {reason}; '{command} --example' prints an "
                    "example"
                ).format(
                    line=line,
                    path=self.path,
                    reason=escaped(reason[:1].lower() + reason[1:]),
                    command=command,
                )
            ) from error

    def _parse_json(self, command: str) -> object:
        fault = find_json_fault(self._text, allow_nan=True)
        if fault is None:
            return json.loads(self._text)
        raise NepError(
            _(
                "'{path}' isn't valid JSON: line {line}, column {column}: {reason}; '{command} --example' "
                "prints an example"
            ).format(
                path=self.path, line=fault.line, column=fault.column, reason=fault.reason, command=command
            )
        )

    def error(self, error: FieldPathError) -> NepError:
        """Return the error to raise for an invalid value: a sentence with the file, the line and the key."""
        key = "".join(
            f"[{step + 1}]" if isinstance(step, int) else f".{escaped(shortened(step, _MAX_KEY_LENGTH))}"
            for step in error.steps
        ).removeprefix(".")
        position = self.position(error.steps)
        if not key:
            template = _("line {line} of '{path}': {reason}")
        elif position is not None:
            template = _("line {line} of '{path}', {key}: {reason}")
        else:
            template = _("'{path}', {key}: {reason}")
        line = 1 if position is None else position.line
        return NepError(escaped(template.format(line=line, path=self.path, key=key, reason=error.reason)))

    def position(self, path: fields.Path) -> FilePosition | None:
        """Return where a key or an item is written; for a missing one, where the table that lacks it is.

        Returns None if a key is missing in the root table of a TOML file, which isn't written anywhere.
        """
        if self._syntax == "JSON":
            offset: int | None = _json_offset(self._text, path)
        else:
            if self._toml_offsets is None:
                self._toml_offsets = _TomlScanner(self._text).scan()
            known = (path[:length] for length in range(len(path), 0, -1))
            offset = next((self._toml_offsets[each] for each in known if each in self._toml_offsets), None)
        if offset is None:
            return None
        return FilePosition(self._text.count("\n", 0, offset) + 1, offset - self._text.rfind("\n", 0, offset))


@contextmanager
def checks(*path: str | int) -> Iterator[None]:
    """Turn errors of the checks inside into errors of the value at `path`.

    Raises `FieldPathError` for a `NepError` or `ValueError`, and adds `path` to that of a `FieldPathError`.
    """
    try:
        yield
    except FieldPathError as error:
        for step in reversed(path):
            error.within(step)
        raise
    except (NepError, ValueError) as error:
        raise FieldPathError(str(error), *path) from error


def convert_table(
    value: Mapping[str, object], kind: type[_Table], reasons: Mapping[str, str] | None = None
) -> _Table:
    """Convert a table to a struct.

    Args:
        value: Table of a configuration file.
        kind: Class of the struct.
        reasons: What values must be, by key, where the type of the field doesn't say it, such as "must be a
            string of at most 64 characters".

    Raises:
        FieldPathError: A key is unknown, or a value has the wrong type or is out of range.
    """
    known_keys = kind.__struct_encode_fields__
    for key in value:
        if key not in known_keys:
            raise FieldPathError(
                _("unknown key; {did_you_mean}").format(did_you_mean=did_you_mean(key, known_keys)), key
            )
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        message = str(error)
    match = _MSGSPEC_PATH.search(message)
    path = [
        name or int(index) for name, index in _MSGSPEC_STEP.findall(match[1] if match is not None else "")
    ]
    expected = _MSGSPEC_EXPECTED.match(message)
    reason = (reasons or {}).get(str(path[0]) if path else "") or _reason(expected[1] if expected else "")
    raise FieldPathError(reason, *path)


def _reason(expected: str) -> str:
    if expected == "str":
        return _("must be a string in quotes")
    if expected == "bool":
        return _("must be true or false")
    return _("must be a list") if expected == "array" else _("must be a number")


# ---- positions


def _json_offset(text: str, path: fields.Path) -> int:
    # Offset of the key or item at the path, or of the value that lacks it. `text` is valid JSON.
    offset = value_offset = _skip(_JSON_BLANK, text, 0)
    for step in path:
        entry = _json_entry(text, value_offset, step)
        if entry is None:
            break
        offset, value_offset = entry
    return offset


def _json_entry(text: str, offset: int, step: str | int) -> tuple[int, int] | None:
    # Offsets of the entry and its value in the object or array at `offset`.
    is_object = text[offset] == "{"
    if text[offset] != ("{" if isinstance(step, str) else "["):
        return None
    index = 0
    position = _skip(_JSON_BLANK, text, offset + 1)
    while text[position] not in "}]":
        key: object = index
        value_offset = position
        if is_object:
            key, end = _decode_json(text, position)
            value_offset = _skip(_JSON_BLANK, text, _skip(_JSON_BLANK, text, end) + 1)  # after the colon
        if key == step:
            return position, value_offset
        index += 1
        position = _skip(_JSON_BLANK, text, _decode_json(text, value_offset)[1])
        if text[position] == ",":
            position = _skip(_JSON_BLANK, text, position + 1)
    return None


class _TomlScanner:
    """Finder of the offsets of all keys, tables and items in valid TOML."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._offset = 0
        self._offsets: dict[fields.Path, int] = {}
        self._table_counts: dict[fields.Path, int] = {}
        """Number of tables so far in each array of tables."""

    def scan(self) -> Mapping[fields.Path, int]:
        table: fields.Path = ()
        while self._peek():
            if self._peek() == "[":
                table = self._header()
            else:
                self._assignment(table)
        return self._offsets

    def _peek(self) -> str:
        # Skips blanks and comments; returns the next character, or "" at the end.
        self._offset = _skip(_TOML_BLANK, self._text, self._offset)
        return self._text[self._offset : self._offset + 1]

    def _header(self) -> fields.Path:
        start = self._offset
        is_array = self._text.startswith("[[", start)
        self._offset += 1 + is_array
        names = self._names()
        self._offset += 1 + is_array
        path: fields.Path = ()
        for number, name in enumerate(names, 1):
            path += (name,)
            if is_array and number == len(names):
                self._table_counts[path] = self._table_counts.get(path, 0) + 1
            self._offsets.setdefault(path, start)
            if path in self._table_counts:
                path += (self._table_counts[path] - 1,)
                self._offsets.setdefault(path, start)
        return path

    def _assignment(self, table: fields.Path) -> None:
        self._peek()
        start, path = self._offset, table
        for name in self._names():
            path += (name,)
            self._offsets.setdefault(path, start)
        self._offset += 1  # the equals sign
        self._value(path)

    def _names(self) -> list[str]:
        # Names of a dotted key, up to the character that follows the key.
        names = []
        while True:
            self._peek()
            token = self._token(_TOML_KEY)
            is_quoted = token[:1] in {'"', "'"}
            names.append(tomllib.loads(f"key = {token}")["key"] if is_quoted else token)
            if self._peek() != ".":
                return names
            self._offset += 1

    def _value(self, path: fields.Path) -> None:
        opening = self._peek()
        if opening not in {"[", "{"}:
            self._token(_TOML_SCALAR)
            return
        self._offset += 1
        index = 0
        while self._peek() not in {"]", "}", ""}:
            if opening == "{":
                self._assignment(path)
            else:
                self._offsets[(*path, index)] = self._offset
                self._value((*path, index))
                index += 1
            if self._peek() == ",":
                self._offset += 1
        self._offset += 1

    def _token(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self._text, self._offset)
        token = "" if match is None else match[0]
        self._offset += max(1, len(token))
        return token


def _skip(pattern: re.Pattern[str], text: str, offset: int) -> int:
    match = pattern.match(text, offset)
    return offset if match is None else match.end()
