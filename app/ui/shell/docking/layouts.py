"""Built-in layouts: Behaviour to build and run behaviours, Developer for programmers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.ui.panels.base import Density
from nep.i18n import lazy


@dataclass(frozen=True)
class DockColumn:
    """Column of docks in a layout.

    Attributes:
        width: Width in px at 100 % text size; 0 takes the remaining space.
        rows: Names of the panels that share a place, and height in px, for each row from top to bottom.
        max_share: Maximum width as a share of the window's width.
        min_share: Minimum width as a share of the window's width, for large windows.
    """

    width: int
    rows: tuple[tuple[tuple[str, ...], int], ...]
    max_share: float = 1.0
    min_share: float = 0.0


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
    """Default arrangement of the panels in a workbench.

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
    tab_targets: Mapping[str, str]
    companions: Mapping[str, str] = field(default_factory=dict)
    min_heights: Mapping[str, int] = field(default_factory=dict)
    bottom_heights: Mapping[str, int] = field(default_factory=lambda: {"timeline": 324})

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
    (
        DockColumn(0, ((("behaviour",), 626), (("problems", "variables"), 124))),
        DockColumn(
            384,
            ((("robot",), 327), (("camera",), 275), (("sensors",), 140), (("health",), 190)),
            max_share=0.36,
        ),
    ),
    (
        Fold("robot", ("camera",), below_width=1280),
        Fold("sensors", ("problems", "variables"), below_height=560),
        Fold("robot", ("sensors", "problems", "variables"), below_height=400),
    ),
    {
        "robots": "behaviour",
        "doctor": "behaviour",
        "plot": "behaviour",
        "graph": "behaviour",
        "alarms": "behaviour",
        "recordings": "behaviour",
        "publish": "behaviour",
        "services": "behaviour",
        "sent": "problems",
        "console": "problems",
        "alerts": "problems",
        "nodes": "problems",
        "image": "camera",
        "first_steps": "camera",
        "health": "sensors",
    },
    {"robots": "health"},
    {"first_steps": 400},
)
DEVELOPER = Layout(
    "developer",
    lazy("Developer"),
    "activity",
    "compact",
    (
        DockColumn(640, ((("topics",), 780),), max_share=0.62, min_share=0.43),
        DockColumn(330, ((("inspector",), 780),), max_share=0.28, min_share=0.22),
        DockColumn(0, ((("image",), 380), (("console", "alerts", "nodes"), 394))),
    ),
    (
        Fold("topics", ("inspector",), below_width=1280),
        Fold("image", ("console",), below_height=400),
    ),
    {
        "robots": "topics",
        "doctor": "topics",
        "graph": "topics",
        "alarms": "topics",
        "recordings": "topics",
        "publish": "topics",
        "services": "inspector",
        "sent": "console",
        "robot": "image",
        "camera": "image",
        "health": "console",
        "variables": "console",
        "plot": "topics",
    },
)
LAYOUTS: tuple[Layout, ...] = (BEHAVIOUR, DEVELOPER)


def layout_named(name: str) -> Layout:
    """Return the built-in layout with this name, or the first one if the name is unknown."""
    return next((layout for layout in LAYOUTS if layout.name == name), LAYOUTS[0])
