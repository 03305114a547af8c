"""Plug-ins that paint virtual robots: modules of `app.ui.robot_drawing` that bind ``FIGURE``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter

from app.ui.robot_drawing.state import RobotState
from nep.system.plugins import discover_own

DEFAULT_FIGURE = "pepper"


@dataclass(frozen=True, slots=True)
class RobotFigure:
    """Drawing of a kind of robot.

    Positions are relative to the robot's centre on the floor, in stage units; negative y is up.

    Attributes:
        name: Value of ``figure`` in the state that such a robot publishes.
        paint: Paints a robot; the origin of the painter is the robot's centre on the floor.
        bounds: Bounding rectangle.
        bubble_at: Position at which speech bubbles point.
        body_at: Centre of the part ``body``.
        radius_m: Radius of the footprint in m.
        touchable_parts: Returns centre and radius of the parts that the user can touch, by name; at the same
            position, the first one is touched.
        bumper_side_at: Returns the side of the bumper that a click at a position presses, given the robot's
            heading in degrees; None for a robot without a bumper.
    """

    name: str
    paint: Callable[[QPainter, RobotState], None]
    bounds: QRectF
    bubble_at: QPointF
    body_at: QPointF
    radius_m: float
    touchable_parts: Callable[[RobotState], Mapping[str, tuple[QPointF, float]]] = lambda _state: {}
    bumper_side_at: Callable[[QPointF, float], str] | None = None


@lru_cache(maxsize=1)
def _figures() -> Mapping[str, RobotFigure]:
    return discover_own("app.ui.robot_drawing", "FIGURE", RobotFigure)


def figure_of(state: RobotState) -> RobotFigure:
    """Return the drawing of a robot; that of Pepper for an unknown figure."""
    figures = _figures()
    return figures.get(state.figure, figures[DEFAULT_FIGURE])
