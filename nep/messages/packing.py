"""msgpack encoding of plain values."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import msgpack  # type: ignore[import-untyped]

from nep.i18n import _

_Value = TypeVar("_Value")
_MIN_INT, _MAX_INT = -(2**63), 2**64 - 1


def pack(value: object, default: Callable[[object], object] | None = None) -> bytes:
    """Encode a value as msgpack. Raises `ValueError` if msgpack can't represent the value.

    Args:
        value: The value. A datetime becomes msgpack's timestamp; without a time zone it is local time,
            as in Python.
        default: Converts values of other types.
    """
    try:
        packed: bytes = msgpack.packb(value, use_bin_type=True, default=default, datetime=True)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise ValueError(str(error) or _("unsupported value")) from error
    return packed


def clamp_int(value: object) -> int:
    """Return the nearest int that msgpack can encode. Raises `TypeError` if the value is not an int."""
    if not isinstance(value, int):
        raise TypeError(_("a '{kind}' can't be encoded as msgpack").format(kind=type(value).__name__))
    return max(_MIN_INT, min(_MAX_INT, value))


def pack_saturated(value: object) -> bytes:
    """Encode plain values of nodes and the master as msgpack, without failing.

    Values from the network can't cause an exception: ints are clamped, lone surrogates become "?".
    """
    packed: bytes = msgpack.packb(value, use_bin_type=True, unicode_errors="replace", default=clamp_int)
    return packed


def unpack(data: bytes | memoryview) -> object:
    """Decode one msgpack value. Raises `ValueError` for anything else.

    Timestamps become `datetime` in UTC with microseconds; if one is beyond the year 9999, all are
    `msgpack.Timestamp`. Lists used as keys become tuples.
    """
    try:
        value: object = msgpack.unpackb(data, raw=False, strict_map_key=False, timestamp=3)
    except (TypeError, OverflowError):  # rare: a list as key, or a timestamp beyond datetime's range
        return _unpack_slow(data)
    except (ValueError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or _("the data is truncated")) from error
    return value


def _unpack_slow(data: bytes | memoryview) -> object:
    for timestamp in (3, 0):
        try:
            value: object = msgpack.unpackb(
                data, raw=False, strict_map_key=False, timestamp=timestamp, object_pairs_hook=_to_dict
            )
        except OverflowError:
            continue
        except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
            raise ValueError(str(error) or _("the data is truncated")) from error
        return value
    raise ValueError(_("a timestamp is invalid"))


def _to_dict(pairs: list[tuple[object, object]]) -> dict[object, object]:
    return {_to_hashable(key): value for key, value in pairs}


def _to_hashable(key: object) -> object:
    return tuple(map(_to_hashable, key)) if isinstance(key, list) else key


def unpack_bounded(data: bytes, max_lists: int, max_length: int) -> object:
    """Decode untrusted msgpack as `unpack` does, with limits.

    Without limits, a message of a megabyte could contain a million empty lists, which take seconds to
    create.

    Args:
        data: Encoded value.
        max_lists: Maximum number of lists and maps.
        max_length: Maximum length of a list or map.

    Raises:
        ValueError: The data isn't valid msgpack, or exceeds a limit.
    """
    remaining = max_lists

    def count(value: _Value) -> _Value:
        nonlocal remaining
        remaining -= 1
        if remaining < 0:
            raise ValueError(
                _("the value has more than {most_lists} lists and maps").format(most_lists=max_lists)
            )
        return value

    try:
        value: object = msgpack.unpackb(
            data,
            raw=False,
            strict_map_key=False,
            list_hook=count,
            object_hook=count,
            max_array_len=max_length,
            max_map_len=max_length,
        )
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or _("the data is truncated")) from error
    return value


def unpack_first(data: bytes) -> object:
    """Decode the first of several msgpack values. Raises `ValueError` if it is invalid or incomplete."""
    unpacker = msgpack.Unpacker(raw=False, strict_map_key=False)
    unpacker.feed(data)
    try:
        value: object = unpacker.unpack()
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or _("the data is truncated")) from error
    return value
