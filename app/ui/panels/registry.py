"""Registry of the panels of Studio and of installed plug-ins, which are imported on first use."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial

from app.ui import panels
from app.ui.panels.base import Panel
from nep.system.plugins import discover


class PanelRegistry(Mapping[str, Panel]):
    """Mapping of panel names to panels.

    All panel modules are imported on the first access, because this takes time and the start page needs
    none.
    """

    @cached_property
    def _panels(self) -> Mapping[str, Panel]:
        return discover(panels.__name__, "PANEL", Panel)

    def import_steps(self) -> Sequence[Callable[[], object]]:
        """Return functions that import one panel module each, to divide the import into short steps."""
        names = [info.name for info in pkgutil.iter_modules(panels.__path__, f"{panels.__name__}.")]
        return [*(partial(importlib.import_module, name) for name in names), lambda: self._panels]

    def __getitem__(self, name: str) -> Panel:
        return self._panels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._panels)

    def __len__(self) -> int:
        return len(self._panels)
