"""Tests of the two-wheeled robot: motion, collisions, camera, stop and description."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

import nep
from app import resources
from app.clock import VirtualClock
from app.robots.diffdrive import DIFFDRIVE
from app.robots.driver.driver import Driver
from app.robots.turtle import ROBOT
from app.robots.virtual.camera import Camera
from app.robots.virtual.lens import Lens
from app.robots.virtual.room import Room
from app.robots.virtual.vision import colours_in
from app.robots.virtual.wheels import BRAKING, PRESS_DURATION_S, RADIUS, START_POSE, WheelBody
from tests.robots.conftest import Ears, eventually

WATCHDOG_S = 0.5


def near(value: float, expected: float, within: float) -> bool:
    return abs(value - expected) <= within


# ---- body ------------------------------------------------------------------------------------------


def test_wheels_reach_the_requested_speed_and_brake_within_a_tenth_of_a_second() -> None:
    body = WheelBody(x=0.0, y=-1.0, theta_deg=180.0)
    body.drive(0.5, 0.0)
    body.step(1.0)
    assert near(body.speed, 0.5, 1e-9)
    assert body.x < -0.3
    body.drive(0.0, 0.0)
    body.step(0.5 / BRAKING + 0.02)
    assert body.is_still
    x = body.x
    body.step(1.0)
    assert body.x == x


def test_positive_turn_is_left_and_driving_with_turn_follows_a_circle() -> None:
    body = WheelBody(x=0.0, y=0.6, theta_deg=180.0)
    body.drive(0.0, 90.0)
    body.step(1.0)
    assert -120 < body.theta_deg < -60  # turned left from 180 degrees
    body = WheelBody(x=-1.0, y=-0.6, theta_deg=0.0)
    body.drive(0.3, 60.0)
    body.step(6.3)
    assert math.hypot(body.x + 1.0, body.y + 0.6) < 0.2  # one full circle


@pytest.mark.parametrize(
    ("start", "speed", "side"),
    [
        ((2.5, 1.9, 0.0), 0.4, "front"),
        ((-2.1, -2.0, 0.0), -0.4, "back"),
        ((0.0, 2.2, 45.0), 0.4, "left"),
        ((-1.5, -2.2, -45.0), 0.4, "right"),
    ],
)
def test_robot_stops_at_an_obstacle_and_publishes_the_bumped_side(start, speed, side) -> None:
    body = WheelBody(x=start[0], y=start[1], theta_deg=start[2])
    body.drive(speed, 0.0)
    body.step(3.0)
    assert body.pressed_bumper == side
    assert body.is_still
    assert [(h.name, h.data) for h in body.events] == [("bump", {"side": side})]
    body.drive(-speed, 0.0)
    body.step(0.5)
    assert body.pressed_bumper == ""


def test_robot_pushes_the_ball_and_measures_the_distance_ahead() -> None:
    body = WheelBody(x=1.2, y=-0.78, theta_deg=0.0)
    ball = body.room.balls[0].x
    body.drive(0.5, 0.0)
    body.step(1.8)
    assert body.room.balls[0].x > ball + 0.1
    assert near(body.distance, body.room.x_max - body.x - RADIUS, 0.01)


def test_pressed_bumper_stops_the_robot_and_is_released_after_its_press_duration() -> None:
    body = WheelBody(x=0.0, y=-1.0, theta_deg=180.0)
    body.drive(0.5, 0.0)
    body.step(0.5)
    body.press("left")
    body.step(PRESS_DURATION_S / 2)
    assert (body.pressed_bumper, body.is_still) == ("left", True)
    body.step(PRESS_DURATION_S)
    assert body.pressed_bumper == ""
    assert [(h.name, h.data) for h in body.events] == [("bump", {"side": "left"})]


# ---- camera ----------------------------------------------------------------------------------------


def test_camera_detects_the_red_ball_and_the_blue_shirt() -> None:
    room = Room()
    picture = Camera(room).picture(room, Lens((0.9, -0.78, 0.22), 0.0, -6.0))
    found = colours_in(picture)
    assert found["red"].area > 0.01
    assert abs(found["red"].x) < 0.2
    person = Camera(room).picture(room, Lens((-0.4, 0.1, 0.22), 0.0, -20.0))
    assert "blue" in colours_in(person)


def test_grey_image_and_small_specks_have_no_colour() -> None:
    picture = np.full((240, 320, 3), 120, np.uint8)
    assert colours_in(picture) == {}
    cv2.circle(picture, (160, 120), 3, (0, 0, 230), -1)
    assert colours_in(picture) == {}
    cv2.circle(picture, (300, 120), 15, (0, 0, 230), -1)
    seen = colours_in(picture)["red"]
    assert (seen.name, round(seen.x, 1)) == ("red", 0.9)


# ---- description -----------------------------------------------------------------------------------


def test_shipped_thing_model_matches_the_driver() -> None:
    kept = json.loads(resources.path("robots", "diffdrive.tm.jsonld").read_text(encoding="utf-8"))
    for part in ("properties", "actions", "events"):
        for described in kept[part].values():
            described.pop("rb:ros", None)
    assert kept == json.loads(json.dumps(DIFFDRIVE.thing_model))
    assert ROBOT.thing_model["actions"] == DIFFDRIVE.thing_model["actions"]


# ---- whole robot -----------------------------------------------------------------------------------


@pytest.fixture
def turtle(node: nep.Node):
    with nep.node("listener", "memory") as other, Driver(ROBOT, "Turtle", node) as driver:
        ears = Ears(other, "Turtle")
        for leaf in ("pose", "state", "bump", "colour", "bumper", "battery", "distance"):
            ears.listen(leaf)
        eventually(lambda: ears.heard["state"])
        yield driver.body, ears


@pytest.fixture
def watched_turtle(node: nep.Node, clock: VirtualClock):
    """Turtle whose watchdog has the clock of the test, its listener, and the clock."""
    with nep.node("listener", "memory") as other, Driver(ROBOT, "Turtle", node, clock=clock) as driver:
        assert driver.robot.safe_stop.watchdog_s == WATCHDOG_S
        ears = Ears(other, "Turtle")
        ears.listen("state")
        eventually(lambda: ears.heard["state"] or clock.advance(0.01))
        yield driver.body, ears, clock


def pose(ears: Ears) -> tuple[float, float, float]:
    told = ears.heard["pose"][-1]
    return told["x"], told["y"], told["theta"]


def test_robot_moves_turns_and_drives_to_a_position(turtle) -> None:
    _, ears = turtle
    x, y, theta = START_POSE
    ears.invoke("1", "move", distance=0.3)
    assert near(ears.final("1")["output"]["moved"], 0.3, 0.05)
    ears.invoke("2", "turn", angle=-35)
    assert ears.final("2")["state"] == "succeeded"
    eventually(lambda: near(pose(ears)[2], theta - 35, 6))
    ears.invoke("3", "go_to", x=x, y=y + 0.2)
    assert ears.final("3")["state"] == "succeeded"
    eventually(lambda: near(pose(ears)[0], x, 0.06) and near(pose(ears)[1], y + 0.2, 0.06))
    told = [a["feedback"] for a in ears.answers("1") if a["feedback"]]
    assert told
    assert set(told[0]) == {"moved", "to_go"}
    ears.invoke("4", "go_to", x=pose(ears)[0], y=pose(ears)[1])
    assert ears.final("4")["state"] == "succeeded"  # already at the target


def test_carrying_the_robot_does_not_count_as_moved_distance(turtle) -> None:
    body, ears = turtle
    ears.invoke("1", "move", distance=0.4)
    eventually(lambda: ears.answers("1") and any(a["feedback"] for a in ears.answers("1")))
    body.wheels.apply_change({"hold": True})
    body.wheels.apply_change({"move": "robot", "x": 0.5, "y": 1.2})
    body.wheels.apply_change({"hold": False})
    assert near(ears.final("1")["output"]["moved"], 0.4, 0.05)
    eventually(lambda: math.hypot(pose(ears)[0] - 0.5, pose(ears)[1] - 1.2) > 0.15)


def test_triggered_colour_event_is_validated_against_the_description(turtle) -> None:
    body, ears = turtle
    for wrong in ({"name": "pink"}, {"name": "red", "area": 3}, {"name": "red", "x": "left"}, {}):
        body.wheels.apply_change({"happen": "colour", **wrong})
    body.wheels.apply_change({"happen": "bump", "side": "top"})
    body.wheels.apply_change({"happen": "colour", "name": "green", "area": 0.5})
    eventually(lambda: {"name": "green", "x": 0.0, "area": 0.5} in ears.heard["colour"])
    assert all(told["name"] != "pink" and told["area"] <= 1 for told in ears.heard["colour"])
    assert ears.heard["bump"] == []


def test_missing_heartbeat_of_the_program_stops_a_driving_robot(watched_turtle) -> None:
    body, ears, clock = watched_turtle
    ears.invoke("1", "drive", program="test", speed=-0.2, turn=30)
    assert ears.final("1")["state"] == "succeeded"
    clock.advance(0.1)
    assert not body.wheels.is_still()
    clock.advance(WATCHDOG_S + 0.1)
    eventually(lambda: body.wheels.is_still() or clock.advance(0.005))  # no heartbeat was sent
    assert ears.heard["state"][-1]["figure"] == "turtle"


def test_robot_keeps_driving_while_its_program_sends_heartbeats_until_stopped(watched_turtle) -> None:
    body, ears, clock = watched_turtle
    ears.invoke("1", "drive", program="test", speed=0.0, turn=60)
    ears.final("1")
    clock.advance(0.1)
    for number in range(5):
        clock.advance(0.6 * WATCHDOG_S)
        ears.command(op="alive", id="a", **{"from": "test"})
        ears.invoke(f"l{number}", "light")
        ears.final(f"l{number}")  # the heartbeat was processed before
    assert not body.wheels.is_still()
    ears.command(id="s", op="stop")
    eventually(lambda: ears.states("s") or clock.advance(0.005))
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert body.wheels.is_still()


def test_stop_during_a_move_ends_the_move_immediately(turtle) -> None:
    body, ears = turtle
    ears.invoke("1", "move", distance=1.0)
    eventually(lambda: not body.wheels.is_still())
    ears.command(id="s", op="stop")
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert body.wheels.is_still()
    assert ears.final("1")["state"] == "canceled"
    where = pose(ears)
    seen = len(ears.heard["pose"])
    eventually(lambda: len(ears.heard["pose"]) > seen + 3)
    assert pose(ears) == where


def test_go_to_a_position_inside_an_obstacle_fails_and_publishes_a_bump_event(turtle) -> None:
    _, ears = turtle
    ears.invoke("1", "go_to", x=0.3, y=-2.2)  # inside the shelf
    ended = ears.final("1")
    assert (ended["state"], ended["error"]) == ("failed", "go_to: something is in the way")
    assert ears.heard["bump"]
    eventually(lambda: any(told["value"] for told in ears.heard["bumper"]))


def test_stop_fails_while_the_wheels_keep_turning(node: nep.Node) -> None:
    class Stubborn(ROBOT.body):  # type: ignore[name-defined, misc]
        def __init__(self, link: object) -> None:
            super().__init__(link)
            self.wheels.is_still = lambda: False

    kind = replace(ROBOT, body=Stubborn)
    with nep.node("listener", "memory") as other, Driver(kind, "Turtle", node):
        ears = Ears(other, "Turtle")
        ears.command(id="s", op="stop")
        ended = ears.final("s", "stop")
        assert ended["state"] == "failed"
        assert "may still move" in ended["error"]
