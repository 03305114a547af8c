"""Exit handlers that run after all nodes are closed.

`atexit` calls handlers in reverse order, so a library that is loaded after `nep` would shut down before the
nodes that use it.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable

_handlers: list[Callable[[], object]] = []


def call_after_nodes(call: Callable[[], object]) -> None:
    """Register a function to be called at interpreter exit, after all nodes are closed.

    If the function is already registered with `atexit`, that registration is removed.
    """
    atexit.unregister(call)
    _handlers.append(call)


def cancel_after_nodes(call: Callable[[], object]) -> None:
    """Unregister a function that was registered with `call_after_nodes`."""
    _handlers[:] = [each for each in _handlers if each is not call]


def _run_handlers() -> None:
    while _handlers:
        _handlers.pop()()


atexit.register(_run_handlers)
