"""A picture of a virtual robot in its room, drawn from its state; where its parts are, to touch them."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPen, QPixmap

from app.ui.robot_drawing.bubble import paint_bubble
from app.ui.robot_drawing.objects import paint_thing, thing_area
from app.ui.robot_drawing.pepper import HEAD, limbs, paint_figure
from app.ui.robot_drawing.room import WIDTH, Spot, Stage, paint_room
from app.ui.robot_drawing.state import RobotState, Thing
from app.ui.robot_drawing.turtle import TOP, paint_turtle

TURTLE = "turtle"

# What a preview shows while no robot has told its state.
PREVIEW = RobotState(
    x=0.05,
    arm_left_deg=124.0,
    objects=(Thing("ball", 0.1, -1.65), Thing("table", -0.85, 1.95)),
)


class RobotDrawing:
    """Paints `RobotState`s; keeps the room's picture of the last size, so a moment costs little."""

    def __init__(self, font: QFont | None = None) -> None:
        """``font`` is the speech bubble's."""
        self._font = QFont(font) if font is not None else QFont()
        self._room: QPixmap | None = None
        self._room_key: tuple[float, float, float, bool] | None = None

    def paint(self, painter: QPainter, area: QRectF, state: RobotState, *, dark: bool = False) -> None:
        """Fill ``area`` with the robot of this moment."""
        stage = Stage(area, state.room)
        painter.save()
        painter.setClipRect(area)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._paint_room(painter, stage, dark)
        painter.translate(stage.origin)
        painter.scale(stage.scale, stage.scale)
        robot = stage.spot(state.x, state.y)
        things = _placed(stage, state)
        _paint_reach(painter, robot, state)
        for spot, thing in _in_order(things, robot):
            if thing is not None:
                paint_thing(painter, thing, spot, self._font)
                continue
            painter.save()
            painter.translate(robot.u, robot.v)
            painter.scale(robot.scale, robot.scale)
            (paint_turtle if state.figure == TURTLE else paint_figure)(painter, state)
            painter.restore()
        if state.speech:
            high = TOP.y() if state.figure == TURTLE else HEAD.y()
            head = replace(robot, v=robot.v + high * robot.scale)
            paint_bubble(painter, stage.bounds(), head, state, self._font)
        painter.restore()
        if dark:
            painter.fillRect(area, QColor(0, 0, 12, 34))

    def part_at(self, point: QPointF, area: QRectF, state: RobotState) -> str | None:
        """What is at a pixel: ``head``, ``left_hand``, ``right_hand``, an object's name, or None."""
        stage = Stage(area, state.room)
        unit = stage.unit(point)
        robot = stage.spot(state.x, state.y)
        own = (unit - QPointF(robot.u, robot.v)) / robot.scale
        part = _part_at(own, state) if state.figure != TURTLE else None
        if part is not None:
            return part
        for spot, thing in reversed(_placed(stage, state)):
            if thing_area(thing, spot).adjusted(-3, -3, 3, 3).contains(unit):
                return thing.name or thing.kind
        return None

    def floor_at(self, point: QPointF, area: QRectF, state: RobotState) -> tuple[float, float]:
        """The place of the floor (m) that is seen at a pixel."""
        return Stage(area, state.room).floor(point)

    def place_of(self, part: str, area: QRectF, state: RobotState) -> QPointF | None:
        """The pixel in the middle of a part, as `part_at` names it; None when there is none."""
        stage = Stage(area, state.room)
        robot = stage.spot(state.x, state.y)
        own = {f"{limb.side}_hand": limb.hand for limb in limbs(state)} | {"head": HEAD}
        own = {"body": TOP} if state.figure == TURTLE else own
        if part in own:
            unit = QPointF(robot.u, robot.v) + own[part] * robot.scale
            return stage.origin + unit * stage.scale
        for spot, thing in _placed(stage, state):
            if part in {thing.name, thing.kind}:
                centre = thing_area(thing, spot).center()
                return stage.origin + centre * stage.scale
        return None

    def _paint_room(self, painter: QPainter, stage: Stage, dark: bool) -> None:
        area = stage.area
        ratio = painter.device().devicePixelRatio()
        key = (area.width(), area.height(), ratio, dark)
        if self._room is None or key != self._room_key:
            size = QSize(max(1, round(area.width() * ratio)), max(1, round(area.height() * ratio)))
            self._room = QPixmap(size)
            self._room.setDevicePixelRatio(ratio)
            self._room.fill(QColor("#C4AA87"))  # edges between pixels are mixed with what is below
            room = QPainter(self._room)
            room.setRenderHint(QPainter.RenderHint.Antialiasing)
            room.translate(stage.origin - area.topLeft())
            room.scale(stage.scale, stage.scale)
            paint_room(room, stage.bounds())
            room.end()
            self._room_key = key
        painter.drawPixmap(area.topLeft(), self._room)


def _placed(stage: Stage, state: RobotState) -> list[tuple[Spot, Thing]]:
    """All objects with their places, what is far first; people before the robot as marks on the floor."""
    placed = []
    for thing in state.objects:
        before = thing.kind in {"person", "face"} and thing.x > state.x
        shown = replace(thing, kind="place") if before else thing
        spot = stage.spot(thing.x, thing.y)
        half = thing_area(shown, spot).width() / 2
        inside = min(max(spot.u, half + 4), WIDTH - half - 4)  # what stands at a side wall is seen whole
        placed.append((replace(spot, u=inside), shown))
    return sorted(placed, key=lambda pair: pair[0].v)


def _in_order(things: list[tuple[Spot, Thing]], robot: Spot) -> list[tuple[Spot, Thing | None]]:
    """What is far first; the robot between what is behind and before it."""
    behind: list[tuple[Spot, Thing | None]] = [pair for pair in things if pair[0].v <= robot.v]
    before: list[tuple[Spot, Thing | None]] = [pair for pair in things if pair[0].v > robot.v]
    return [*behind, (robot, None), *before]


def _paint_reach(painter: QPainter, robot: Spot, state: RobotState) -> None:
    painter.save()
    painter.translate(robot.u, robot.v)
    painter.scale(robot.scale, robot.scale)
    reach = QPen(QColor(88, 92, 170, 170), 1.1)
    reach.setStyle(Qt.PenStyle.DashLine)
    reach.setDashPattern([4.0, 4.0])
    painter.setPen(reach)
    painter.setBrush(QColor(92, 88, 170, 46 if not state.moving else 78))
    painter.drawEllipse(QPointF(0, 0), 113, 21)
    painter.restore()


def _part_at(own: QPointF, state: RobotState) -> str | None:
    """The part of the large figure at a point of its own."""
    for limb in limbs(state):
        if _near(own, limb.hand, 11.0):
            return f"{limb.side}_hand"
    return "head" if _near(own, HEAD, 36.0) else None


def _near(point: QPointF, centre: QPointF, radius: float) -> bool:
    away = point - centre
    return QPointF.dotProduct(away, away) <= radius * radius
