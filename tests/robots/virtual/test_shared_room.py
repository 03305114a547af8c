"""Tests of several virtual robots in one room, each with its own driver and node."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

import nep
from app.clock import VirtualClock
from app.robots.driver.driver import Driver
from app.robots.simulated import ROBOT as PEPPER
from app.robots.turtle import ROBOT as TURTLE
from app.robots.virtual.body import RADIUS, Body
from app.robots.virtual.camera import Camera, lens_of
from app.robots.virtual.neighbours import PRESENCE_TIMEOUT_S, Neighbours
from app.robots.virtual.room import OtherRobot, Room
from app.robots.virtual.room_map import TOPIC, RoomMap
from app.robots.virtual.wheels import WheelBody
from tests.robots.conftest import Ears, eventually

OTHER = OtherRobot("Turtle", 0.6, 0.0, 180.0, 0.17, 0.34, "turtle")


def with_other(room: Room, other: OtherRobot = OTHER) -> Room:
    return replace(room.with_moved("Aiko", 2.5, 2.0), other_robots=(other,))


# ---- one body ---------------------------------------------------------------------------------------


def test_robot_stops_in_front_of_another_robot_and_measures_its_distance() -> None:
    body = Body(room=with_other(Room()))
    assert body.distance == pytest.approx(1.1 - RADIUS - OTHER.radius, abs=0.01)
    motion = body.walk(2.0, 0.35)
    while not motion.done:
        body.step(0.1)
    assert motion.is_blocked
    assert body.x <= OTHER.x - OTHER.radius - RADIUS + 0.01
    away = body.walk(-0.3, 0.3)
    while not away.done:
        body.step(0.1)
    assert not away.is_blocked


def test_robot_that_overlaps_another_robot_can_only_drive_away() -> None:
    body = WheelBody(room=with_other(Room()), x=0.65, y=0.0, theta_deg=0.0)
    body.drive(0.3, 0.0)
    body.step(1.0)
    assert body.x > 0.85
    body = WheelBody(room=with_other(Room()), x=0.65, y=0.0, theta_deg=180.0)
    body.drive(0.3, 0.0)
    body.step(1.0)
    assert body.x == 0.65


def test_camera_shows_the_other_robots() -> None:
    body = Body()
    camera = Camera(body.room)
    empty = replace(with_other(Room()), other_robots=())
    alone = camera.picture(empty, lens_of(body)).astype(int)
    for other in (replace(OTHER, x=1.5), OtherRobot("Ada", 1.5, 0.0, 180.0, 0.27, 1.2)):
        seen = camera.picture(with_other(Room(), other), lens_of(body)).astype(int)
        assert (abs(seen - alone).max(axis=2) > 30).mean() > 0.01
    hidden = OtherRobot("Ada", 0.2, 0.0, 180.0, 0.27, 1.2)
    assert with_other(Room(), hidden).is_hidden((-0.5, 0.0, 1.1), (1.5, 0.0, 0.9))


def test_camera_shows_a_robot_of_an_unknown_figure_in_its_size_but_not_as_pepper() -> None:
    body = Body()
    camera = Camera(body.room)
    pepper = OtherRobot("Ada", 1.5, 0.0, 180.0, 0.27, 1.2, "pepper")
    others = (pepper, replace(pepper, figure="forklift"), replace(pepper, figure="crane"))
    of_pepper, of_forklift, of_crane = (
        camera.picture(with_other(Room(), other), lens_of(body)).astype(int) for other in others
    )
    assert (abs(of_forklift - of_pepper).max(axis=2) > 30).mean() > 0.01
    assert (of_forklift == of_crane).all()


# ---- lifted by a person ---------------------------------------------------------------------------


def test_lifted_robot_pauses_its_motion_and_resumes_when_put_down() -> None:
    body = Body(theta_deg=180.0)
    motion = body.walk(0.5, 0.3)
    body.step(0.5)
    body.set_lifted(is_lifted=True)
    x = body.x
    body.step(2.0)
    assert (body.x, motion.done) == (x, False)
    body.carry(0.0, -1.0)
    body.set_lifted(is_lifted=False)
    body.step(5.0)
    assert motion.done
    assert motion.moved == pytest.approx(0.5, abs=0.01)
    assert body.y == -1.0


def test_stop_ends_the_motion_of_a_lifted_robot() -> None:
    body = Body(theta_deg=180.0)
    motion = body.walk(0.5, 0.3)
    body.step(0.5)
    body.set_lifted(is_lifted=True)
    body.halt()
    body.step(0.2)
    assert motion.done
    assert body.is_still


@pytest.mark.parametrize("body", [Body(), WheelBody()], ids=["pepper", "turtle"])
def test_carried_robot_does_not_overlap_walls_or_furniture(body) -> None:
    body.carry(99.0, 0.6)
    assert body.room.x_max - 0.3 < body.x < body.room.x_max
    before = (body.x, body.y)
    table = body.room.thing("table")
    body.carry(table.x, table.y)
    assert body.room.is_free(body.x, body.y, 0.1)
    assert (body.x, body.y) != (table.x, table.y), before


# ---- neighbours --------------------------------------------------------------------------------------


def test_robot_that_stops_publishing_is_removed_from_the_neighbours() -> None:
    time = VirtualClock(advances_alone=False)
    seen = Neighbours("Pepper", time, began_ns=5)
    told: list[dict[str, object]] = []
    Neighbours("Turtle", time, began_ns=1).publish_position(OTHER, lambda message: told.append(dict(message)))
    seen.receive(told[0])
    assert seen.present_robots() == (OTHER,)
    for damaged in ({}, {**told[0], "x": "far"}, {**told[0], "radius": 50}, {**told[0], "robot": "Pepper"}):
        seen.receive(damaged)
    assert seen.present_robots() == (OTHER,)
    time.advance(PRESENCE_TIMEOUT_S + 0.1)
    assert seen.present_robots() == ()


def test_robot_started_later_gives_way_to_an_overlapping_robot() -> None:
    time = VirtualClock(advances_alone=False)
    first, second = Neighbours("A", time, began_ns=1), Neighbours("B", time, began_ns=2)
    first.publish_position(OtherRobot("A", 0, 0, 0, 0.27, 1.2), second.receive)
    second.publish_position(OtherRobot("B", 0, 0.1, 0, 0.27, 1.2), first.receive)
    assert (first.must_give_way(0, 0, 0.27), second.must_give_way(0, 0.1, 0.27)) == (False, True)


# ---- over the network ----------------------------------------------------------------------------------


class Robots:
    """Virtual robots in one network, each with its own node."""

    def __init__(self) -> None:
        self._open: list[Driver | nep.Node] = []
        self.person = self._node("person")
        self.room = self.person.new_pub(TOPIC, "json", latched=True)

    def _node(self, name: str) -> nep.Node:
        self._open.append(nep.node(name, "memory"))
        return self._open[-1]

    def start(self, kind, name: str) -> Ears:
        ears = Ears(self.person, name)
        ears.listen("state")
        ears.listen("distance")
        driver = Driver(kind, name, self._node(name))
        self._open.append(driver)
        driver.start()
        eventually(lambda: ears.heard["state"])
        return ears

    def close(self) -> None:
        for each in reversed(self._open):
            each.close()


@pytest.fixture
def robots() -> Iterator[Robots]:
    made = Robots()
    yield made
    made.close()


def place(ears: Ears, name: str) -> tuple[float, float]:
    """Return the position (x, y) of an object in the newest state of a robot; (99.0, 99.0) if it has none."""
    things = ears.heard["state"][-1]["objects"]
    return next(((t["x"], t["y"]) for t in things if t["name"] == name), (99.0, 99.0))


def test_user_changes_to_the_room_reach_running_robots_and_robots_started_later(
    robots: Robots,
) -> None:
    pepper = robots.start(PEPPER, "Pepper")
    here = RoomMap()
    here.move("ball", 0.3, -1.5)
    here.add("person", 1.8, 1.8)
    here.remove("shelf")
    robots.room.publish(here.message())
    eventually(lambda: place(pepper, "ball") == (0.3, -1.5))
    turtle = robots.start(TURTLE, "Turtle")
    for ears in (pepper, turtle):
        eventually(lambda ears=ears: place(ears, "ball") == (0.3, -1.5))
        eventually(lambda ears=ears: place(ears, "Ben") == (1.8, 1.8))
        eventually(lambda ears=ears: place(ears, "shelf") == (99.0, 99.0))


def test_pushed_ball_moves_for_the_other_robot(robots: Robots) -> None:
    here = RoomMap()
    here.move("ball", -0.5, -0.62)  # in front of the small robot
    robots.room.publish(here.message())
    pepper, turtle = robots.start(PEPPER, "Pepper"), robots.start(TURTLE, "Turtle")
    eventually(lambda: place(pepper, "ball") == place(turtle, "ball") == (-0.5, -0.62))
    turtle.invoke("1", "move", distance=0.3)
    assert turtle.final("1")["state"] == "succeeded"
    eventually(lambda: place(turtle, "ball")[0] > -0.45)
    eventually(lambda: place(pepper, "ball") == place(turtle, "ball"))


def test_distance_sensor_measures_another_robot_until_its_driver_is_closed(robots: Robots) -> None:
    here = RoomMap()
    here.remove("Aiko")
    robots.room.publish(here.message())
    pepper = robots.start(PEPPER, "Pepper")
    eventually(lambda: pepper.heard["distance"] and pepper.heard["distance"][-1]["value"] > 3.0)
    turtle = robots.start(TURTLE, "Turtle")
    world = robots.person.new_pub("/Turtle/world", "json")
    eventually(lambda: world.subscribers)
    world.publish({"move": "robot", "x": 0.5, "y": 0.0})
    eventually(lambda: pepper.heard["distance"][-1]["value"] < 0.7)
    assert turtle.heard["state"][-1]["held"] is False
    robots._open.pop().close()
    eventually(lambda: pepper.heard["distance"][-1]["value"] > 3.0)


def test_second_robot_of_the_same_kind_moves_away_from_the_start_of_the_first(robots: Robots) -> None:
    first, second = robots.start(PEPPER, "Ada"), robots.start(PEPPER, "Bob")

    def gap() -> float:
        one, two = first.heard["state"][-1], second.heard["state"][-1]
        return ((one["x"] - two["x"]) ** 2 + (one["y"] - two["y"]) ** 2) ** 0.5

    eventually(lambda: gap() >= 2 * RADIUS)
    assert (first.heard["state"][-1]["x"], first.heard["state"][-1]["y"]) == (-0.5, 0.0)


def test_reset_moves_robots_to_their_start_and_keeps_objects_of_the_room(robots: Robots) -> None:
    ears = {name: robots.start(PEPPER, name) for name in ("Ada", "Bob")}

    def pose(name: str) -> tuple[float, float, float]:
        state = ears[name].heard["state"][-1]
        return state["x"], state["y"], state["theta_deg"]

    eventually(lambda: math.dist(pose("Bob")[:2], pose("Ada")[:2]) >= 2 * RADIUS)
    first = {name: pose(name) for name in ears}
    worlds = {name: robots.person.new_pub(f"/{name}/world", "json") for name in ears}
    eventually(lambda: all(world.subscribers for world in worlds.values()))

    def is_carried(name: str, x: float, y: float) -> bool:
        worlds[name].publish({"move": "robot", "x": x, "y": y})  # rejected while the other robot is there
        return pose(name) != first[name]

    eventually(lambda: is_carried("Bob", 1.0, 1.0))
    eventually(lambda: is_carried("Ada", *first["Bob"][:2]))
    worlds["Ada"].publish({"move": "ball", "x": 0.3, "y": -1.5})
    eventually(lambda: place(ears["Bob"], "ball") == (0.3, -1.5))
    for world in worlds.values():
        world.publish({"start": ["Ada", "Bob"]})
    eventually(lambda: {name: pose(name) for name in ears} == first)
    assert place(ears["Ada"], "ball") == (0.3, -1.5)
