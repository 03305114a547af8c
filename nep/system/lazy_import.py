"""Modules that are imported when they are first used: they cost nothing before the window shows.

if TYPE_CHECKING:
import psutil
else:
psutil = lazy_module("psutil")
"""

from __future__ import annotations

import importlib

__all__ = ["lazy_module"]


class LazyModule:
    """Stands for a module, and imports it when something of it is asked for. Any thread may ask."""

    __slots__ = ("_name",)

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> object:
        return getattr(importlib.import_module(self._name), attribute)

    def __repr__(self) -> str:
        return f"<'{self._name}', imported when it is used>"


def lazy_module(name: str) -> LazyModule:
    """A stand-in for the module of this name. What the import raises is raised where it is first used."""
    return LazyModule(name)
