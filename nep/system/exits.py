"""Exit handlers that run after all nodes are closed.

`atexit` calls handlers in reverse order, so a library that is loaded after `nep` would shut down before the
nodes that use it.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable

_calls: list[Callable[[], object]] = []


def after_nodes(call: Callable[[], object]) -> None:
    """Register a function to be called at interpreter exit, after all nodes are closed.

    If the function is registered with `atexit`, it is unregistered there.
    """
    atexit.unregister(call)
    _calls.append(call)


def not_after_nodes(call: Callable[[], object]) -> None:
    """Unregister a function that was registered with `after_nodes`."""
    _calls[:] = [each for each in _calls if each is not call]


def _run() -> None:
    while _calls:
        _calls.pop()()


atexit.register(_run)
