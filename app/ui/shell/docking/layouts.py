"""The two arrangements of panels: Behaviour for people, Developer for programmers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.ui.panels.base import Density
from nep.i18n import lazy


@dataclass(frozen=True)
class DockColumn:
    """Panels above each other: (names that share a place, height). ``width`` 0 takes the rest."""

    width: int
    rows: tuple[tuple[tuple[str, ...], int], ...]


@dataclass(frozen=True)
class Layout:
    """A layout as it is at first: columns from the left; in narrow windows ``narrow`` become tabs.

    ``title`` is marked with `lazy`. ``homes`` tells beside which panel another one opens, as a tab; the rest
    open beside the last panel. ``brings`` tells which panel comes with another one when that is opened; it is
    ``lazy_module``: at first its row is not there.
    """

    name: str
    title: str
    icon: str
    density: Density
    columns: tuple[DockColumn, ...]
    narrow: tuple[str, str]
    homes: Mapping[str, str]
    brings: Mapping[str, str] = field(default_factory=dict)

    @property
    def later(self) -> frozenset[str]:
        """The panels whose rows are not there at first."""
        return frozenset(self.brings.values())


BEHAVIOUR = Layout(
    "behaviour",
    lazy("Behaviour"),
    "blocks",
    "comfortable",
    (
        DockColumn(0, ((("behaviour",), 626), (("problems",), 124))),
        DockColumn(384, ((("robot",), 327), (("camera",), 275), (("sensors",), 140), (("health",), 190))),
    ),
    ("robot", "camera"),
    {
        "robots": "behaviour",
        "doctor": "behaviour",
        "console": "problems",
        "alerts": "problems",
        "nodes": "problems",
        "image": "camera",
        "health": "sensors",
    },
    {"robots": "health"},
)
DEVELOPER = Layout(
    "developer",
    lazy("Developer"),
    "activity",
    "compact",
    (
        DockColumn(640, ((("topics",), 780),)),
        DockColumn(330, ((("inspector",), 780),)),
        DockColumn(0, ((("image",), 380), (("console", "alerts", "nodes"), 394))),
    ),
    ("topics", "inspector"),
    {"robots": "topics", "doctor": "topics", "robot": "image", "camera": "image", "health": "console"},
)
LAYOUTS: tuple[Layout, ...] = (BEHAVIOUR, DEVELOPER)


def layout_named(name: str) -> Layout:
    """The layout of that name; the first when there is none."""
    return next((layout for layout in LAYOUTS if layout.name == name), LAYOUTS[0])
