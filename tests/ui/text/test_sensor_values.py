from __future__ import annotations

from dataclasses import dataclass, field

from app.robots.description.description import Robot
from app.ui.panels.build.behaviour.live_values import sensor_texts
from tests.blocks.samples import robot

SENSORS = [("Pepper", "battery"), ("Pepper", "pose"), ("Pepper", "sees_face"), ("NAO", "battery")]


@dataclass
class Link:
    robot: Robot = field(default_factory=robot)
    values: dict[str, object] = field(default_factory=dict)
    state: str = "ready"
    is_connected: bool = True


class Fleet:
    def __init__(self, **links: Link) -> None:
        self._links = links

    def link(self, name: str) -> Link | None:
        return self._links.get(name)


TOLD = {"battery": 84, "pose": {"x": 1.25, "y": None}, "sees_face": True}


def test_sensors_and_their_fields_are_formatted_with_units() -> None:
    words, old = sensor_texts(Fleet(Pepper=Link(values=TOLD)), SENSORS)
    assert words == {"Pepper/battery": "84 %", "Pepper/pose/x": "1.25 m", "Pepper/sees_face": "yes"}
    assert old == set()


def test_unknown_sensor_values_are_blank() -> None:
    assert sensor_texts(Fleet(Pepper=Link()), [("Pepper", "battery")]) == ({"Pepper/battery": ""}, set())


def test_values_of_an_unresponsive_robot_are_stale_and_of_a_disconnected_robot_absent() -> None:
    _, old = sensor_texts(Fleet(Pepper=Link(values=TOLD, state="silent")), SENSORS)
    assert old == {"Pepper/battery", "Pepper/pose/x", "Pepper/sees_face"}
    assert sensor_texts(Fleet(Pepper=Link(values=TOLD, is_connected=False)), SENSORS) == ({}, set())
