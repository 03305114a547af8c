"""Modules that are imported at their first use, to reduce the startup time.

    if TYPE_CHECKING:
        import psutil
    else:
        psutil = lazy_module("psutil")

Type checkers see the real module.
"""

from __future__ import annotations

import importlib


class LazyModule:
    """Proxy that imports a module when an attribute is first accessed. Thread-safe."""

    __slots__ = ("_name",)

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> object:
        return getattr(importlib.import_module(self._name), attribute)

    def __repr__(self) -> str:
        return f"<'{self._name}', imported when it is used>"


def lazy_module(name: str) -> LazyModule:
    """Return a proxy of a module. Import errors are raised at the first access to an attribute."""
    return LazyModule(name)
