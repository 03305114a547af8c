"""Tests of `nep bridge` with ROS 1.

The bridge and a rospy program run as processes; the nep nodes run in the test process.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from tests.nep.backends.ros_programs import FIND_ROS, free_port, ros_master, skip_without_ros, told
from tests.nep.bridges.joined import silent, taken
from tests.nep.programs import eventually, running

COMMAND = "from nep.cli import main; main()"
ROBOT = (
    FIND_ROS
    + """
import sys
from geometry_msgs.msg import Twist, TwistStamped
from std_msgs.msg import String
rospy.init_node("robot", disable_signals=True)
rospy.Subscriber("/cmd_vel", Twist, lambda it: print("twist", it.linear.x, flush=True))
rospy.Subscriber("/stamped", TwistStamped, lambda it: print("stamped", it.twist.linear.x, flush=True))
rospy.Subscriber("/chat", String, lambda it: print("chat", it.data, flush=True))
kept = rospy.Publisher("/robot_description", String, queue_size=10, latch=True)
kept.publish("<robot/>")
pubs = {"odom": rospy.Publisher("/odom", TwistStamped, queue_size=10),
        "chat": rospy.Publisher("/chat", String, queue_size=10)}
print("ready", flush=True)
for line in sys.stdin:
    what, _space, value = line.strip().partition(" ")
    pub = pubs[what]
    pub.publish(String(value) if what == "chat" else TwistStamped())
"""
)


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[str]:
    skip_without_ros()
    with ros_master(tmp_path) as address:
        yield address


def reports(program):
    while True:
        yield json.loads(program.line())


def when(program, is_met):
    return next(each for each in reports(program) if is_met(each))


def test_command_line_bridge_connects_a_ros_robot_without_duplicates(ros: str, master: Master) -> None:
    words = (f"zeromq@{master.address}:/chat", f"ros@{ros}:")
    with running(ROBOT, **told(ros)) as robot, nep.node("person", master=master.address) as person:
        assert robot.line() == "ready"
        with running(COMMAND, "bridge", *words, "--json", **told(ros)) as bridge:
            when(bridge, lambda it: it["is_ready"] and not any(each["trouble"] for each in it["routes"]))
            hears = person.new_sub("/chat")
            robot.say("chat hello from ROS")
            message = hears.receive(30.0)
            assert (message.payload, message.msg_type) == ({"data": "hello from ROS"}, "std_msgs/String")
            assert robot.line() == "chat hello from ROS"
            says = person.new_pub("/chat")
            for _time in range(3):
                says.publish({"data": "hello from nep"})
            assert [robot.line() for _time in range(3)] == ["chat hello from nep"] * 3
            assert taken(hears, 3) == [{"data": "hello from nep"}] * 3
            says.publish({"message": "no"})
            report = when(bridge, lambda it: any(each["failed"] for each in it["routes"]))
            (way,) = (each for each in report["routes"] if each["from"]["side"] == "a")
            assert (way["received"], way["sent"], way["failed"], way["lost"]) == (4, 3, 1, 0)
            assert "field 'message' doesn't exist; known names: 'data'" in way["problem"]
            assert hears.receive(30.0).payload == {"message": "no"}
            assert silent(hears)


FILE = """
[a]
backend = "zeromq"
master = "{zeromq}"
[b]
backend = "ros"
master = "{ros}"
[[topics]]
a = "/cmd_vel"
[[topics]]
a = "/stamped"
[[topics]]
a = "odom"
b = "/odom"
direction = "b->a"
[[topics]]
a = "/r2d2/**"
b = "/robot_**"
direction = "b->a"
"""


def test_configuration_file_bridges_types_names_and_latched_messages(
    ros: str, master: Master, tmp_path: Path
) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(FILE.format(zeromq=master.address, ros=ros), encoding="utf-8")
    with running(ROBOT, **told(ros)) as robot, nep.node("person", master=master.address) as person:
        assert robot.line() == "ready"
        with running(COMMAND, "bridge", str(path), "--json", **told(ros)) as bridge:
            when(bridge, lambda it: it["is_ready"] and any(each["sent"] for each in it["routes"]))
            late = person.new_sub("/r2d2/description").receive(30.0)
            assert (late.payload, late.is_latched) == ({"data": "<robot/>"}, True)
            drive, stamped = person.new_pub("/cmd_vel"), person.new_pub("/stamped")
            hears = person.new_sub("/cmd_vel"), person.new_sub("/stamped")
            for number in range(3):
                drive.publish({"linear": {"x": number}})
            assert [robot.line() for _time in range(3)] == [f"twist {number}.0" for number in range(3)]
            for number in range(3):
                stamped.publish({"twist": {"linear": {"x": number}}})
            assert [robot.line() for _time in range(3)] == [f"stamped {number}.0" for number in range(3)]
            for each in hears:
                taken(each, 3)
                assert silent(each), "ROS numbers messages with a header itself; they are no new ones"
            odom = person.new_sub("odom")
            when(bridge, lambda it: True)
            robot.say("odom")
            assert odom.receive(30.0).payload["twist"]["linear"] == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_bridge_waits_for_a_ros_master_that_starts_later(master: Master, tmp_path: Path) -> None:
    skip_without_ros()
    address = f"127.0.0.1:{free_port()}"
    words = (f"zeromq@{master.address}:/chat", f"ros@{address}:")
    with running(COMMAND, "bridge", *words, "--json", **told(address)) as bridge:
        report = when(bridge, lambda it: it["sides"][1]["problem"])
        assert re.match(f"no ROS master .*'{address}' .*'roscore'", report["sides"][1]["problem"])
        with nep.node("person", master=master.address) as person, ros_master(tmp_path, address):
            when(bridge, lambda it: it["is_ready"])
            with running(ROBOT, **told(address)) as robot:
                assert robot.line() == "ready"
                hears = person.new_sub("/chat")

                def has_come() -> bool:
                    robot.say("chat again")
                    return hears.receive(0.2) is not None

                eventually(has_come)
