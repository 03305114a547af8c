"""Formatting of payloads: complete JSON for programs, and a shortened form for people."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import orjson

from nep.i18n import _
from nep.messages.codecs import numpy_option
from nep.protocol.graph_view import ServiceInfo
from nep.protocol.service_wire import SERVICE_TYPE
from nep.text import escaped, shortened

MAX_ITEMS = 20
"""Maximum number of list items shown on a terminal; further items are counted."""
MAX_FIELDS = 100
MAX_CHARACTERS = 500
MAX_DEPTH = 40
_MAX_JSON_DEPTH = 200
"""Maximum nesting depth of JSON output; deeper values are written as text."""
_ID_KEYS = frozenset({"id", "publisher"})
_CONTROL_CHARACTERS = re.compile("[\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff]")
_SAFE_INTEGERS = range(-(1 << 63), 1 << 64)


def encode_json(value: object, *, indent: bool = False) -> bytes:
    """Encode any value as JSON; NaN and infinity become `null`, bytes become hexadecimal digits.

    Other objects that JSON lacks become their `str`. Control characters of terminals are escaped, which
    is equivalent JSON.
    """
    option = orjson.OPT_NON_STR_KEYS | numpy_option() | (orjson.OPT_INDENT_2 if indent else 0)
    try:
        data = orjson.dumps(value, default=_to_plain, option=option)
    except TypeError:  # too deep, or keys and numbers that JSON lacks
        data = orjson.dumps(_simplify(value, _MAX_JSON_DEPTH), default=str, option=option)
    if data.isascii() and b"\x7f" not in data:
        return data
    return _CONTROL_CHARACTERS.sub(lambda match: f"\\u{ord(match.group()):04x}", data.decode()).encode()


def _to_plain(value: object) -> object:
    return value.hex() if isinstance(value, (bytes, bytearray, memoryview)) else str(value)


def _simplify(value: object, depth: int) -> object:
    if isinstance(value, Mapping):
        if depth <= 0:
            return "…"
        return {_key_text(key): _simplify(each, depth - 1) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_simplify(each, depth - 1) for each in value] if depth > 0 else "…"
    if isinstance(value, int) and not isinstance(value, bool) and value not in _SAFE_INTEGERS:
        return str(value)
    return _escape_surrogates(value) if isinstance(value, str) else value


def _key_text(key: object) -> str:
    return _escape_surrogates(key) if isinstance(key, str) else str(_to_plain(key))


def _escape_surrogates(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode()


def convert_ids_to_text(value: object) -> object:
    """Convert ids in maps and lists to strings, because many JSON readers lose digits beyond 2^53."""
    if isinstance(value, Mapping):
        return {
            key: str(each) if key in _ID_KEYS and isinstance(each, int) else convert_ids_to_text(each)
            for key, each in value.items()
        }
    return [convert_ids_to_text(each) for each in value] if isinstance(value, (list, tuple)) else value


def format_payload(value: object, *, in_full: bool, indent: bool = False) -> str:
    """Format a payload for people as JSON that may contain NaN.

    Args:
        value: Decoded payload.
        in_full: True to print long values in full; otherwise they are shortened.
        indent: True for one line per item.
    """
    limits = (
        (math.inf, math.inf, math.inf, _MAX_JSON_DEPTH)
        if in_full
        else (MAX_ITEMS, MAX_FIELDS, MAX_CHARACTERS, MAX_DEPTH)
    )
    return encode_json(_shorten_value(value, *limits), indent=indent).decode()


def _shorten_value(
    value: object, max_items: float, max_fields: float, max_characters: float, depth: float
) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return orjson.Fragment(str(value).encode())
    if isinstance(value, (bytes, bytearray, memoryview)):
        value = value.hex()
    if isinstance(value, str):
        return shortened(value, int(max_characters)) if len(value) > max_characters else value
    if not isinstance(value, (Mapping, list, tuple)):
        return value
    if depth <= 0:
        return orjson.Fragment("…".encode())
    if isinstance(value, Mapping):
        return _shorten_map(value, max_items, max_fields, max_characters, depth)
    return _shorten_list(value, max_items, max_fields, max_characters, depth)


def _shorten_map(
    value: Mapping[object, object], max_items: float, max_fields: float, max_characters: float, depth: float
) -> object:
    result: dict[str, object] = {}
    for number, (key, item) in enumerate(value.items()):
        if number >= max_fields:
            result["…"] = _("{count} more").format(count=len(value) - number)
            break
        result[_key_text(key)] = _shorten_value(item, max_items, max_fields, max_characters, depth - 1)
    return result


def _shorten_list(
    value: Sequence[object], max_items: float, max_fields: float, max_characters: float, depth: float
) -> object:
    count = len(value) if len(value) <= max_items else int(max_items)
    result = [
        _shorten_value(each, max_items, max_fields, max_characters, depth - 1) for each in value[:count]
    ]
    if count < len(value):
        result.append(orjson.Fragment(_("… {count} more").format(count=len(value) - count).encode()))
    return result


def service_type_text(service: ServiceInfo) -> str:
    """Return a description of a service's type; services of nep are untyped."""
    if service.msg_type == SERVICE_TYPE:
        return _("any (each client chooses json or msgpack)")
    return escaped(service.msg_type)


def escape_for_terminal(text: str) -> str:
    """Escape the control characters of a text, except line breaks, and indent its continuation lines."""
    return escaped(text, lines=True).replace("\n", "\n    ")
