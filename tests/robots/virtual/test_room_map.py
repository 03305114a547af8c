"""Tests of the room map: merging is independent of message order; damaged messages change nothing."""

from __future__ import annotations

import itertools
import json
import random

import pytest

from app.robots.virtual.room import Room
from app.robots.virtual.room_map import KINDS, MAX_OBJECTS, MAX_PER_KIND, RoomMap


def clock(start: int = 1000):
    return itertools.count(start).__next__


def test_empty_map_is_the_default_room() -> None:
    assert RoomMap().room() == Room()


def test_room_changes_are_merged_from_json_messages() -> None:
    one, other = RoomMap(clock_ns=clock()), RoomMap(clock_ns=clock())
    one.move("ball", 0.5, 1.0)
    one.add("person", -1.0, -1.0)
    one.remove("shelf")
    one.move("marker 7", -2.4, 0.3)
    assert other.merge(json.loads(json.dumps(one.message())))
    assert other.room() == one.room() != Room()
    assert [person.name for person in other.room().people] == ["Aiko", "Ben"]
    assert other.room().markers[0].facing_deg == 0.0  # attached to the nearest wall
    assert not other.merge(one.message())


def test_maps_converge_for_any_order_of_messages() -> None:
    chance = random.Random(7)
    maps = [RoomMap(clock_ns=lambda: chance.randrange(5)) for _ in range(3)]  # clocks with many equal times
    told = []
    for _ in range(60):
        one = chance.choice(maps)
        match chance.randrange(4):
            case 0:
                one.add(chance.choice(KINDS), chance.uniform(-2, 2), chance.uniform(-2, 2))
            case 1:
                one.remove(chance.choice(["ball", "ball 2", "Aiko", "table"]))
            case 2:
                one.reset()
            case _:
                one.move(chance.choice(["ball", "Aiko", "shelf"]), chance.uniform(-2, 2), 0.0)
        told.append(one.message())
    for each in maps:
        for message in chance.sample(told, len(told)):
            each.merge(message)
    assert maps[0].room() == maps[1].room() == maps[2].room()


def test_last_writer_wins_even_if_a_clock_goes_backwards() -> None:
    one, other = RoomMap(clock_ns=clock(10_000)), RoomMap(clock_ns=lambda: 1)
    one.move("ball", 1.0, 1.0)
    other.merge(one.message())
    other.move("ball", 2.0, 2.0)
    one.merge(other.message())
    assert (one.room().balls[0].x, other.room().balls[0].x) == (2.0, 2.0)


def test_objects_stay_inside_and_their_number_per_kind_is_limited() -> None:
    made = RoomMap()
    assert made.move("table", 99.0, -99.0)
    table = made.room().thing("table")
    assert (table.x, table.y) == (3.0 - table.width / 2, -2.5 + table.depth / 2)
    names = [made.add("ball", 0.0, 0.0) for _ in range(MAX_PER_KIND + 2)]
    assert names[-3:] == [None, None, None]
    assert made.add("piano", 0.0, 0.0) is None
    assert not made.move("piano", 1.0, 1.0)
    made.reset()
    assert made.room() == Room()


@pytest.mark.parametrize(
    "things",
    [
        None, "ball", [1, None], [{}], [{"name": "ball"}],
        [{"name": "ball", "kind": "ball", "x": float("nan"), "y": 0, "changed_ns": 9}],
        [{"name": "ball", "kind": "ball", "x": True, "y": 0, "changed_ns": 9}],
        [{"name": "ball", "kind": "ball", "x": 1, "y": 0, "changed_ns": -1}],
        [{"name": "ball", "kind": "ball", "x": 1, "y": 0, "changed_ns": 1 << 70}],
        [{"name": "ball", "kind": "table", "x": 1, "y": 0, "changed_ns": 9}],
        [{"name": "x" * 50, "kind": "ball", "x": 1, "y": 0, "changed_ns": 9}],
        [{"name": "a", "kind": "piano", "x": 1, "y": 0, "changed_ns": 9}],
    ],
    ids=str,
)  # fmt: skip
def test_damaged_messages_do_not_change_the_room_map(things) -> None:
    made = RoomMap()
    assert not made.merge({"things": things})
    assert made.room() == Room()


def test_number_of_merged_objects_is_limited() -> None:
    made = RoomMap()
    for start in range(0, 1000, 10):
        flood = [
            {"name": f"ball {n}", "kind": "ball", "x": 0, "y": 0, "changed_ns": 5}
            for n in range(start, start + 9)
        ]
        made.merge({"things": flood})
    assert len(made.message()["things"]) == MAX_OBJECTS
