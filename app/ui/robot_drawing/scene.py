"""Painter of virtual robots in their room, and hit testing of robots and objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPen, QPixmap

from app.ui.robot_drawing.bubble import paint_bubble
from app.ui.robot_drawing.figure import RobotFigure, figure_of
from app.ui.robot_drawing.objects import paint_thing, thing_area
from app.ui.robot_drawing.room import WIDTH, Spot, Stage, paint_room
from app.ui.robot_drawing.state import RobotState, Thing

OtherRobots: TypeAlias = Sequence[tuple[str, RobotState]]

# Shown before any robot has published its state.
PREVIEW_STATE = RobotState(
    x=0.05,
    arm_left_deg=124.0,
    objects=(Thing("ball", 0.1, -1.65), Thing("table", -0.85, 1.95)),
)


@dataclass(frozen=True, slots=True)
class Marks:
    """Outlined parts of the drawing, as returned by `RobotDrawing.part_at`.

    Attributes:
        hovered_part: Part under the mouse, or None.
        selected_part: Part selected by keyboard, or None.
        colour: Colour of the outline.
    """

    hovered_part: str | None = None
    selected_part: str | None = None
    colour: QColor = field(default_factory=lambda: QColor("#3F7CB3"))


NO_MARKS = Marks()


class RobotDrawing:
    """Painter of virtual robots in their room.

    The room is painted once per size and cached as a pixmap, so that frames are cheap. In all methods,
    ``state`` is the main robot, and ``others`` are pairs of name and state of the other robots in the same
    room.
    """

    def __init__(self, font: QFont | None = None) -> None:
        # `font` is the font of speech bubbles.
        self._font = QFont(font) if font is not None else QFont()
        self._room: QPixmap | None = None
        self._room_key: tuple[float, float, float, bool] | None = None

    def paint(
        self,
        painter: QPainter,
        area: QRectF,
        state: RobotState,
        others: OtherRobots = (),
        *,
        marks: Marks = NO_MARKS,
        is_dark: bool = False,
    ) -> None:
        """Paint the room with its objects and robots.

        Args:
            painter: Painter in px.
            area: Area to fill, in px.
            state: State of the main robot.
            others: Names and states of the other robots.
            marks: Outlined parts.
            is_dark: True to dim the colours for a dark theme.
        """
        stage = Stage(area, state.room)
        painter.save()
        painter.setClipRect(area)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._paint_room(painter, stage, is_dark)
        painter.translate(stage.origin)
        painter.scale(stage.scale, stage.scale)
        figures = _figures(stage, state, others)
        _paint_reach(painter, figures[0].spot, state)
        items: list[tuple[Spot, Thing | Figure]] = [*_placed_things(stage, state)]
        items += [(figure.spot, figure) for figure in reversed(figures)]
        for spot, item in sorted(items, key=lambda pair: pair[0].v):
            if isinstance(item, Thing):
                paint_thing(painter, item, spot, self._font)
            else:
                _paint_figure(painter, item)
        self._paint_marks(painter, stage, state, others, marks)
        bubbles: list[QRectF] = []
        for figure in figures:
            if figure.state.caption:
                head_y = figure.drawing.bubble_at.y()
                head = replace(figure.spot, v=figure.spot.v + head_y * figure.spot.scale)
                bubble = paint_bubble(painter, stage.bounds(), head, figure.state, self._font, bubbles)
                bubbles.append(bubble)
        painter.restore()
        if is_dark:
            painter.fillRect(area, QColor(0, 0, 12, 34))

    def part_at(
        self, point: QPointF, area: QRectF, state: RobotState, others: OtherRobots = ()
    ) -> str | None:
        """Return the part of the drawing at a point in px; None if there is only background.

        Examples are ``head``, ``left_hand``, ``body``, ``Turtle/body`` and the name of an object, or its
        kind if it has no name. Parts that can be touched take precedence over objects, and objects over
        bodies and over objects behind them.
        """
        stage = Stage(area, state.room)
        unit = stage.to_units(point)
        figures = sorted(_figures(stage, state, others), key=lambda figure: -figure.spot.v)
        for figure in figures:
            part = figure.touchable_part_at(unit)
            if part is not None:
                return figure.part_name(part)
        for spot, thing in reversed(_placed_things(stage, state)):
            if thing_area(thing, spot).adjusted(-3, -3, 3, 3).contains(unit):
                return thing.name or thing.kind
        return next((each.part_name("body") for each in figures if each.area.contains(unit)), None)

    def bumper_side_at(
        self, point: QPointF, area: QRectF, part: str, state: RobotState, others: OtherRobots = ()
    ) -> str | None:
        """Return the side of the bumper that a click presses, or None if the robot has no bumper.

        Args:
            point: Position of the click in px.
            area: Area of the drawing in px.
            part: Clicked body of a robot, as returned by `part_at`.
            state: State of the main robot.
            others: Names and states of the other robots.
        """
        stage = Stage(area, state.room)
        for figure in _figures(stage, state, others):
            bumper_side_at = figure.drawing.bumper_side_at
            if figure.part_name("body") == part and bumper_side_at is not None:
                return bumper_side_at(figure.to_own_units(stage.to_units(point)), figure.state.theta_deg)
        return None

    def floor_at(self, point: QPointF, area: QRectF, state: RobotState) -> tuple[float, float]:
        """Convert a point in px to a floor point in m, limited to the room."""
        return Stage(area, state.room).floor_at(point)

    def pixel_of(self, x: float, y: float, area: QRectF, state: RobotState) -> QPointF:
        """Convert a floor point in m to a point in px."""
        stage = Stage(area, state.room)
        spot = stage.spot_at(x, y)
        return stage.origin + QPointF(spot.u, spot.v) * stage.scale

    def point_of(
        self, part: str, area: QRectF, state: RobotState, others: OtherRobots = ()
    ) -> QPointF | None:
        """Return the centre of a part (see `part_at`) in px, or None if there is no such part."""
        stage = Stage(area, state.room)
        for figure in _figures(stage, state, others):
            parts = figure.drawing.touchable_parts(figure.state)
            positions = {name: centre for name, (centre, _radius) in parts.items()}
            for name, position in {**positions, "body": figure.drawing.body_at}.items():
                if part == figure.part_name(name):
                    unit = QPointF(figure.spot.u, figure.spot.v) + position * figure.spot.scale
                    return stage.origin + unit * stage.scale
        for spot, thing in _placed_things(stage, state):
            if part in {thing.name, thing.kind}:
                return stage.origin + thing_area(thing, spot).center() * stage.scale
        return None

    def _paint_marks(
        self, p: QPainter, stage: Stage, state: RobotState, others: OtherRobots, marks: Marks
    ) -> None:
        # Outlines the part under the mouse, and more strongly the selected part.
        areas = {figure.part_name("body"): figure.area for figure in _figures(stage, state, others)}
        for spot, thing in _placed_things(stage, state):
            areas[thing.name or thing.kind] = thing_area(thing, spot)
        for part, width in ((marks.hovered_part, 1.4), (marks.selected_part, 2.4)):
            area = areas.get(part or "")
            if area is not None:
                p.setBrush(Qt.BrushStyle.NoBrush)
                for colour, pen_width in ((QColor("#FFFFFF"), width + 1.6), (marks.colour, width)):
                    p.setPen(QPen(colour, pen_width))
                    p.drawRoundedRect(area.adjusted(-4, -4, 4, 4), 6, 6)

    def _paint_room(self, painter: QPainter, stage: Stage, is_dark: bool) -> None:
        area = stage.area
        ratio = painter.device().devicePixelRatio()
        key = (area.width(), area.height(), ratio, is_dark)
        if self._room is None or key != self._room_key:
            size = QSize(max(1, round(area.width() * ratio)), max(1, round(area.height() * ratio)))
            self._room = QPixmap(size)
            self._room.setDevicePixelRatio(ratio)
            self._room.fill(QColor("#C4AA87"))  # shows through at antialiased edges
            room_painter = QPainter(self._room)
            room_painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            room_painter.translate(stage.origin - area.topLeft())
            room_painter.scale(stage.scale, stage.scale)
            paint_room(room_painter, stage.bounds())
            room_painter.end()
            self._room_key = key
        painter.drawPixmap(area.topLeft(), self._room)


def _placed_things(stage: Stage, state: RobotState) -> list[tuple[Spot, Thing]]:
    # Sorted from back to front; people in front of the robot are marks on the floor.
    pairs = []
    for thing in state.objects:
        is_in_front = thing.kind in {"person", "face"} and thing.x > state.x
        drawn_thing = replace(thing, kind="place") if is_in_front else thing
        spot = stage.spot_at(thing.x, thing.y)
        half_width = thing_area(drawn_thing, spot).width() / 2
        # keeps things at a side wall completely visible
        clamped_u = min(max(spot.u, half_width + 4), WIDTH - half_width - 4)
        pairs.append((replace(spot, u=clamped_u), drawn_thing))
    return sorted(pairs, key=lambda pair: pair[0].v)


@dataclass(frozen=True, slots=True)
class Figure:
    """Robot with its position on the stage.

    Attributes:
        name: Name of the robot; "" for the main robot.
        state: State of the robot.
        spot: Position of the foot, with the scale of the figure.
    """

    name: str
    state: RobotState
    spot: Spot

    def part_name(self, part: str) -> str:
        """Return the name of a part of this robot in the format of `RobotDrawing.part_at`."""
        return f"{self.name}/{part}" if self.name else part

    def to_own_units(self, unit: QPointF) -> QPointF:
        """Convert a point from stage units to coordinates of the figure: foot at (0, 0), scale 1."""
        return (unit - QPointF(self.spot.u, self.spot.v)) / self.spot.scale

    @property
    def drawing(self) -> RobotFigure:
        """Drawing of the robot."""
        return figure_of(self.state)

    def touchable_part_at(self, unit: QPointF) -> str | None:
        """Return the touchable part at a point in stage units, or None."""
        point = self.to_own_units(unit)
        parts = self.drawing.touchable_parts(self.state).items()
        return next((name for name, (centre, radius) in parts if _is_near(point, centre, radius)), None)

    @property
    def area(self) -> QRectF:
        """Bounding rectangle in stage units."""
        bounds, scale = self.drawing.bounds, self.spot.scale
        return QRectF(
            self.spot.u + bounds.x() * scale,
            self.spot.v + bounds.y() * scale,
            bounds.width() * scale,
            bounds.height() * scale,
        )


def _figures(stage: Stage, state: RobotState, others: OtherRobots) -> list[Figure]:
    named_states = [("", state), *others]
    return [Figure(name, each, stage.spot_at(each.x, each.y)) for name, each in named_states]


def _paint_figure(p: QPainter, figure: Figure) -> None:
    p.save()
    lift_offset = 9.0 if figure.state.is_lifted else 0.0
    p.translate(figure.spot.u, figure.spot.v - lift_offset)
    p.scale(figure.spot.scale, figure.spot.scale)
    figure.drawing.paint(p, figure.state)
    p.restore()


def _paint_reach(painter: QPainter, robot: Spot, state: RobotState) -> None:
    painter.save()
    painter.translate(robot.u, robot.v)
    painter.scale(robot.scale, robot.scale)
    pen = QPen(QColor(88, 92, 170, 170), 1.1)
    pen.setStyle(Qt.PenStyle.DashLine)
    pen.setDashPattern([4.0, 4.0])
    painter.setPen(pen)
    painter.setBrush(QColor(92, 88, 170, 46 if not state.is_moving else 78))
    painter.drawEllipse(QPointF(0, 0), 113, 21)
    painter.restore()


def _is_near(point: QPointF, centre: QPointF, radius: float) -> bool:
    offset = point - centre
    return QPointF.dotProduct(offset, offset) <= radius * radius
