"""Registry of the panels of Studio and of installed plug-ins, which are imported on first use."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from types import ModuleType

from app.ui import panels
from app.ui.panels.base import Panel
from nep.system.plugins import discover_own, installed_plugins


class PanelRegistry(Mapping[str, Panel]):
    """Mapping of panel names to panels.

    All panel modules are imported on the first access, because this takes time and the start page needs
    none.
    """

    @cached_property
    def _panels(self) -> Mapping[str, Panel]:
        own: dict[str, Panel] = {}
        for folder in _folders():
            own.update(discover_own(folder.__name__, "PANEL", Panel))
        return {**installed_plugins(panels.__name__, Panel), **own}

    def import_steps(self) -> Sequence[Callable[[], object]]:
        """Return functions that import one panel module each, to divide the import into short steps."""
        names = [each.name for folder in _folders() for each in _members(folder)]
        return [*(partial(importlib.import_module, name) for name in names), lambda: self._panels]

    def __getitem__(self, name: str) -> Panel:
        return self._panels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._panels)

    def __len__(self) -> int:
        return len(self._panels)


def _members(package: ModuleType) -> Iterable[pkgutil.ModuleInfo]:
    return pkgutil.iter_modules(package.__path__, f"{package.__name__}.")


def _folders() -> Sequence[ModuleType]:
    return [importlib.import_module(each.name) for each in _members(panels) if each.ispkg]
