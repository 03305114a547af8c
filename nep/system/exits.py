"""The end of the interpreter: what has to come after all nodes were closed."""

from __future__ import annotations

import atexit
from collections.abc import Callable

__all__ = ["after_nodes"]

_calls: list[Callable[[], object]] = []


def after_nodes(call: Callable[[], object]) -> None:
    """Call this when the interpreter ends and nodes have delivered what was published. The newest first.

    What is registered with `atexit` when a node is made would come before.
    """
    _calls.append(call)


def _run() -> None:
    while _calls:
        _calls.pop()()


atexit.register(_run)
