"""Tests of the conversion of messages to blackboard values and of the start of their ages, without a node."""

from __future__ import annotations

import math

import pytest

import nep
from nep.messages.message import Message, message_kind
from nep.programs.blackboard.ages import age_start
from nep.programs.blackboard.keys import key_text
from nep.programs.blackboard.perception import parse_perception
from nep.programs.blackboard.watch import MessageMapping


def read(reading: MessageMapping, payload: object, topic: str = "/perception/humans") -> dict[str, object]:
    return {
        key_text(found.key): found.value
        for item in reading.items(payload)
        for found in reading.perceived_values(topic, item)
    }


@pytest.mark.parametrize(
    ("payload", "values", "robot"),
    [
        (
            {"primitive": "touched", "input": {"head": 1, "left_hand": 0}, "robot": "Pepper"},
            {"head": 1, "left_hand": 0},
            "Pepper",
        ),
        ({"primitive": "touched", "input": {"head": True}}, {"head": True}, ""),
        ({"primitive": "touched", "input": {}, "robot": 5}, {}, ""),
        ({"primitive": "emotion", "input": {"'happy'": "1"}}, {"happy": 1}, ""),
        ({"primitive": "emotion", "input": {'"sad"': "0.5"}}, {"sad": 0.5}, ""),
        (
            {"primitive": "x", "input": {"a": "nan", "b": "text", "c": None}},
            {"a": "nan", "b": "text", "c": None},
            "",
        ),
        ({"node": "perception", "primitive": "speech", "input": "add", "parameters": {}}, {"add": 1}, ""),
        ({"data": '{"primitive":"touched","input":{"head":1}}'}, {"head": 1}, ""),
    ],
)
def test_rize_perceptions_are_parsed(payload: object, values: object, robot: str) -> None:
    found = parse_perception(payload)
    assert found is not None
    assert (found.values, found.robot) == (values, robot)


@pytest.mark.parametrize(
    "payload",
    [
        None,
        5,
        [],
        "touched",
        {},
        {"primitive": "say", "input": "hello", "options": "none"},  # a command
        {"primitive": "", "input": {"a": 1}},
        {"primitive": 5, "input": {"a": 1}},
        {"primitive": "a", "input": {5: 1}},
        {"primitive": "a", "input": [1]},
        {"data": "no json"},
        {"data": 5},
    ],
)
def test_commands_and_invalid_payloads_are_not_perceptions(payload: object) -> None:
    assert parse_perception(payload) is None


def test_perception_is_stored_at_the_root_or_below_a_key() -> None:
    seen = {"primitive": "touched", "input": {"head": 1}, "robot": "Pepper"}
    assert read(MessageMapping(), seen) == {"touched.head": 1}
    assert read(MessageMapping("{robot}"), seen) == {"Pepper.touched.head": 1}
    assert read(MessageMapping(fields=["robot"]), seen) == {"perception.humans.robot": "Pepper"}
    assert read(MessageMapping(), {**seen, "primitive": "a.b"}) == {"a.b.head": 1}


def test_maps_are_stored_below_the_topic_or_the_key() -> None:
    payload = {"1": {"position": [1, 2], "face": {}}, "count": 1}
    assert read(MessageMapping(), payload) == {
        "perception.humans.1.position": [1, 2],
        "perception.humans.1.face": {},
        "perception.humans.count": 1,
    }
    assert read(MessageMapping("human"), payload)["human.1.position"] == [1, 2]
    assert read(MessageMapping("human"), [1, 2]) == {"human": [1, 2]}
    assert read(MessageMapping(), 5, "/") == {"topic": 5}


def test_fields_are_selected_and_renamed() -> None:
    payload = {"pose": {"x": 1, "y": 2}, "name": "Ada", "rest": [0]}
    assert read(MessageMapping("h", ["pose.x", "name", "none"]), payload) == {"h.pose.x": 1, "h.name": "Ada"}
    assert read(MessageMapping("h", {"pose": "at", "name": "is.called"}), payload) == {
        "h.at.x": 1,
        "h.at.y": 2,
        "h.is.called": "Ada",
    }
    assert read(MessageMapping("h", []), payload) == {}
    assert read(MessageMapping("h", ["x"]), [1]) == {}
    with pytest.raises(ValueError, match="'fields' must be a list"):
        MessageMapping("h", "name")
    with pytest.raises(nep.BadKeyError):
        MessageMapping("h", [""])
    with pytest.raises(nep.BadKeyError):
        MessageMapping("")


def test_key_placeholders_are_filled_from_message_fields() -> None:
    reading = MessageMapping("human.{id}", ["position"])
    assert read(reading, {"id": 7, "position": 1}) == {"human.7.position": 1}
    assert read(reading, [{"id": "a.b", "position": 1}, {"id": 2, "position": 2}]) == {
        r"human.a\.b.position": 1,
        "human.2.position": 2,
    }
    assert read(MessageMapping("x-{a}-{b}"), {"a": 1, "b": "c"}) == {"x-1-c.a": 1, "x-1-c.b": "c"}
    listed = {"humans": [{"id": 1, "position": 1}], "stamp": 5}
    assert read(MessageMapping("human.{id}", ["position"], "humans"), listed) == {"human.1.position": 1}
    for wrong in ({"id": None}, {"id": True}, {"id": ""}, {"id": 1.5}, {"id": []}, {}, 5, [5]):
        with pytest.raises(nep.NepError, match="no name or number in the field 'id'"):
            read(reading, wrong)
    for wrong in ({"humans": 5}, {}, None, []):
        with pytest.raises(nep.NepError, match="no list in the field 'humans'"):
            read(MessageMapping("human.{id}", None, "humans"), wrong)


NOW, WALL_NS = 50.0, 1_800_000_000_000_000_000


@pytest.mark.parametrize(
    ("on_the_way_s", "is_latched", "age_s", "by"),
    [
        (0.5, False, 0.5, "stamp"),
        (0.0, False, 0.0, "stamp"),
        (-0.05, False, 0.0, "stamp"),  # clocks that differ slightly
        (-0.2, False, 0.0, "arrival"),  # stamp in the future
        (-1e6, True, 0.0, "arrival"),
        (9.0, False, 9.0, "stamp"),
        (11.0, False, 0.0, "arrival"),  # sender's clock is behind
        (3600.0, True, 3600.0, "stamp"),  # latched an hour ago
        (None, False, 0.0, "arrival"),  # the original wire has no stamps
    ],
)
def test_age_counts_from_the_time_stamp_or_the_arrival(
    on_the_way_s: float | None, is_latched: bool, age_s: float, by: str
) -> None:
    stamp_ns = None if on_the_way_s is None else WALL_NS - int(on_the_way_s * 1e9)
    message = Message("/x", b"1", "json", "json", stamp_ns=stamp_ns)
    message.kind = message_kind("/x", "json", "json", is_latched=is_latched)
    since, said = age_start(message, NOW, WALL_NS)
    assert NOW - since == pytest.approx(age_s)
    assert said == by


class Walls:
    """Fake clocks: a wall clock that can be set, and a monotonic one."""

    def __init__(self) -> None:
        self.now, self.wall_ns = 100.0, WALL_NS

    def message(self, payload: bytes, publisher: int, age_s: float) -> Message:
        made = Message(
            "/x", payload, "json", "json", stamp_ns=self.wall_ns - int(age_s * 1e9), publisher=publisher
        )
        made.kind = message_kind("/x", "json", "json", is_latched=True)
        return made


def kept(board: nep.Blackboard, message: Message, lives_s: float = math.inf) -> None:
    reading = MessageMapping("v")
    found = tuple(reading.perceived_values(message.topic, message.payload))
    board._store_message(message, found, lives_s)


def test_older_message_of_another_publisher_does_not_overwrite_a_newer_one() -> None:
    walls = Walls()
    board = nep.Blackboard(clock=lambda: walls.now, wall_clock_ns=lambda: walls.wall_ns)
    kept(board, walls.message(b"1", 1, 2.0))
    kept(board, walls.message(b"2", 2, 60.0))
    assert (board["v"], board.outdated) == (1, 1)
    kept(board, walls.message(b"3", 2, 1.0))
    assert board["v"] == 3
    kept(board, walls.message(b"4", 2, 30.0))
    assert board["v"] == 4, "its own messages come in order, whatever its clock does"
    assert board.age_s("v") == pytest.approx(30.0)
    board.put("v", 5)
    kept(board, walls.message(b"6", 1, 0.5))
    assert board["v"] == 6, "what was put has no stamp to compare"


def test_ages_are_unaffected_by_wall_clock_jumps() -> None:
    walls = Walls()
    board = nep.Blackboard(clock=lambda: walls.now, wall_clock_ns=lambda: walls.wall_ns)
    kept(board, walls.message(b"1", 1, 2.0))
    walls.wall_ns -= 3600 * 10**9
    walls.now += 1.0
    assert board.age_s("v") == pytest.approx(3.0)
    message = walls.message(b"2", 1, -3600.0)
    kept(board, message)
    entry = board.entry("v")
    assert entry is not None
    assert (entry.value, entry.age_s, entry.age_by) == (2, 0.0, "arrival")
    assert entry.stamp_ns == message.stamp_ns
    walls.now -= 1000.0
    kept(board, walls.message(b"3", 2, 1.0))
    assert board["v"] == 3, "what is there is of the future now: it wins over nothing"


def test_expired_message_is_not_stored() -> None:
    walls = Walls()
    board = nep.Blackboard(clock=lambda: walls.now, wall_clock_ns=lambda: walls.wall_ns)
    kept(board, walls.message(b"1", 1, 3.0), lives_s=3.0)
    assert ("v" in board, board.outdated) == (False, 1)
    kept(board, walls.message(b"1", 1, 2.9), lives_s=3.0)
    assert "v" in board
    walls.now += 0.2
    assert "v" not in board
