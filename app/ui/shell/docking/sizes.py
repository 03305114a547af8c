"""How large the panels of a layout are until a person moves the lines between them.

A column keeps its width and the last panel of a column its height, and so does one with only panels below it
that come later; what a larger window gives goes to the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow

from app.ui.shell.docking.layouts import Layout

LEAST_PX = 120


def shares(wanted: Sequence[int], room: int, *, keep: Sequence[bool]) -> list[int]:
    """Sizes that fill ``room``: those to keep as they are wanted, the others in their proportion."""
    kept = sum(size for size, kept in zip(wanted, keep, strict=True) if kept)
    free = sum(size for size, kept in zip(wanted, keep, strict=True) if not kept)
    left = max(room - kept, LEAST_PX * sum(1 for kept in keep if not kept))
    return [
        size if kept else round(left * size / max(1, free)) for size, kept in zip(wanted, keep, strict=True)
    ]


def fit(bench: QMainWindow, layout: Layout, docks: Mapping[str, QDockWidget], gap: int) -> None:
    """Give every column and every panel in it the size of the layout, in the room that there is now."""
    columns = []
    before: list[QDockWidget] = []
    for column in layout.columns:
        there = []
        for names, height in column.rows:
            dock = _first(docks, names)
            if dock is not None and not any(dock in bench.tabifiedDockWidgets(b) for b in before):
                before.append(dock)
                there.append((dock, height, set(names) <= layout.later))
        if there:
            columns.append((column.width, there))
    if not columns:
        return
    margins = bench.contentsMargins()
    wide = bench.width() - margins.left() - margins.right() - gap * (len(columns) - 1)
    high = bench.height() - margins.top() - margins.bottom()
    wanted = [width or LEAST_PX for width, _ in columns]
    keep = [bool(width) for width, _ in columns]
    if all(keep):
        keep[-1] = False
    heads = [there[0][0] for _, there in columns]
    for _, there in columns:
        room = high - gap * (len(there) - 1)
        heights = [height for _, height, _ in there]
        fixed = [place > 0 and all(late for *_, late in there[place + 1 :]) for place in range(len(there))]
        bench.resizeDocks(
            [dock for dock, *_ in there], shares(heights, room, keep=fixed), Qt.Orientation.Vertical
        )
    bench.resizeDocks(heads, shares(wanted, wide, keep=keep), Qt.Orientation.Horizontal)


def _first(docks: Mapping[str, QDockWidget], names: Sequence[str]) -> QDockWidget | None:
    """The first of the panels that share a place and are in it."""
    for name in names:
        dock = docks.get(name)
        if dock is not None and not dock.isHidden() and not dock.isFloating():
            return dock
    return None
