from __future__ import annotations

from dataclasses import dataclass, field

from app.robots.description.description import Robot
from app.ui.panels.behaviour.live_values import live_words
from tests.blocks.samples import robot

SENSORS = [("Pepper", "battery"), ("Pepper", "pose"), ("Pepper", "sees_face"), ("NAO", "battery")]


@dataclass
class Link:
    robot: Robot = field(default_factory=robot)
    values: dict[str, object] = field(default_factory=dict)
    state: str = "ready"
    connected: bool = True


class Fleet:
    def __init__(self, **links: Link) -> None:
        self._links = links

    def link(self, name: str) -> Link | None:
        return self._links.get(name)


TOLD = {"battery": 84, "pose": {"x": 1.25, "y": None}, "sees_face": True}


def test_sensors_and_their_fields_have_words_with_units() -> None:
    words, old = live_words(Fleet(Pepper=Link(values=TOLD)), SENSORS)
    assert words == {"Pepper/battery": "84 %", "Pepper/pose/x": "1.25 m", "Pepper/sees_face": "yes"}
    assert old == set()


def test_what_is_not_told_yet_is_blank() -> None:
    assert live_words(Fleet(Pepper=Link()), [("Pepper", "battery")]) == ({"Pepper/battery": ""}, set())


def test_a_robot_that_fell_silent_is_old_and_one_that_is_away_says_nothing() -> None:
    _, old = live_words(Fleet(Pepper=Link(values=TOLD, state="silent")), SENSORS)
    assert old == {"Pepper/battery", "Pepper/pose/x", "Pepper/sees_face"}
    assert live_words(Fleet(Pepper=Link(values=TOLD, connected=False)), SENSORS) == ({}, set())
