"""Payloads as text: whole JSON for programs, and for people what fits on a screen."""

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

__all__ = ["ids_as_text", "json_of", "presented"]

MOST_ITEMS = 20
"""Items of a list that a terminal shows; a longer one says how many more there are."""
MOST_FIELDS = 100
MOST_LETTERS = 500
MOST_DEPTH = 40
_DEEPEST = 200
"""How deep JSON is written; deeper values are told by their first letters."""
_IDS = frozenset({"id", "publisher"})
_CONTROL = re.compile("[\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff]")
_SAFE_INTEGERS = range(-(1 << 63), 1 << 64)


def json_of(value: object, *, indent: bool = False) -> bytes:
    r"""`value` as JSON, whatever it is; NaN and infinity are `null`, bytes their hexadecimal digits.

    Letters that a terminal obeys are written as `\u009b`, which says the same.
    """
    option = orjson.OPT_NON_STR_KEYS | numpy_option() | (orjson.OPT_INDENT_2 if indent else 0)
    try:
        data = orjson.dumps(value, default=_plain, option=option)
    except TypeError:  # too deep, keys or numbers that JSON does not have
        data = orjson.dumps(_tame(value, _DEEPEST), default=str, option=option)
    if data.isascii() and b"\x7f" not in data:
        return data
    return _CONTROL.sub(lambda found: f"\\u{ord(found.group()):04x}", data.decode()).encode()


def _plain(value: object) -> object:
    """What orjson does not know: bytes as their hexadecimal digits, everything else as text."""
    return value.hex() if isinstance(value, (bytes, bytearray, memoryview)) else str(value)


def _tame(value: object, depth: int) -> object:
    if isinstance(value, Mapping):
        if depth <= 0:
            return "…"
        return {_key(key): _tame(each, depth - 1) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_tame(each, depth - 1) for each in value] if depth > 0 else "…"
    if isinstance(value, int) and not isinstance(value, bool) and value not in _SAFE_INTEGERS:
        return str(value)
    return _letters(value) if isinstance(value, str) else value


def _key(key: object) -> str:
    return _letters(key) if isinstance(key, str) else str(_plain(key))


def _letters(text: str) -> str:
    """Text without halves of letters, which JSON has no form for."""
    return text.encode("utf-8", "backslashreplace").decode()


def ids_as_text(value: object) -> object:
    """Maps and lists with their ids as texts: readers that have floats alone lose digits beyond 2^53."""
    if isinstance(value, Mapping):
        return {
            key: str(each) if key in _IDS and isinstance(each, int) else ids_as_text(each)
            for key, each in value.items()
        }
    return [ids_as_text(each) for each in value] if isinstance(value, (list, tuple)) else value


def presented(value: object, *, whole: bool, indent: bool = False) -> str:
    """A payload for people: like JSON, but NaN stays NaN. Unless `whole`, what is long is shortened."""
    most = (
        (math.inf, math.inf, math.inf, _DEEPEST)
        if whole
        else (MOST_ITEMS, MOST_FIELDS, MOST_LETTERS, MOST_DEPTH)
    )
    return json_of(_presented(value, *most), indent=indent).decode()


def _presented(value: object, items: float, fields: float, letters: float, depth: float) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return orjson.Fragment(str(value).encode())
    if isinstance(value, (bytes, bytearray, memoryview)):
        value = value.hex()
    if isinstance(value, str):
        return shortened(value, int(letters)) if len(value) > letters else value
    if not isinstance(value, (Mapping, list, tuple)):
        return value
    if depth <= 0:
        return orjson.Fragment("…".encode())
    if isinstance(value, Mapping):
        return _map(value, items, fields, letters, depth)
    return _list(value, items, fields, letters, depth)


def _map(value: Mapping[object, object], items: float, fields: float, letters: float, depth: float) -> object:
    shown: dict[str, object] = {}
    for number, (key, each) in enumerate(value.items()):
        if number >= fields:
            shown["…"] = _("{count} more").format(count=len(value) - number)
            break
        shown[_key(key)] = _presented(each, items, fields, letters, depth - 1)
    return shown


def _list(value: Sequence[object], items: float, fields: float, letters: float, depth: float) -> object:
    count = len(value) if len(value) <= items else int(items)
    shown = [_presented(each, items, fields, letters, depth - 1) for each in value[:count]]
    if count < len(value):
        shown.append(orjson.Fragment(_("… {count} more").format(count=len(value) - count).encode()))
    return shown


def service_type_text(service: ServiceInfo) -> str:
    """The type of a service; nep's own services have none."""
    if service.msg_type == SERVICE_TYPE:
        return _("any (each client chooses json or msgpack)")
    return escaped(service.msg_type)


def cleaned(text: str) -> str:
    """Text of several lines as a terminal may have it; lines after the first are indented, as parts of it."""
    return escaped(text, lines=True).replace("\n", "\n    ")
