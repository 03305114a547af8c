"""Registry of all panels of Studio and of installed plug-ins, imported on first use."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial

from app.ui import panels
from app.ui.panels.base import Panel
from nep.system.plugins import discover


class PanelRegistry(Mapping[str, Panel]):
    """Mapping of panel names to panels, imported on first access.

    The start page needs no panel, and importing all modules takes time.
    """

    @cached_property
    def _panels(self) -> Mapping[str, Panel]:
        return discover(panels.__name__, "PANEL", Panel)

    def steps(self) -> Sequence[Callable[[], object]]:
        """Return callables that import the panel modules one by one, which takes a few milliseconds each."""
        names = [info.name for info in pkgutil.iter_modules(panels.__path__, f"{panels.__name__}.")]
        return [*(partial(importlib.import_module, name) for name in names), lambda: self._panels]

    def __getitem__(self, name: str) -> Panel:
        return self._panels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._panels)

    def __len__(self) -> int:
        return len(self._panels)
