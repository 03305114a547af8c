from __future__ import annotations

import math

import pytest

from app.robots.virtual.room import Room


def test_position_that_overlaps_an_obstacle_is_not_free():
    room = Room()
    assert room.is_free(-0.5, 0.0, 0.27)
    assert not room.is_free(room.people[0].x + 0.3, room.people[0].y, 0.27)
    assert not room.is_free(room.boxes[0].x, room.boxes[0].y, 0.1)
    assert not room.is_free(room.x_max - 0.2, 0.0, 0.27)


def test_ray_ends_at_the_first_obstacle():
    room = Room().with_moved("Aiko", 1.0, 0.0)
    assert room.distance_ahead(-0.5, 0.0, 0.0) == pytest.approx(1.5 - room.people[0].radius)
    assert room.distance_ahead(-0.5, 0.0, 180.0) == pytest.approx(2.0)
    table = room.boxes[0]
    south = table.y - table.depth / 2
    assert room.distance_ahead(table.x, 0.0, 90.0) == pytest.approx(south)
    assert room.distance_ahead(0.0, 1.0, 45.0) == pytest.approx(1.5 * math.sqrt(2))


def test_objects_are_moved_by_name_and_stay_inside_the_room():
    room = Room()
    assert (room.with_moved("ball", 1, 1).balls[0].x, room.with_moved("ball", 1, 1).balls[0].y) == (1, 1)
    assert room.with_moved("Aiko", 99, -99).people[0].x == room.x_max - room.people[0].radius
    assert room.with_moved("person", 1, 1).people[0].y == 1
    assert room.with_moved("piano", 1, 1) == room


def test_robot_pushes_the_ball():
    room = Room().with_moved("ball", 0.0, 0.0)
    pushed = room.with_pushed_ball(-0.3, 0.0, 0.27)
    assert pushed.balls[0].x == pytest.approx(-0.3 + 0.27 + room.balls[0].radius)
    assert room.with_pushed_ball(-1.0, 0.0, 0.27) is room
    assert room.with_pushed_ball(0.0, 0.0, 0.27).balls[0].x == pytest.approx(0.42)


def test_low_points_behind_furniture_are_hidden():
    room = Room()
    table = room.boxes[0]
    behind = (table.x, table.y + table.depth, 0.3)
    assert room.is_hidden((table.x, 0.0, 0.5), behind)
    assert not room.is_hidden((table.x, 0.0, 1.2), (table.x, table.y + table.depth, 1.3))
    assert not room.is_hidden((0.0, 0.0, 0.3), (1.0, 0.0, 0.3))
