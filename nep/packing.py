"""msgpack with types: bytes ↔ plain values."""

from __future__ import annotations

from collections.abc import Callable

import msgpack  # type: ignore[import-untyped]

__all__ = ["pack", "unpack"]


def pack(value: object, default: Callable[[object], object] | None = None) -> bytes:
    """`value` as msgpack; `default` turns what msgpack does not know. Raises `ValueError`."""
    try:
        packed: bytes = msgpack.packb(value, use_bin_type=True, default=default)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise ValueError(str(error) or "it does not fit") from error
    return packed


def unpack(data: bytes | memoryview) -> object:
    """The value in `data`. Raises `ValueError` for anything that is not exactly one msgpack value."""
    try:
        value: object = msgpack.unpackb(data, raw=False, strict_map_key=False)
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise ValueError(str(error) or "the bytes end too early") from error
    return value
