"""Parser for ROS message definitions, and conversion between maps and bytes. Needs no ROS installation.

A publisher sends the full definition to each subscriber. Messages of packages that aren't installed can
therefore be decoded, and no code is generated from untrusted input.

A map contains the fields by name; missing fields are zero or empty. `time` and `duration` are `{"secs":
1, "nsecs": 500000000}`; a number of seconds is accepted as well when encoding. Arrays are lists;
`uint8[]` and `char[]` are bytes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from nep.errors import DecodeError, EncodeError, NepError, did_you_mean
from nep.i18n import _
from nep.messages.fields import FieldPathError
from nep.text import escaped, shortened

_SEPARATOR = re.compile(r"^={10,}\s*$", re.MULTILINE)
_SECTION_HEADER = re.compile(r"\s*MSG:\s*([\w/]+)[^\n]*\n?")
_CONSTANT = re.compile(r"[\w/]+\s+\w+\s*=")
_FIELD = re.compile(r"([A-Za-z][\w/]*)(\[(\d{0,10})\])?\s+([A-Za-z]\w*)")
_INTEGER_FORMATS = {
    "int8": "b", "byte": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
_FLOAT_FORMATS = {"float32": "f", "float64": "d"}
_FORMATS = {**_INTEGER_FORMATS, **_FLOAT_FORMATS, "bool": "?"}
_TIME_FORMATS = {"time": struct.Struct("<II"), "duration": struct.Struct("<ii")}
_BYTE_TYPES = ("uint8", "char")
_LENGTH = struct.Struct("<I")
_HEADER_TYPES = ("Header", "std_msgs/Header", "roslib/Header")
_MAX_DEPTH = 30
_MAX_FIELDS = 2_000
"""Maximum number of fields including nested ones, because a publisher's definition is untrusted."""
_MAX_EMPTY_MESSAGES = 10_000
"""Maximum number of nested messages without content in a decoded message; they occupy no bytes."""


class _Reader:
    # Reads values sequentially. Raises `struct.error` at the end of the data.
    def __init__(self, data: bytes | memoryview) -> None:
        self.data = memoryview(data)
        self.offset = 0
        self.messages_left = _MAX_EMPTY_MESSAGES + _MAX_DEPTH * len(self.data)
        """Remaining number of nested messages. Empty ones aren't limited by the size of the data."""

    @property
    def bytes_left(self) -> int:
        return len(self.data) - self.offset

    def read(self, count: int) -> memoryview:
        if count > self.bytes_left:
            raise struct.error
        self.offset += count
        return self.data[self.offset - count : self.offset]

    def read_length(self) -> int:
        return int(_LENGTH.unpack(self.read(4))[0])


@dataclass(frozen=True)
class FieldKind:
    """Type of a field, with its encoder and decoder.

    Attributes:
        name: Name of the type.
        write: Encodes a value; called with the value and the output. Raises `FieldPathError`.
        read: Decodes a value. Raises `FieldPathError`, or `struct.error` at the end of the data.
        min_bytes: Minimum size of an encoded value in bytes.
        fields: Fields of a message.
        element: Type of an array's items, or None.
        length: Number of items of a fixed-size array, or None.
    """

    name: str
    write: Callable[[object, bytearray], None]
    read: Callable[[_Reader], object]
    min_bytes: int
    fields: tuple[DefinitionField, ...] = ()
    element: FieldKind | None = None
    length: int | None = None


@dataclass(frozen=True)
class DefinitionField:
    """Name and type of a field."""

    name: str
    kind: FieldKind


@dataclass(frozen=True)
class Definition:
    """Definition of a message type. Created by `parse`.

    Attributes:
        name: Name of the type.
        text: Text of the definition, including the definitions of nested types.
        fields: Fields in order.
    """

    name: str
    text: str
    fields: tuple[DefinitionField, ...]
    has_header: bool
    """True if the first field is a header; the data then starts with seq, secs and nsecs."""

    def encode(self, payload: object) -> bytes:
        """Encode a map. Raises `EncodeError` with the path of the invalid field."""
        if not isinstance(payload, Mapping):
            raise self._not_a_map_error(payload)
        out = bytearray()
        try:
            _write_fields(self.fields, payload, out)
        except FieldPathError as error:
            reason = _("field '{path}' {reason}").format(path=error.path, reason=error.reason)
            raise EncodeError(self.name, type(payload).__name__, reason, error.path) from None
        return bytes(out)

    def decode(self, data: bytes | memoryview) -> dict[str, object]:
        """Decode a message to a map.

        Raises `DecodeError`, whose reason contains the path of the invalid field, or the number of
        unexpected bytes at the end.
        """
        reader = _Reader(data)
        try:
            values = _read_fields(self.fields, reader)
        except FieldPathError as error:
            reason = _("field '{path}' {reason}").format(path=error.path, reason=error.reason)
            raise DecodeError(self.name, len(reader.data), reason) from None
        if reader.bytes_left:
            raise DecodeError(
                self.name,
                len(reader.data),
                _("{count} unexpected bytes follow the message").format(count=reader.bytes_left),
            )
        return values

    def check(self, payload: object) -> None:
        """Raise `EncodeError` if `payload` isn't a map."""
        if not isinstance(payload, Mapping):
            raise self._not_a_map_error(payload)

    def _not_a_map_error(self, payload: object) -> EncodeError:
        names = ", ".join(f"'{each.name}'" for each in self.fields[:6])
        reason = _("publish a 'dict' with the fields {names}").format(names=names or "{}")
        return EncodeError(self.name, type(payload).__name__, reason)


# ---- parsing definitions


def parse(name: str, text: str) -> Definition:
    """Parse the definition of a type such as "geometry_msgs/Twist". Raises `NepError` if it is invalid."""
    sections = _SEPARATOR.split(text)
    texts = {name: sections[0]}
    for section in sections[1:]:
        header = _SECTION_HEADER.match(section)
        if header is not None:
            texts[header[1]] = section[header.end() :]
    parser = _Parser(name, texts)
    fields = parser.fields_of(name, 0)
    return Definition(name, text, fields, parser.has_header)


class _Parser:
    def __init__(self, name: str, texts: Mapping[str, str]) -> None:
        self._name = name
        self._texts = texts
        self._kinds_by_name: dict[str, FieldKind] = {}
        self._field_count = 0
        self.has_header = False

    def fields_of(self, name: str, depth: int) -> tuple[DefinitionField, ...]:
        fields: list[DefinitionField] = []
        names: set[str] = set()
        for line in self._texts[name].splitlines():
            stripped = line.partition("#")[0].strip()
            if not stripped or _CONSTANT.match(line.strip()):
                continue
            match = _FIELD.fullmatch(stripped)
            self._field_count += 1
            if match is None or self._field_count > _MAX_FIELDS or match[4] in names:
                raise self._definition_error(stripped)
            names.add(match[4])
            if depth == 0 and not fields:
                self.has_header = match[1] in _HEADER_TYPES and not match[2] and match[4] == "header"
            kind = self._kind(name, match[1], depth)
            if match[2]:
                kind = _array_kind(kind, int(match[3]) if match[3] else None)
            fields.append(DefinitionField(match[4], kind))
        return tuple(fields)

    def _kind(self, parent_name: str, type_name: str, depth: int) -> FieldKind:
        basic_kind = _basic_kind(type_name)
        if basic_kind is not None:
            return basic_kind
        name = self._resolve_name(parent_name, type_name)
        kind = self._kinds_by_name.get(name)
        if kind is None:
            if depth >= _MAX_DEPTH:
                raise self._definition_error(type_name)
            kind = self._kinds_by_name[name] = _nested_kind(name, self.fields_of(name, depth + 1))
        return kind

    def _resolve_name(self, parent_name: str, type_name: str) -> str:
        if type_name in _HEADER_TYPES:
            candidates = ["std_msgs/Header", type_name]
        elif "/" in type_name:
            candidates = [type_name]
        else:
            candidates = [f"{parent_name.partition('/')[0]}/{type_name}"]
        for candidate in candidates:
            if candidate in self._texts:
                return candidate
        raise self._definition_error(type_name)

    def _definition_error(self, part: str) -> NepError:
        return NepError(
            _("the definition of '{name}' can't be read; check '{part}'").format(
                name=escaped(shortened(self._name, 100)), part=escaped(shortened(part, 60))
            )
        )


# ---- field types


def _basic_kind(name: str) -> FieldKind | None:
    if name in _INTEGER_FORMATS:
        return _integer_kind(name)
    if name in _FLOAT_FORMATS:
        return _float_kind(name)
    if name in _TIME_FORMATS:
        return _time_kind(name)
    if name == "bool":
        return FieldKind(name, _write_bool, lambda reader: reader.read(1)[0] != 0, 1)
    if name == "string":
        return FieldKind(name, _write_string, _read_string, 4)
    return None


def _integer_kind(name: str) -> FieldKind:
    packing = struct.Struct(f"<{_INTEGER_FORMATS[name]}")
    bits = 8 * packing.size
    is_signed = _INTEGER_FORMATS[name].islower()
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if is_signed else (0, (1 << bits) - 1)

    def write(value: object, out: bytearray) -> None:
        number = _to_integer(value)
        if number is None:
            raise _type_error(value, name)
        if not low <= number <= high:
            raise FieldPathError(
                _("is {value}; '{name}' must be from {low} to {high}").format(
                    value=shortened(str(number), 40), name=name, low=low, high=high
                )
            )
        out += packing.pack(number)

    return FieldKind(name, write, lambda reader: packing.unpack(reader.read(packing.size))[0], packing.size)


def _float_kind(name: str) -> FieldKind:
    packing = struct.Struct(f"<{_FLOAT_FORMATS[name]}")

    def write(value: object, out: bytearray) -> None:
        as_float = getattr(type(value), "__float__", None)
        if as_float is None or isinstance(value, bool):
            raise _type_error(value, name)
        try:
            out += packing.pack(as_float(value))
        except (OverflowError, TypeError, ValueError, struct.error):
            raise _range_error(value, name) from None

    return FieldKind(name, write, lambda reader: packing.unpack(reader.read(packing.size))[0], packing.size)


def _time_kind(name: str) -> FieldKind:
    packing = _TIME_FORMATS[name]

    def write(value: object, out: bytearray) -> None:
        try:
            out += packing.pack(*_to_secs_and_nsecs(value, name))
        except struct.error:
            raise _range_error(value, name) from None

    def read(reader: _Reader) -> object:
        secs, nsecs = packing.unpack(reader.read(8))
        return {"secs": secs, "nsecs": nsecs}

    return FieldKind(name, write, read, 8)


def _to_secs_and_nsecs(value: object, name: str) -> tuple[int, int]:
    if isinstance(value, Mapping):
        for key in value:
            if key not in {"secs", "nsecs"}:
                raise _unknown_field_error(key, ("secs", "nsecs"))
        secs, nsecs = _to_integer(value.get("secs", 0)), _to_integer(value.get("nsecs", 0))
        if secs is not None and nsecs is not None:
            return secs, nsecs
    elif isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1 << 33:
        total_ns = round(value * 1_000_000_000) if isinstance(value, float) else value * 1_000_000_000
        return divmod(total_ns, 1_000_000_000)
    raise _type_error(value, name)


def _write_bool(value: object, out: bytearray) -> None:
    is_bool = isinstance(value, bool) or type(value).__name__ in {"bool", "bool_"}  # also numpy's
    number = int(bool(value)) if is_bool else _to_integer(value)
    if number not in {0, 1}:
        raise _type_error(value, "bool")
    out.append(number)


def _write_string(value: object, out: bytearray) -> None:
    if isinstance(value, str):
        try:
            value = value.encode("utf-8")
        except UnicodeEncodeError:
            raise FieldPathError(_("contains an unpaired surrogate")) from None
    if not isinstance(value, bytes):
        raise _type_error(value, "string")
    out += _LENGTH.pack(len(value))
    out += value


def _read_string(reader: _Reader) -> object:
    return str(reader.read(reader.read_length()), "utf-8", "replace")


def _array_kind(kind: FieldKind, length: int | None) -> FieldKind:
    name = f"{kind.name}[{'' if length is None else length}]"
    if kind.name in _BYTE_TYPES:
        write = _bytes_writer(name, length)
        read: Callable[[_Reader, int], object] = _read_bytes
    else:
        write, read = _list_writer(name, kind, length), _list_reader(kind)
    if length is None:

        def read_all(reader: _Reader) -> object:
            return read(reader, reader.read_length())

        return FieldKind(name, write, read_all, 4, element=kind)

    def read_fixed(reader: _Reader) -> object:
        return read(reader, length)

    return FieldKind(name, write, read_fixed, length * kind.min_bytes, element=kind, length=length)


def _bytes_writer(name: str, length: int | None) -> Callable[[object, bytearray], None]:
    def write(value: object, out: bytearray) -> None:
        data = _to_bytes(value, name)
        _write_length(len(data), length, out)
        out += data

    return write


def _to_bytes(value: object, name: str) -> bytes | bytearray | memoryview:
    if isinstance(value, bytes | bytearray):
        return value
    if isinstance(value, memoryview):
        return value.tobytes()
    to_list = getattr(value, "tolist", None)
    if callable(to_list):
        as_bytes = getattr(value, "tobytes", None)
        if getattr(getattr(value, "dtype", None), "str", "") == "|u1" and callable(as_bytes):
            return bytes(as_bytes())
        value = to_list()
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise _type_error(value, name)
    try:
        return bytes(value)
    except (TypeError, ValueError):
        raise FieldPathError(_("contains a value that isn't an integer from 0 to 255")) from None


def _read_bytes(reader: _Reader, count: int) -> object:
    return bytes(reader.read(count))


def _list_writer(name: str, kind: FieldKind, length: int | None) -> Callable[[object, bytearray], None]:
    format_char = _FORMATS.get(kind.name, "") if kind.name != "bool" else ""

    def write(value: object, out: bytearray) -> None:
        to_list = getattr(value, "tolist", None)
        values = to_list() if callable(to_list) else value
        if not isinstance(values, Sequence) or isinstance(values, str | bytes | bytearray):
            raise _type_error(value, name)
        _write_length(len(values), length, out)
        if format_char and not any(type(item) is bool for item in values):
            try:
                out += struct.pack(f"<{len(values)}{format_char}", *values)
                return
            except (struct.error, OverflowError, TypeError, ValueError):
                pass  # encode one by one to find the invalid item
        for index, item in enumerate(values):
            try:
                kind.write(item, out)
            except FieldPathError as error:
                raise error.within(index) from None

    return write


def _list_reader(kind: FieldKind) -> Callable[[_Reader, int], object]:
    format_char = _FORMATS.get(kind.name, "")
    size = struct.calcsize(f"<{format_char}")

    def read(reader: _Reader, count: int) -> object:
        if count * kind.min_bytes > reader.bytes_left:
            raise FieldPathError(_("has {count} elements, more than the data can hold").format(count=count))
        if format_char:
            return list(struct.unpack(f"<{count}{format_char}", reader.read(count * size)))
        return [kind.read(reader) for _number in range(count)]

    return read


def _write_length(count: int, length: int | None, out: bytearray) -> None:
    if length is None:
        if count > 0xFFFFFFFF:
            raise FieldPathError(_("is too long"))
        out += _LENGTH.pack(count)
    elif count != length:
        raise FieldPathError(_("has {count} elements; expected {length}").format(count=count, length=length))


def _nested_kind(name: str, fields: tuple[DefinitionField, ...]) -> FieldKind:
    def write(value: object, out: bytearray) -> None:
        if not isinstance(value, Mapping):
            raise _type_error(value, name)
        _write_fields(fields, value, out)

    def read(reader: _Reader) -> object:
        return _read_fields(fields, reader)

    return FieldKind(name, write, read, sum(each.kind.min_bytes for each in fields), fields)


def _write_fields(
    fields: tuple[DefinitionField, ...], payload: Mapping[object, object], out: bytearray
) -> None:
    for field in fields:
        if field.name not in payload:
            out += bytes(field.kind.min_bytes)  # zero and empty values are zero bytes in every type
            continue
        try:
            field.kind.write(payload[field.name], out)
        except FieldPathError as error:
            raise error.within(field.name) from None
    if len(payload) > len(fields) or not payload.keys() <= {field.name for field in fields}:
        names = tuple(field.name for field in fields)
        raise _unknown_field_error(next(key for key in payload if key not in names), names)


def _read_fields(fields: tuple[DefinitionField, ...], reader: _Reader) -> dict[str, object]:
    values: dict[str, object] = {}
    reader.messages_left -= 1
    if reader.messages_left < 0:
        raise FieldPathError(_("contains more nested messages than the data can hold"))
    for field in fields:
        try:
            values[field.name] = field.kind.read(reader)
        except FieldPathError as error:
            raise error.within(field.name) from None
        except struct.error:
            raise FieldPathError(_("is truncated"), field.name) from None
    return values


# ---- values and errors


def _to_integer(value: object) -> int | None:
    # Accepts any integer class, such as numpy's; returns None for others.
    if isinstance(value, bool):
        return None
    if isinstance(value, int):
        return value
    index = getattr(type(value), "__index__", None)
    return None if index is None else int(index(value))


def _type_error(value: object, name: str) -> FieldPathError:
    return FieldPathError(_("is {value}; expected a '{name}'").format(value=_describe(value), name=name))


def _range_error(value: object, name: str) -> FieldPathError:
    return FieldPathError(_("is {value}, which isn't a '{name}'").format(value=_describe(value), name=name))


def _unknown_field_error(key: object, names: tuple[str, ...]) -> FieldPathError:
    return FieldPathError(
        _("doesn't exist; {did_you_mean}").format(did_you_mean=did_you_mean(str(key), names)), str(key)
    )


def _describe(value: object) -> str:
    if value is None or isinstance(value, str | int | float):
        return escaped(shortened(repr(value), 40))
    return _("a '{kind}'").format(kind=type(value).__name__)
