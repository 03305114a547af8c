"""Tests of `nep topic info`, `type`, `find` and `delay`."""

from __future__ import annotations

import json

import pytest

import nep
from tests.nep.programs import eventually


@pytest.fixture
def robot(master):
    with nep.node("Pepper") as node, nep.node("page") as other:
        pub = node.new_pub("/odom", "robot/odometry", latched=True)
        pub.publish({"x": 1})
        node.new_pub("/words", "string")
        with other.new_sub("/odom", "robot/odometry") as sub:
            sub.listen(timeout_s=30.0)
            eventually(lambda: {"/odom", "/words"} <= master.view().topics.keys())
            yield pub


def test_info_lists_each_node(robot, type_in):
    code, out, _err = type_in("topic", "info", "/odom")
    assert code == 0
    assert "type: robot/odometry\ncodec: json\nlatched: yes\n" in out
    rows = [line.split() for line in out.splitlines()]
    assert any(row[:2] == ["Pepper", "publishes"] for row in rows)
    assert any(row[:2] == ["page", "subscribes"] for row in rows)


def test_json_info_has_the_node_names(robot, type_in):
    code, out, _err = type_in("topic", "info", "/odom", "--json")
    record = json.loads(out)
    assert code == 0
    assert (record["name"], record["msg_type"], record["codec"]) == ("/odom", "robot/odometry", "json")
    assert [(each["id"], each["node"], each["latched"]) for each in record["publishers"]] == [
        (str(robot.id), "Pepper", True)
    ]
    assert [each["node"] for each in record["subscribers"]] == ["page"]


def test_type_of_a_topic_and_topics_of_a_type_are_printed(robot, type_in):
    assert type_in("topic", "type", "/odom")[:2] == (0, "robot/odometry\n")
    assert json.loads(type_in("topic", "type", "/words", "--json")[1]) == {
        "topic": "/words",
        "msg_type": "string",
        "codec": "string",
    }
    assert type_in("topic", "find", "string")[:2] == (0, "/words\n")
    assert json.loads(type_in("topic", "find", "robot/odometry", "--json")[1]) == ["/odom"]


def test_unknown_topic_or_type_is_reported_with_the_nearest_name(robot, type_in):
    sentence = "no topic '/odmo'; did you mean '/odom'? 'nep topic list' shows all topics"
    for command in ("info", "type"):
        assert type_in("topic", command, "/odmo") == (1, "", f"nep: {sentence}\n")
        assert type_in("topic", command, "bad topic")[0] == 1
    code, out, err = type_in("topic", "find", "strng")
    assert (code, out) == (0, "")
    assert "no topic has the type 'strng'; did you mean 'string'? " in err
    assert json.loads(type_in("topic", "find", "strng", "--json")[1]) == []


def test_delay_reports_the_age_of_arriving_messages(robot, type_in):
    code, out, _err = type_in("topic", "delay", "/odom", "-n", "1", "--json")
    record = json.loads(out)
    assert code == 0
    assert (record["topic"], record["messages"], record["total"]) == ("/odom", 1, 1)
    assert 0.0 < record["min_s"] == record["mean_s"] == record["max_s"] < 60.0
    assert record["std_s"] == 0.0


def test_delay_waits_for_a_topic_without_publisher(master, type_in):
    code, out, err = type_in("topic", "delay", "/t", "--timeout", "0")
    assert code == 1
    assert "'/t' has no publisher yet" in err
    assert "timed out after 0 s while waiting for a message on '/t'" in err
    assert "std dev" in out
