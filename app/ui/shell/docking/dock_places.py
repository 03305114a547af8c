"""Where a panel goes that has no place yet: to its row in the layout, else beside another panel, as a tab."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMainWindow

from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.layouts import Layout

AREA = Qt.DockWidgetArea.LeftDockWidgetArea


def join(bench: QMainWindow, layout: Layout, docks: Mapping[str, Dock], dock: Dock) -> None:
    """Give a panel a place: below the row above its own, beside its home, else beside the last panel."""
    name = dock.description.name
    placed = {
        other.description.name: other
        for other in docks.values()
        if other is not dock
        and not other.isFloating()
        and bench.dockWidgetArea(other) != Qt.DockWidgetArea.NoDockWidgetArea
    }
    above = _above(layout, name)
    home = layout.homes.get(name, "")
    if above in placed and not placed[above].isHidden() and not bench.tabifiedDockWidgets(placed[above]):
        bench.splitDockWidget(placed[above], dock, Qt.Orientation.Vertical)
    elif placed:
        bench.tabifyDockWidget(placed[home] if home in placed else list(placed.values())[-1], dock)
    else:
        bench.addDockWidget(AREA, dock)


def _above(layout: Layout, name: str) -> str:
    """The panel of the row above that of one which comes later."""
    if name in layout.later:
        for column in layout.columns:
            for (names, _), (below, _) in zip(column.rows, column.rows[1:], strict=False):
                if name in below:
                    return names[0]
    return ""
