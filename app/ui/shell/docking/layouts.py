"""Built-in layouts: Behaviour to build and run behaviours, Developer for programmers.

A layout defines its columns and its rules for small windows. Its rows come from the homes of the panels,
which `arranged` adds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from app.ui.panels.base import Density, Panel
from app.ui.panels.home import BottomHome, RowHome, TabHome
from nep.i18n import lazy


@dataclass(frozen=True)
class DockColumn:
    """Column of docks in a layout.

    Attributes:
        width: Width in px at 100 % text size; 0 takes the remaining space.
        max_share: Maximum width as a share of the window's width.
        min_share: Minimum width as a share of the window's width, for large windows.
        rows: Names of the panels that share a place, and height in px, for each row from top to bottom.
    """

    width: int
    max_share: float = 1.0
    min_share: float = 0.0
    rows: tuple[tuple[tuple[str, ...], int], ...] = ()


@dataclass(frozen=True)
class Fold:
    """Rule that moves panels into the tabs of another panel in a small workbench.

    Attributes:
        target: Panel to whose tabs the panels are added.
        panels: Panels to move; the first one identifies the rule in saved layouts.
        below_width: Width in px at 100 % text size below which the rule applies.
        below_height: Height in px at 100 % text size below which the rule applies.
    """

    target: str
    panels: tuple[str, ...]
    below_width: int = 0
    below_height: int = 0

    def applies(self, width: float, height: float) -> bool:
        """Return True if the rule applies to a workbench of this size, in px at 100 % text size."""
        return width < self.below_width or height < self.below_height


@dataclass(frozen=True)
class Layout:
    """Default arrangement of the panels in a workbench; without rows before `arranged`.

    Attributes:
        name: Unique name.
        title: Title, wrapped in `lazy`.
        icon: Name of the icon.
        density: Row height and text size of the panels.
        columns: Columns from left to right.
        folds: Rules for small workbenches.
        tab_targets: Panel to whose tabs another one is added when it is opened, by name of the latter;
            the default is the last panel.
        companions: Panel that is opened together with another one, by name of the latter.
        min_heights: Minimum heights in px of the rows that contain certain open panels, by name.
        bottom_heights: Heights in px of panels that are opened below all columns, by name.
    """

    name: str
    title: str
    icon: str
    density: Density
    columns: tuple[DockColumn, ...]
    folds: tuple[Fold, ...]
    tab_targets: Mapping[str, str] = field(default_factory=dict)
    companions: Mapping[str, str] = field(default_factory=dict)
    min_heights: Mapping[str, int] = field(default_factory=dict)
    bottom_heights: Mapping[str, int] = field(default_factory=dict)

    @property
    def default_panels(self) -> tuple[str, ...]:
        """Names of the panels that are open by default."""
        names = (name for column in self.columns for names, _height in column.rows for name in names)
        return tuple(name for name in names if name not in self.deferred_panels)

    @property
    def deferred_panels(self) -> frozenset[str]:
        """Names of the panels whose rows are created only when they are opened."""
        return frozenset(self.companions.values())


BEHAVIOUR = Layout(
    "behaviour",
    lazy("Behaviour"),
    "blocks",
    "comfortable",
    (DockColumn(0), DockColumn(384, max_share=0.36)),
    (
        Fold("robot", ("camera",), below_width=1280),
        Fold("sensors", ("problems", "variables"), below_height=560),
        Fold("robot", ("sensors", "problems", "variables"), below_height=400),
    ),
)
DEVELOPER = Layout(
    "developer",
    lazy("Developer"),
    "activity",
    "compact",
    (
        DockColumn(640, max_share=0.62, min_share=0.43),
        DockColumn(330, max_share=0.28, min_share=0.22),
        DockColumn(0),
    ),
    (
        Fold("topics", ("inspector",), below_width=1280),
        Fold("image", ("console",), below_height=400),
    ),
)
LAYOUTS: tuple[Layout, ...] = (BEHAVIOUR, DEVELOPER)


def layout_named(name: str) -> Layout:
    """Return the built-in layout with this name, or the first one if the name is unknown."""
    return next((layout for layout in LAYOUTS if layout.name == name), LAYOUTS[0])


def arranged(layout: Layout, panels: Iterable[Panel]) -> Layout:
    """Return a layout with the homes of panels."""
    names_by_row: dict[tuple[int, int], list[tuple[int, str]]] = {}
    heights: dict[tuple[int, int], int] = {}
    tab_targets: dict[str, str] = {}
    companions: dict[str, str] = {}
    min_heights: dict[str, int] = {}
    bottom_heights: dict[str, int] = {}
    for panel in panels:
        home = next((each for each in panel.home if each.layout == layout.name), None)
        match home:
            case RowHome():
                place = (min(home.column, len(layout.columns) - 1), home.row)
                names_by_row.setdefault(place, []).append((home.tab, panel.name))
                heights[place] = max(home.height, heights.get(place, 0))
                if home.opens_with:
                    companions[home.opens_with] = panel.name
                if home.tab_of:
                    tab_targets[panel.name] = home.tab_of
            case TabHome():
                tab_targets[panel.name] = home.tab_of
                if home.min_height:
                    min_heights[panel.name] = home.min_height
            case BottomHome():
                bottom_heights[panel.name] = home.height
    columns = tuple(
        replace(
            column,
            rows=tuple(
                (tuple(name for _tab, name in sorted(names_by_row[place])), heights[place])
                for place in sorted(names_by_row)
                if place[0] == index
            ),
        )
        for index, column in enumerate(layout.columns)
    )
    return replace(
        layout,
        columns=columns,
        tab_targets=tab_targets,
        companions=companions,
        min_heights=min_heights,
        bottom_heights=bottom_heights,
    )
