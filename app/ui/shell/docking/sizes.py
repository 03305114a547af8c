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


def shares(default_sizes: Sequence[int], room: int, *, fixed: Sequence[bool]) -> list[int]:
    """Distribute a length among widgets and return their sizes.

    Args:
        default_sizes: Default sizes in px.
        room: Length in px to distribute.
        fixed: True for each widget whose size is fixed; the others are scaled in proportion. If this
            left less than `MIN_SIZE_PX` for one of them, all widgets are scaled.
    """
    total = max(1, sum(default_sizes))
    min_total = sum(
        size if fixed_size else MIN_SIZE_PX for size, fixed_size in zip(default_sizes, fixed, strict=True)
    )
    sizes = list(default_sizes)
    if min_total > room:
        sizes = [min(size, max(MIN_SIZE_PX, round(room * size / total))) for size in default_sizes]
    fixed_size = sum(size for size, fixed_size in zip(sizes, fixed, strict=True) if fixed_size)
    free = sum(size for size, fixed_size in zip(default_sizes, fixed, strict=True) if not fixed_size)
    remaining = max(room - fixed_size, MIN_SIZE_PX * sum(1 for fixed_size in fixed if not fixed_size))
    return [
        current_size if fixed_size else round(remaining * size / max(1, free))
        for current_size, size, fixed_size in zip(sizes, default_sizes, fixed, strict=True)
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
        dock_rows = []
        for names, height in column.rows:
            dock = _first_dock(bench, docks, [name for name in names if name not in folded])
            if dock is not None and not any(dock in bench.tabifiedDockWidgets(b) for b in before):
                before.append(dock)
                shared = [dock, *bench.tabifiedDockWidgets(dock)]
                tall = [
                    min_height
                    for each, min_height in layout.min_heights.items()
                    if docks.get(each) in shared and not docks[each].isHidden()
                ]
                dock_rows.append((dock, max([height, *tall]), set(names) <= layout.deferred_panels))
        if dock_rows:
            columns.append((column, dock_rows))
    if not columns:
        return
    margins = bench.contentsMargins()
    total_width = bench.width() - margins.left() - margins.right() - gap * (len(columns) - 1)
    total_height = bench.height() - margins.top() - margins.bottom() - below
    widths = [
        round(min(max(column.width * scale, column.share * total_width), column.max_share * total_width))
        if column.width
        else MIN_SIZE_PX
        for column, _ in columns
    ]
    fixed_columns = [bool(column.width) for column, _ in columns]
    if all(fixed_columns):
        fixed_columns[-1] = False
    top_docks = [dock_rows[0][0] for _, dock_rows in columns]
    for _, dock_rows in columns:
        room = total_height - gap * (len(dock_rows) - 1)
        heights = [height for _, height, _ in dock_rows]
        fixed = [
            index > 0 and all(late for *_, late in dock_rows[index + 1 :]) for index in range(len(dock_rows))
        ]
        bench.resizeDocks(
            [dock for dock, *_ in dock_rows], shares(heights, room, fixed=fixed), Qt.Orientation.Vertical
        )
    bench.resizeDocks(top_docks, shares(widths, total_width, fixed=fixed_columns), Qt.Orientation.Horizontal)


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
    height = bench.height() - margins.top() - margins.bottom() - below
    for column in columns.values():
        room, total = height - gap * (len(column) - 1), sum(dock.height() for dock in column)
        heights = [round(room * dock.height() / total) for dock in column]
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
