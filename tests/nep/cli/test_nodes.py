"""Tests of `nep node info`."""

from __future__ import annotations

import json

import pytest

import nep
from tests.nep.programs import eventually


@pytest.fixture
def robot(master):
    with nep.node("Pepper") as node, nep.node("Pepper") as twin:
        node.new_pub("/odom", "robot/odometry")
        node.new_sub("/cmd", "robot/command")
        node.new_server("/arm/move", lambda request: request, threads=1)
        twin.new_client("/arm/move")
        eventually(lambda: {"/odom", "/cmd"} <= master.view().topics.keys())
        eventually(lambda: bool(master.view().services.get("/arm/move", nep.ServiceInfo("", "")).clients))
        yield node


def test_info_shows_the_topics_and_services_of_a_node_with_their_types(robot, type_in):
    code, out, _err = type_in("node", "info", robot.id)
    assert code == 0
    assert out.startswith(f"node: Pepper\nid: {robot.id}\n")
    for part in (
        "publishes:\n  /odom: robot/odometry",
        "subscribes:\n  /cmd: robot/command",
        "serves:\n  /arm/move: any",
    ):
        assert part in out


def test_info_by_name_lists_every_node_of_that_name(robot, type_in):
    records = json.loads(type_in("node", "info", "Pepper", "--json")[1])
    mine = next(each for each in records if each["id"] == robot.id)
    assert len(records) == 2
    assert mine["publishes"] == {"/odom": "robot/odometry"}


def test_unknown_node_is_an_error_with_the_nearest_name(robot, type_in):
    code, out, err = type_in("node", "info", "Peper\x1b")
    assert (code, out) == (1, "")
    assert "did you mean 'Pepper'?" in err
    assert "\x1b" not in err
