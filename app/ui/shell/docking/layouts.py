"""Built-in layouts: Behaviour to build and run behaviours, Developer for programmers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.ui.panels.base import Density
from nep.i18n import lazy


@dataclass(frozen=True)
class DockColumn:
    """Column of panels.

    Each row has the names of the panels that share a place, and a height. A ``width`` of 0 takes the
    remaining space. The width grows with the text size up to the share ``most`` of the window's width; in a
    large window it is ``share`` of it.
    """

    width: int
    rows: tuple[tuple[tuple[str, ...], int], ...]
    max_share: float = 1.0
    share: float = 0.0


@dataclass(frozen=True)
class Fold:
    """Panels that become tabs of ``into`` below a width or height, in px at 100 % text.

    The first panel identifies the fold within its layout.
    """

    target: str
    panels: tuple[str, ...]
    below_width: int = 0
    below_height: int = 0

    def applies(self, width: float, height: float) -> bool:
        """Return True if the panels are folded in a workbench of this size (px at 100 % text)."""
        return width < self.below_width or height < self.below_height


@dataclass(frozen=True)
class Layout:
    """Default arrangement of a layout: columns from the left, and ``folds`` for small windows.

    Attributes:
        title: Title, wrapped in `lazy`.
        homes: Panel next to which another one opens as a tab; others open next to the last panel.
        brings: Panel that opens together with another one, and isn't open by default.
        taller: Minimum height of the place of a panel while it is open.
        below: Heights of panels that open below all others with the window's full width.
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
        """Panels that are open by default."""
        names = (name for column in self.columns for names, _height in column.rows for name in names)
        return tuple(name for name in names if name not in self.deferred_panels)

    @property
    def deferred_panels(self) -> frozenset[str]:
        """Panels whose rows don't exist by default."""
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
        DockColumn(640, ((("topics",), 780),), max_share=0.62, share=0.43),
        DockColumn(330, ((("inspector",), 780),), max_share=0.28, share=0.22),
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
    """Return the layout with this name, or the first one if there is none."""
    return next((layout for layout in LAYOUTS if layout.name == name), LAYOUTS[0])
