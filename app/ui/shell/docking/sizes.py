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


def distribute(default_sizes: Sequence[int], room: int, *, fixed_flags: Sequence[bool]) -> list[int]:
    """Distribute a length among widgets and return their sizes.

    Args:
        default_sizes: Default sizes in px.
        room: Length in px to distribute.
        fixed_flags: True for each widget whose size is fixed; the others are scaled in proportion. If
            this left less than `MIN_SIZE_PX` for one of them, all widgets are scaled.
    """
    total = max(1, sum(default_sizes))
    min_total = sum(
        size if is_fixed else MIN_SIZE_PX for size, is_fixed in zip(default_sizes, fixed_flags, strict=True)
    )
    sizes = list(default_sizes)
    if min_total > room:
        sizes = [min(size, max(MIN_SIZE_PX, round(room * size / total))) for size in default_sizes]
    fixed_total = sum(size for size, is_fixed in zip(sizes, fixed_flags, strict=True) if is_fixed)
    scalable_total = sum(
        size for size, is_fixed in zip(default_sizes, fixed_flags, strict=True) if not is_fixed
    )
    remaining = max(room - fixed_total, MIN_SIZE_PX * sum(1 for is_fixed in fixed_flags if not is_fixed))
    return [
        current_size if is_fixed else round(remaining * size / max(1, scalable_total))
        for current_size, size, is_fixed in zip(sizes, default_sizes, fixed_flags, strict=True)
    ]


def fit(
    bench: QMainWindow,
    layout: Layout,
    docks: Mapping[str, QDockWidget],
    gap: int,
    scale: float = 1.0,
    folded: Container[str] = (),
    *,
    bottom_height: int = 0,
) -> None:
    """Resize all columns and panels to the layout's proportions in the available space.

    Args:
        bench: Window with the docks.
        layout: Layout with the default sizes.
        docks: Docks by key.
        gap: Width of the separators in px.
        scale: Text size, 1.0 for 100 %.
        folded: Panels that were moved into the tabs of another panel.
        bottom_height: Height in px that is reserved at the bottom for a panel of full width.
    """
    columns = []
    first_docks: list[QDockWidget] = []
    for column in layout.columns:
        dock_rows = []
        for names, height in column.rows:
            dock = _first_dock(bench, docks, [name for name in names if name not in folded])
            if dock is not None and not any(dock in bench.tabifiedDockWidgets(b) for b in first_docks):
                first_docks.append(dock)
                shared = [dock, *bench.tabifiedDockWidgets(dock)]
                min_heights = [
                    min_height
                    for each, min_height in layout.min_heights.items()
                    if docks.get(each) in shared and not docks[each].isHidden()
                ]
                dock_rows.append((dock, max([height, *min_heights]), set(names) <= layout.deferred_panels))
        if dock_rows:
            columns.append((column, dock_rows))
    if not columns:
        return
    margins = bench.contentsMargins()
    total_width = bench.width() - margins.left() - margins.right() - gap * (len(columns) - 1)
    total_height = bench.height() - margins.top() - margins.bottom() - bottom_height
    widths = [
        round(min(max(column.width * scale, column.min_share * total_width), column.max_share * total_width))
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
        fixed_flags = [
            index > 0 and all(is_deferred for *_, is_deferred in dock_rows[index + 1 :])
            for index in range(len(dock_rows))
        ]
        row_heights = distribute(heights, room, fixed_flags=fixed_flags)
        bench.resizeDocks([dock for dock, *_ in dock_rows], row_heights, Qt.Orientation.Vertical)
    column_widths = distribute(widths, total_width, fixed_flags=fixed_columns)
    bench.resizeDocks(top_docks, column_widths, Qt.Orientation.Horizontal)


def shrink_above(
    bench: QMainWindow,
    docks: Iterable[QDockWidget],
    area: Qt.DockWidgetArea,
    gap: int,
    *,
    bottom_height: int,
) -> None:
    """Shrink the columns of an area in proportion, to free space at the bottom.

    Args:
        bench: Window with the docks.
        docks: Docks of the window.
        area: Dock area of the columns.
        gap: Width of the separators in px.
        bottom_height: Height in px to free at the bottom.
    """
    columns: dict[int, list[QDockWidget]] = {}
    for dock in docks:
        is_visible = not dock.isFloating() and not dock.visibleRegion().isEmpty()
        if is_visible and bench.dockWidgetArea(dock) == area:
            columns.setdefault(dock.x(), []).append(dock)
    margins = bench.contentsMargins()
    height = bench.height() - margins.top() - margins.bottom() - bottom_height
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
