"""msgpack with types: bytes ↔ plain values."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import msgpack  # type: ignore[import-untyped]

from nep.i18n import _

__all__ = ["pack", "pack_saturated", "saturated", "unpack", "unpack_bounded", "unpack_first"]

_Made = TypeVar("_Made")
_LEAST, _MOST = -(2**63), 2**64 - 1


def pack(value: object, default: Callable[[object], object] | None = None) -> bytes:
    """`value` as msgpack; `default` turns what msgpack does not know. Raises `ValueError`.

    A date with time becomes msgpack's timestamp, which every language reads; without a zone it is this
    computer's time, as everywhere in Python.
    """
    try:
        packed: bytes = msgpack.packb(value, use_bin_type=True, default=default, datetime=True)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise ValueError(str(error) or _("it does not fit")) from error
    return packed


def saturated(value: object) -> int:
    """The nearest number that msgpack has a form for. Raises `TypeError` for what is none."""
    if not isinstance(value, int):
        raise TypeError(_("a '{kind}' has no form in msgpack").format(kind=type(value).__name__))
    return max(_LEAST, min(_MOST, value))


def pack_saturated(value: object) -> bytes:
    """What nodes and the master say as msgpack; of plain values only.

    Nothing that the network can bring about makes it fail: numbers saturate, halves of letters become "?".
    """
    packed: bytes = msgpack.packb(value, use_bin_type=True, unicode_errors="replace", default=saturated)
    return packed


def unpack(data: bytes | memoryview) -> object:
    """The value in `data`. Raises `ValueError` for anything that is not exactly one msgpack value.

    Timestamps are `datetime` in UTC, exact to a microsecond; in a message with one beyond the year 9999 all
    are `msgpack.Timestamp`. Lists that are keys are tuples.
    """
    try:
        value: object = msgpack.unpackb(data, raw=False, strict_map_key=False, timestamp=3)
    except (TypeError, OverflowError):  # rare: a list is a key, a timestamp is no date
        return _unpack_rare(data)
    except (ValueError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or _("the bytes end too early")) from error
    return value


def _unpack_rare(data: bytes | memoryview) -> object:
    for timestamp in (3, 0):
        try:
            value: object = msgpack.unpackb(
                data, raw=False, strict_map_key=False, timestamp=timestamp, object_pairs_hook=_map
            )
        except OverflowError:
            continue
        except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
            raise ValueError(str(error) or _("the bytes end too early")) from error
        return value
    raise ValueError(_("a timestamp in it is no time"))


def _map(pairs: list[tuple[object, object]]) -> dict[object, object]:
    return {_hashable(key): value for key, value in pairs}


def _hashable(key: object) -> object:
    return tuple(map(_hashable, key)) if isinstance(key, list) else key


def unpack_bounded(data: bytes, most_lists: int, longest: int) -> object:
    """As `unpack`, for what a stranger sent: `most_lists` lists and maps at most, none longer than `longest`.

    A million empty lists take a megabyte to send and seconds to make. Raises `ValueError`.
    """
    left = most_lists

    def count(value: _Made) -> _Made:
        nonlocal left
        left -= 1
        if left < 0:
            raise ValueError(_("it has more than {most_lists} lists and maps").format(most_lists=most_lists))
        return value

    try:
        value: object = msgpack.unpackb(
            data,
            raw=False,
            strict_map_key=False,
            list_hook=count,
            object_hook=count,
            max_array_len=longest,
            max_map_len=longest,
        )
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or _("the bytes end too early")) from error
    return value


def unpack_first(data: bytes) -> object:
    """The first of the values in `data`. Raises `ValueError` when there is no whole one."""
    unpacker = msgpack.Unpacker(raw=False, strict_map_key=False)
    unpacker.feed(data)
    try:
        value: object = unpacker.unpack()
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or _("the bytes end too early")) from error
    return value
