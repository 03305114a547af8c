"""Exits: what has to end after all nodes are closed, when the interpreter ends.

`atexit` calls first what was registered last, so a library that is loaded after `nep` would be gone before
the nodes that use it.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable

__all__ = ["after_nodes", "not_after_nodes"]

_calls: list[Callable[[], object]] = []


def after_nodes(call: Callable[[], object]) -> None:
    """Call this when the interpreter ends and all nodes are closed, instead of when `atexit` would."""
    atexit.unregister(call)
    _calls.append(call)


def not_after_nodes(call: Callable[[], object]) -> None:
    """Call it no more."""
    _calls[:] = [each for each in _calls if each is not call]


def _run() -> None:
    while _calls:
        _calls.pop()()


atexit.register(_run)
