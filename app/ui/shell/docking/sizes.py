"""Default sizes of panels, which apply until the user moves a separator.

In a larger window, columns with a width and the last panel of each column keep their sizes; the others
share the additional space. In a small window all panels shrink in proportion. Columns grow with the
text size up to a limit of the layout.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow

from app.ui.shell.docking.layouts import Layout

MIN_SIZE_PX = 120


def shares(wanted: Sequence[int], room: int, *, keep: Sequence[bool]) -> list[int]:
    """Distribute a length among widgets and return their sizes.

    Args:
        wanted: Default sizes in px.
        room: Length in px to distribute.
        keep: True for each widget whose size is fixed; the others are scaled in proportion. If this
            left less than `MIN_SIZE_PX` for one of them, all widgets are scaled.
    """
    whole = max(1, sum(wanted))
    least = sum(size if kept else MIN_SIZE_PX for size, kept in zip(wanted, keep, strict=True))
    sizes = list(wanted)
    if least > room:
        sizes = [min(size, max(MIN_SIZE_PX, round(room * size / whole))) for size in wanted]
    kept = sum(size for size, kept in zip(sizes, keep, strict=True) if kept)
    free = sum(size for size, kept in zip(wanted, keep, strict=True) if not kept)
    left = max(room - kept, MIN_SIZE_PX * sum(1 for kept in keep if not kept))
    return [
        own if kept else round(left * size / max(1, free))
        for own, size, kept in zip(sizes, wanted, keep, strict=True)
    ]


def fit(
    bench: QMainWindow,
    layout: Layout,
    docks: Mapping[str, QDockWidget],
    gap: int,
    scale: float = 1.0,
    folded: Container[str] = (),
    *,
    below: int = 0,
) -> None:
    """Resize all columns and panels to the layout's proportions in the available space.

    Args:
        bench: Window with the docks.
        layout: Layout with the default sizes.
        docks: Docks by key.
        gap: Width of the separators in px.
        scale: Text size, 1.0 for 100 %.
        folded: Panels that were moved into the tabs of another panel.
        below: Height in px that is reserved at the bottom for a panel of full width.
    """
    columns = []
    before: list[QDockWidget] = []
    for column in layout.columns:
        there = []
        for names, height in column.rows:
            dock = _first_dock(bench, docks, [name for name in names if name not in folded])
            if dock is not None and not any(dock in bench.tabifiedDockWidgets(b) for b in before):
                before.append(dock)
                shared = [dock, *bench.tabifiedDockWidgets(dock)]
                tall = [
                    least
                    for each, least in layout.min_heights.items()
                    if docks.get(each) in shared and not docks[each].isHidden()
                ]
                there.append((dock, max([height, *tall]), set(names) <= layout.deferred_panels))
        if there:
            columns.append((column, there))
    if not columns:
        return
    margins = bench.contentsMargins()
    wide = bench.width() - margins.left() - margins.right() - gap * (len(columns) - 1)
    high = bench.height() - margins.top() - margins.bottom() - below
    wanted = [
        round(min(max(column.width * scale, column.share * wide), column.max_share * wide))
        if column.width
        else MIN_SIZE_PX
        for column, _ in columns
    ]
    keep = [bool(column.width) for column, _ in columns]
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


def shrink_above(
    bench: QMainWindow,
    docks: Iterable[QDockWidget],
    area: Qt.DockWidgetArea,
    gap: int,
    *,
    below: int,
) -> None:
    """Shrink the columns of an area in proportion, to free space at the bottom.

    Args:
        bench: Window with the docks.
        docks: Docks of the window.
        area: Dock area of the columns.
        gap: Width of the separators in px.
        below: Height in px to free at the bottom.
    """
    columns: dict[int, list[QDockWidget]] = {}
    for dock in docks:
        is_seen = not dock.isFloating() and not dock.visibleRegion().isEmpty()
        if is_seen and bench.dockWidgetArea(dock) == area:
            columns.setdefault(dock.x(), []).append(dock)
    margins = bench.contentsMargins()
    high = bench.height() - margins.top() - margins.bottom() - below
    for column in columns.values():
        room, whole = high - gap * (len(column) - 1), sum(dock.height() for dock in column)
        heights = [round(room * dock.height() / whole) for dock in column]
        bench.resizeDocks(column, heights, Qt.Orientation.Vertical)


def _first_dock(
    bench: QMainWindow, docks: Mapping[str, QDockWidget], names: Sequence[str]
) -> QDockWidget | None:
    # Skips a panel that is being moved to another place.
    for name in names:
        dock = docks.get(name)
        if dock is None or dock.isHidden() or dock.isFloating():
            continue
        if bench.dockWidgetArea(dock) != Qt.DockWidgetArea.NoDockWidgetArea:
            return dock
    return None
