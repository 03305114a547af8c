"""Test of a virtual robot that is added in two files: started, commanded, stopped, drawn and offered."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QColor, QImage, QPainter

import nep
from app.core.robots.last_robots import LastRobots
from app.core.robots.launcher import Launcher
from app.core.storage.settings import Settings
from app.robots import virtual_models as models_module
from app.robots.description.description import parse
from app.robots.virtual_models import virtual_models
from app.ui.robot_drawing import figure as figure_module
from app.ui.robot_drawing.scene import RobotDrawing
from app.ui.robot_drawing.state import RobotState
from app.ui.shell.commands.table import COMMANDS, added_robot_commands
from nep.masters.master import Master
from tests.blocks.fakes import until

DRIVER = '''
"""Virtual cube that slides along a line."""

import sys
from typing import Annotated

from app.robots.kit import Call, Kind, Link, Range, action, main, safe_stop

VIRTUAL_ROBOT = ("cube", "Cube")


class Cube:
    def __init__(self, link: Link) -> None:
        self.link, self.x, self.is_moving = link, 0.0, False
        self.publish()

    def publish(self) -> None:
        self.link.publish_value("state", {"figure": "cube", "x": self.x, "y": 0.0, "moving": self.is_moving})

    @action("slide by %metres m", "Movement", "move", uses=("base",), risk="moves")
    def slide(self, call: Call, metres: Annotated[float, Range(-1, 1, unit="m")] = 0.5) -> dict[str, float]:
        """Slide along the line."""
        self.x += metres
        self.publish()
        return {"x": self.x}

    @action("slide forever", "Movement", "infinity", uses=("base",), risk="moves", timeout_s=100)
    def slide_forever(self, call: Call) -> None:
        """Slide until somebody presses Stop."""
        self.is_moving = True
        self.publish()
        try:
            call.wait(100)
        finally:
            self.is_moving = False
            self.publish()

    @safe_stop()
    def stop(self) -> None:
        """Stand still."""
        self.is_moving = False


ROBOT = Kind("cube", "Cube", Cube, virtual=True, kinds=("mobile",))

if __name__ == "__main__":
    sys.exit(main(ROBOT))
'''
DRAWING = '''
"""Painter of the virtual cube."""

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QColor, QPainter

from app.ui.robot_drawing.figure import RobotFigure
from app.ui.robot_drawing.state import RobotState


def paint_cube(p: QPainter, state: RobotState) -> None:
    p.fillRect(QRectF(-20, -40, 40, 40), QColor("#FF00FF"))


FIGURE = RobotFigure(
    "cube", paint_cube, QRectF(-20, -40, 40, 40),
    bubble_at=QPointF(0, -40), body_at=QPointF(0, -20), radius_m=0.2,
)
'''
START = """
import app.robots
app.robots.__path__.append({folder!r})
"""
"""``sitecustomize`` of the robot's process, which finds the added file like one in `app.robots`."""
PLACES = {"app.robots": "cube", "app.ui.robot_drawing": "cube_drawing"}


def forget() -> None:
    virtual_models.cache_clear()
    figure_module._figures.cache_clear()


@pytest.fixture
def added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Add the two files, also in processes that are started."""
    folders = {package: tmp_path / package for package in PLACES}
    for package, folder in folders.items():
        folder.mkdir()
        importlib.import_module(package).__path__.append(str(folder))
    (folders["app.robots"] / "cube.py").write_text(DRIVER, "utf-8")
    (folders["app.ui.robot_drawing"] / "cube_drawing.py").write_text(DRAWING, "utf-8")
    start = tmp_path / "start"
    start.mkdir()
    (start / "sitecustomize.py").write_text(START.format(folder=str(folders["app.robots"])), "utf-8")
    root = Path(models_module.__file__).parents[2]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(start), str(root)]))
    forget()
    yield
    for package, folder in folders.items():
        home = importlib.import_module(package)
        home.__path__.remove(str(folder))
        sys.modules.pop(f"{package}.{PLACES[package]}", None)
    forget()


def picture(state: RobotState) -> tuple[QImage, RobotDrawing, QRectF]:
    area = QRectF(0, 0, 640, 480)
    image = QImage(640, 480, QImage.Format.Format_RGB32)
    drawing = RobotDrawing()
    painter = QPainter(image)
    drawing.paint(painter, area, state)
    painter.end()
    return image, drawing, area


def test_virtual_robot_in_two_files_is_started_commanded_stopped_and_drawn(
    qapp: object, added: None, master: Master
) -> None:
    failures: list[object] = []
    launcher = Launcher(master.address, failures.append)
    launcher.start_virtual_robot("Cube", "cube")
    states: list[RobotState] = []
    try:
        with nep.node("asker", master=master.address) as asker:
            described = asker.new_sub("/Cube/description", "robot/description")
            seen = asker.new_sub("/Cube/state", "json")
            arrived, description = described.listen(timeout_s=60.0)
            assert arrived, failures
            robot = parse(description)
            assert (robot.model, robot.virtual, robot.safe_stop is not None) == ("cube", True, True)
            answers = asker.new_sub(robot.topics.reply, "robot/answer")
            commands = asker.new_pub(robot.topics.command, "robot/command")

            def answer(id: str, *awaited: str) -> dict[str, object]:
                while True:
                    arrived, reply = answers.listen(timeout_s=60.0)
                    assert arrived, "the robot didn't reply"
                    if reply["id"] == id and reply["state"] in awaited:
                        return reply

            def newest() -> RobotState:
                while (message := seen.receive(0.0)) is not None:
                    states.append(RobotState.parse(message.payload))
                return states[-1] if states else RobotState()

            until(lambda: commands.subscribers == 1)  # a command sent earlier would be lost
            told = {"op": "invoke", "from": "me"}
            commands.publish({**told, "id": "1", "action": "slide", "input": {"metres": 0.5}})
            assert answer("1", "succeeded", "failed")["output"] == {"x": 0.5}
            until(lambda: newest().x == 0.5)
            commands.publish({**told, "id": "2", "action": "slide_forever", "input": {}})
            answer("2", "running")
            commands.publish({"op": "stop", "from": "me", "id": "3"})
            assert answer("2", "canceled", "failed")["state"] == "canceled"
            until(lambda: len(states) > 1 and not newest().is_moving)
    finally:
        launcher.close()
    assert failures == []

    image, drawing, area = picture(states[-1])
    body = drawing.point_of("body", area, states[-1])
    assert body is not None
    assert image.pixelColor(body.toPoint()) == QColor("#FF00FF")
    assert drawing.part_at(body, area, states[-1]) == "body"
    assert drawing.bumper_side_at(body, area, "body", states[-1]) is None
    assert drawing.part_at(QPointF(2, 2), area, states[-1]) is None


def test_added_virtual_robot_is_offered_and_restarted(added: None, tmp_path: Path) -> None:
    (command,) = added_robot_commands()
    assert (command.label, command.menu) == ("Use the virtual Cube", "Robots")

    class Starter:
        def __init__(self) -> None:
            self.models_by_name: dict[str, str] = {}

        def start_virtual_robot(self, name: str = "", model: str = "") -> None:
            self.models_by_name[name] = model

    settings, starter = Settings(tmp_path / "home"), Starter()
    settings.virtual_robots = {"Cube": "cube", "Tower": "tower"}
    LastRobots(settings).start(starter)
    assert starter.models_by_name == {"Cube": "cube"}


def test_models_of_own_virtual_robots_are_those_of_their_drivers() -> None:
    for each in virtual_models().values():
        kind = importlib.import_module(each.module).ROBOT
        assert (kind.model, kind.title, kind.virtual) == (each.model, each.name, True)
    assert {each.model for each in virtual_models().values()} >= {"pepper", "diffdrive"}
    assert {"robots.virtual", "robots.turtle"} <= {command.id for command in COMMANDS}
