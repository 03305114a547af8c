"""Encoded: a payload that already is bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["Encoded"]


class Encoded(NamedTuple):
    """Bytes of a payload, and what has to travel beside them. A publisher sends it unchanged."""

    data: bytes | memoryview
    extension: Mapping[str, object] | None = None
