"""msgpack with types: bytes ↔ plain values."""

from __future__ import annotations

from collections.abc import Callable

import msgpack  # type: ignore[import-untyped]

__all__ = ["pack", "pack_surely", "saturated", "unpack"]

_LEAST, _MOST = -(2**63), 2**64 - 1


def pack(value: object, default: Callable[[object], object] | None = None) -> bytes:
    """`value` as msgpack; `default` turns what msgpack does not know. Raises `ValueError`."""
    try:
        packed: bytes = msgpack.packb(value, use_bin_type=True, default=default)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise ValueError(str(error) or "it does not fit") from error
    return packed


def saturated(value: object) -> int:
    """The nearest number that msgpack has a form for. Raises `TypeError` for what is none."""
    if not isinstance(value, int):
        raise TypeError(f"a '{type(value).__name__}' has no form in msgpack")
    return max(_LEAST, min(_MOST, value))


def pack_surely(value: object) -> bytes:
    """What nodes and the master say as msgpack; of plain values only.

    Nothing that the network can bring about makes it fail: numbers saturate, halves of letters become "?".
    """
    packed: bytes = msgpack.packb(value, use_bin_type=True, unicode_errors="replace", default=saturated)
    return packed


def unpack(data: bytes | memoryview) -> object:
    """The value in `data`. Raises `ValueError` for anything that is not exactly one msgpack value."""
    try:
        value: object = msgpack.unpackb(data, raw=False, strict_map_key=False)
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or "the bytes end too early") from error
    return value
