"""Tests of virtual robots: restored at startup, in one room, moved and controlled by the user."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from PySide6.QtCore import QPointF, QRectF

import nep
from app.ui.robot_drawing.room import Stage
from app.ui.robot_drawing.state import RoomBounds
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def test_virtual_robots_are_restored_at_startup_until_removed(start: Callable[..., Studio]) -> None:
    studio = start()
    studio.click("Use the virtual robot")
    studio.says("Pepper ready")
    assert studio.quit() == 0

    again = start()
    again.says("Pepper ready")
    again.kill()

    third = start()
    third.says("Pepper ready")
    third.choose("Robots", "Remove virtual robots")
    until(lambda: not third.children("app.robots.simulated"), "its program has ended")
    assert third.quit() == 0

    assert json.loads((third.home / "settings.json").read_text())["virtual_robots"] == {}


Place = tuple[float, float]


class RoomOnScreen:
    """Positions of robots and things of the room on the screen."""

    def __init__(self, studio: Studio, node: nep.Node) -> None:
        self.studio = studio
        self.states = {
            name: node.new_sub(f"/{name}/state", "json", keep="latest", max_messages=1)
            for name in ("Pepper", "Turtle")
        }
        self._last: dict[str, dict] = {}

    def state(self, name: str) -> dict:
        """Return the newest state of a robot, or an empty dict before its first one."""
        message = self.states[name].receive(0.0)
        if message is not None:
            self._last[name] = message.payload
        return self._last.get(name, {})

    def thing(self, name: str) -> Place:
        """Return the position of a thing in metres as Pepper reports it, or (99, 99) if it is unknown."""
        found = (each for each in self.state("Pepper").get("objects", ()) if each["name"] == name)
        return next(((each["x"], each["y"]) for each in found), (99.0, 99.0))

    def on_screen(self, place: Place, up: float = 0.0) -> Place:
        """Return the pixel of a position on the floor in metres, or of a point above it.

        ``up`` is the height in drawing units, multiplied by the scale of objects at this position.
        """
        x, y, wide, high = self.studio.still(kind="RoomView")["rect"]
        bounds = RoomBounds(-2.5, 3.0, -2.5, 2.5)
        stage = Stage(QRectF(x, y, wide, high), bounds)
        spot = stage.spot_at(*place)
        at = stage.origin + QPointF(spot.u, spot.v - up * spot.scale) * stage.scale
        return at.x(), at.y()

    def drag(self, start: Place, end: Place) -> None:
        """Drag in small steps from one pixel to another."""
        screen = self.studio.screen
        screen.move(*start)
        screen.press()
        screen.glide(*end)
        screen.release()


def test_two_robots_share_a_room_that_the_user_edits(studio: Studio, address: str) -> None:
    studio.click("Use the virtual robot")
    studio.says("Pepper ready")
    studio.choose("Robots", "Use the virtual Turtle")
    studio.says("2 robots")
    with nep.node("watcher", master=address) as node:
        room = RoomOnScreen(studio, node)
        until(lambda: room.state("Pepper") and room.state("Turtle"), "both robots live")
        until(lambda: room.thing("ball") == (1.95, -0.78), "the ball is where it is at first")

        ball = room.on_screen((1.95, -0.78), up=8)
        room.drag(ball, (ball[0] + 60, ball[1]))
        until(lambda: room.thing("ball")[1] > -0.5, "the ball is elsewhere, for the robots too")

        at = room.state("Turtle")
        turtle = room.on_screen((at["x"], at["y"]), up=20)
        studio.screen.move(*turtle)
        studio.screen.press()
        studio.screen.glide(turtle[0] - 40, turtle[1])
        until(lambda: room.state("Turtle").get("held"), "it is held up")
        studio.screen.release()
        until(lambda: not room.state("Turtle")["held"], "it is put down")
        until(lambda: room.state("Turtle")["y"] < at["y"] - 0.2, "it stands elsewhere")

        heard = node.new_sub("/Pepper/heard", "json")
        studio.click("Say something to Pepper")
        studio.find("Say something to Pepper", focus=True)
        studio.screen.type("hello there")
        studio.screen.key("Return")
        until(
            lambda: (message := heard.receive(0.0)) and message.payload == {"word": "hello there"}, "it hears"
        )

        small = studio.still(kind="RoomView")["rect"]
        x, y, _wide, _high = small
        studio.screen.double_click(x + 6, y + 6)
        until(lambda: studio.find(kind="RoomView")["rect"][2] > small[2] * 2, "a double click makes it large")
        studio.screen.key("F11")
        studio.find("Leave full screen")
        studio.click("Stop", kind="StopButton")
        studio.says("stopped (")
        studio.screen.key("Escape")
        until(lambda: studio.find(kind="RoomView")["rect"][2] < small[2] * 1.5, "Esc leaves it")
        ball_at = room.thing("ball")
    assert studio.quit() == 0
    kept = json.loads((studio.home / "settings.json").read_text())["room"]["things"]
    assert next((one["x"], one["y"]) for one in kept if one["name"] == "ball") == ball_at
