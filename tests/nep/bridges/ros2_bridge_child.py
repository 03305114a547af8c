"""Tests of bridges with ROS 2 nodes. Run by test_ros2_bridge.py in a separate network namespace."""

from __future__ import annotations

import os

import pytest

import nep
from nep.programs.bridges import Bridge, BridgeConfiguration, BridgeTopic, TopicEnd, side_configuration
from tests.nep.bridges.joined import nets, route, settled, silent, taken, topic
from tests.nep.programs import eventually, running

pytestmark = pytest.mark.skipif("NEP_TEST_ROS2" not in os.environ, reason="needs a network of its own")

ROBOT = """
import sys, nep
with nep.node("robot", "ros2") as robot:
    drive = robot.new_sub("/cmd_vel", "geometry_msgs/msg/Twist")
    kept = robot.new_pub("/robot_description", "std_msgs/msg/String", latched=True)
    kept.publish({"data": "<robot/>"})
    odom = robot.new_pub("/odom", "geometry_msgs/msg/TwistStamped")
    scan = robot.new_pub("/scan", "sensor_msgs/msg/LaserScan", qos="sensor")
    print("ready", flush=True)
    for line in sys.stdin:
        what = line.strip()
        if what == "odom":
            odom.publish({"twist": {"linear": {"x": 1.5}}})
        elif what == "scan":
            scan.publish({"ranges": [1.0, 2.0]})
        else:
            print(drive.listen(timeout_s=60.0)[1]["linear"]["x"], flush=True)
"""


def ask(robot, what):
    robot.say(what)
    return robot.line()


def test_bridge_forwards_topics_between_nep_and_a_ros_2_robot():
    with nets("zeromq") as (a,), running(ROBOT) as robot:
        assert robot.line() == "ready"
        topics = (
            topic("/cmd_vel"),
            topic("odom", "/odom"),
            topic("/robot_description"),
            BridgeTopic(TopicEnd("/scan"), TopicEnd("/scan", qos="sensor"), "b->a"),
        )
        with Bridge(
            BridgeConfiguration(
                "lab", side_configuration("zeromq", a.master), side_configuration("ros2"), topics
            )
        ) as bridge:
            assert bridge.wait_until_ready(60.0)
            eventually(
                lambda: (
                    route(bridge, "b", "/odom").is_subscribed and route(bridge, "b", "/scan").is_subscribed
                )
            )
            person = a.node("person")
            drive, hears = person.new_pub("/cmd_vel"), person.new_sub("/cmd_vel")
            for number in range(5):
                drive.publish({"linear": {"x": number}})
            assert [ask(robot, "drive") for _time in range(5)] == [f"{number}.0" for number in range(5)]
            assert settled(route(bridge, "a", "/cmd_vel"), 5).sent == 5
            assert taken(hears, 5) == [{"linear": {"x": number}} for number in range(5)]
            assert silent(hears)
            late = person.new_sub("/robot_description").receive(60.0)
            assert (late.payload, late.is_latched) == ({"data": "<robot/>"}, True)
            for what, name in (("odom", "odom"), ("scan", "/scan")):
                sub = person.new_sub(name)
                robot.say(what)
                assert sub.receive(60.0) is not None, what


def test_bidirectional_json_topic_is_forwarded_without_echo():
    with nets("zeromq") as (a,), nep.node("other", "ros2") as other:
        told = BridgeConfiguration(
            "lab",
            side_configuration("zeromq", a.master),
            side_configuration("ros2"),
            (topic("/chat", b_type="json"),),
        )
        with Bridge(told) as bridge:
            assert bridge.wait_until_ready(60.0)
            person = a.node("person")
            hears, hears_other = person.new_sub("/chat"), other.new_sub("/chat", "json")
            says, says_other = person.new_pub("/chat"), other.new_pub("/chat", "json")
            for number in range(5):
                says.publish({"nep": number})
                says_other.publish({"ros": number})
            for each in (hears, hears_other):
                came = taken(each, 10)
                assert [it["nep"] for it in came if "nep" in it] == list(range(5))
                assert [it["ros"] for it in came if "ros" in it] == list(range(5))
                assert silent(each)
            assert all(each.counts().returned == 0 for each in bridge.routes)
