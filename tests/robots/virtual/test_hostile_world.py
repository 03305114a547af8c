"""Tests that virtual robots keep running, see and stop after any hostile message on the world topics."""

from __future__ import annotations

import threading

import nep
from app.robots.driver.driver import Driver
from app.robots.turtle import ROBOT as TURTLE
from app.robots.virtual.room_map import ROBOTS_TOPIC, TOPIC
from tests import hostile
from tests.robots.conftest import Ears, eventually
from tests.robots.virtual.test_simulated import Pepper, pepper

__all__ = ["pepper"]

THING = {"name": "ball", "kind": "ball", "x": 1.0, "y": 1.0, "changed_ns": 2**62, "gone": False}
NEIGHBOUR = {
    "robot": "a", "figure": "f", "x": 1, "y": 0.5, "theta_deg": 9, "radius": 0.2, "height": 1, "began_ns": 5,
}  # fmt: skip
WORLD: list[hostile.Message] = [
    {"move": "ball", "x": 1.0, "y": 1.0},
    {"move": "robot", "x": 1.0, "y": 1.0},
    {"touch": "head", "down": True, "hold": False, "say": "hello"},
    {"happen": "heard", "word": "hello"},
    {"happen": "face_found", "name": "x"},
    {"happen": "colour", "x": 0.5, "area": 0.5},
]


def test_virtual_robots_survive_every_hostile_world(pepper: Pepper, node: nep.Node, caplog) -> None:
    with Driver(TURTLE, "Turtle", node) as driver:
        turtle = Ears(node, "Turtle")
        threads = {each for each in threading.enumerate() if each.name.startswith(("Pepper", "Turtle"))}
        topics: dict[str, list[hostile.Message]] = {
            "/Pepper/world": WORLD,
            "/Turtle/world": WORLD,
            TOPIC: [{"things": [THING]}],
            ROBOTS_TOPIC: [NEIGHBOUR],
        }
        for topic, messages in topics.items():
            publisher = node.new_pub(topic, "json")
            for payload in hostile.payloads(*messages):
                publisher.publish_bytes(payload)
        for ears in (pepper, turtle):
            ears.command(id="s", op="stop")
            assert ears.final("s", "stop")["state"] == "succeeded"
        node.new_pub("/Pepper/world", "json").publish({"reset": True})
        seen = len(pepper.heard["state"])
        eventually(lambda: len(pepper.heard["state"]) > seen + 3)
        pepper.invoke("1", "turn", angle=5, speed=90)
        assert pepper.final("1")["state"] == "succeeded"
        assert driver.body is not None
        assert [each.name for each in threads if not each.is_alive()] == []
    assert [record.getMessage() for record in caplog.records if record.exc_info] == []
