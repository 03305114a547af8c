"""Tests of the session's room: shared with robots and other Studios, restored at the next start."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from app.core.network.mailbox import Batch
from app.core.network.watches import Watches
from app.core.robots.room import SAVE_DELAY_S, SessionRoom
from app.core.storage.settings import Settings
from app.robots.virtual.room import Room
from app.robots.virtual.room_map import TOPIC, RoomMap
from nep.protocol.graph_view import GraphView, TopicInfo


class Studio:
    """Room with a clock that the test sets, and the messages that it publishes."""

    def __init__(self, folder: Path) -> None:
        self.now = 100.0
        self.watched: list[str] = []
        self.node = nep.node("studio", "memory")
        self.ears = self.node.new_sub(TOPIC, "json")
        watches = Watches(self.watched.append, self.watched.remove, lambda _topic: None)
        self.room = SessionRoom(
            Settings(folder), watches, lambda _what, job: job(self.node), lambda: self.now
        )

    def join(self) -> None:
        self.room.update(GraphView(1, 2, topics={TOPIC: TopicInfo(TOPIC, "json", "json")}))
        self.room.tick()

    def hear(self, other: RoomMap) -> None:
        with nep.node("robot", "memory") as node, node.new_sub("/told", "json") as heard:
            node.new_pub("/told", "json").publish(other.message())
            message = heard.receive(60.0)
        assert message is not None
        self.room.add_messages({TOPIC: Batch([message], 0)})

    def told(self) -> list[object]:
        found = []
        while (message := self.ears.receive(0.0)) is not None:
            found.append(message.payload)
        return found

    def later(self, seconds: float) -> None:
        self.room.tick()
        self.now += seconds
        self.room.tick()

    def close(self) -> None:
        self.room.close()
        self.node.close()


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[Studio]:
    made = Studio(tmp_path)
    yield made
    made.close()


def room_of(message: object) -> Room:
    found = RoomMap()
    found.merge(message)  # type: ignore[arg-type]
    return found.room()


def test_room_is_joined_when_a_robot_appears_and_publishes_its_state(studio: Studio, tmp_path: Path) -> None:
    studio.room.update(GraphView(1, 1))
    assert studio.watched == []
    studio.room.move("ball", 0.5, 0.5, {})
    studio.join()
    assert studio.watched == [TOPIC]
    assert room_of(studio.told()[-1]).thing("ball").x == 0.5


def test_room_is_restored_at_next_start(studio: Studio, tmp_path: Path) -> None:
    studio.room.move("table", 0.5, 0.5, {})
    studio.room.add("person", 1.5, 1.5)
    studio.later(SAVE_DELAY_S / 2)
    assert Studio(tmp_path).room.room == Room()  # saving is debounced during a drag
    studio.later(SAVE_DELAY_S)
    studio.later(SAVE_DELAY_S)
    again = Studio(tmp_path)
    assert again.room.room == studio.room.room
    again.close()


def test_room_change_by_a_robot_is_republished_for_late_subscribers(studio: Studio) -> None:
    studio.join()
    robot = RoomMap()
    robot.move("ball", -1.0, -1.5)
    studio.told()
    studio.hear(robot)
    assert studio.room.room.thing("ball").x == -1.0
    studio.later(0.1)
    assert studio.told() == []
    studio.later(SAVE_DELAY_S)
    assert room_of(studio.told()[-1]).thing("ball").x == -1.0


def test_furniture_and_people_cannot_be_placed_on_a_robot(studio: Studio) -> None:
    robots = {"Pepper": (0.0, 0.0, 0.27)}
    before = studio.room.room
    assert not studio.room.move("table", 0.1, 0.1, robots)
    assert not studio.room.move("Aiko", 0.1, 0.1, robots)
    assert studio.room.room == before
    assert studio.room.move("table", 1.5, 1.5, robots)
    assert studio.room.move("ball", 0.1, 0.1, robots)  # a ball rolls away from the robot


@pytest.mark.parametrize("kept", [None, [], {"things": 3}, {"things": [{"name": "ball"}]}])
def test_damaged_room_settings_give_the_default_room(tmp_path: Path, kept: object) -> None:
    (tmp_path / "settings.json").write_text(json.dumps({"room": kept}))
    studio = Studio(tmp_path)
    assert studio.room.room == Room()
    studio.close()
