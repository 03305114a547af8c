"""Rarely: the one rule for logging what happens again and again: the first, the tenth, the hundredth, ..."""

from __future__ import annotations

__all__ = ["is_logged"]

_TOLD = frozenset(10**n for n in range(20))


def is_logged(count: int) -> bool:
    """Whether to log it, when it is the `count`th time."""
    return count in _TOLD
