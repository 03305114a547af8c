"""Test of a bridge process between the native wire and ROS."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import nep
from nep.masters.master import Master
from tests.nep.backends.ros_programs import FIND_ROS, ros_master, skip_without_ros, told
from tests.nep.programs import eventually, running

BRIDGE = """
import sys
from nep.programs.bridges import Bridge, BridgeConfiguration, BridgeTopic, TopicEnd, side_configuration
def topic(name, direction, msg_type=""):
    return BridgeTopic(TopicEnd(name), TopicEnd(name, msg_type), direction)
topics = (
    topic("/odom", "b->a"), topic("/camera", "b->a"), topic("/cmd_vel", "a->b", "geometry_msgs/Twist"),
    topic("/said", "both", "json"), topic("/picture", "a->b"),
)
sides = side_configuration("zeromq", sys.argv[1]), side_configuration("ros", sys.argv[2])
with Bridge(BridgeConfiguration("test", *sides, topics)) as bridge:
    assert bridge.wait_until_ready(30.0)
    print("ready")
    sys.stdin.readline()
    print([(each.origin.topic, each.counts().received, each.counts().sent, each.counts().failed)
        for each in bridge.routes if each.counts().received])
"""
ROBOT = (
    FIND_ROS
    + """
import sys
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import String
rospy.init_node("robot", disable_signals=True)
subs = [rospy.Subscriber("/cmd_vel", Twist, lambda m: print("drives", m.linear.x, m.angular.z)),
    rospy.Subscriber("/said", String, lambda m: print("hears", m.data)),
    rospy.Subscriber("/picture", CompressedImage, lambda m: print("sees", m.format))]
odom = rospy.Publisher("/odom", TwistStamped, queue_size=10, latch=True)
camera = rospy.Publisher("/camera", Image, queue_size=10, latch=True)
said = rospy.Publisher("/said", String, queue_size=10)
now = TwistStamped()
now.header.frame_id, now.twist.linear.x = "base", 0.25
odom.publish(now)
camera.publish(Image(encoding="bgr8", height=1, width=2, step=6, data=bytes(range(6))))
print("ready")
for line in sys.stdin:
    said.publish(line.strip())
"""
)


def test_bridge_forwards_messages_between_ros_and_nep_in_both_directions(
    tmp_path: Path, master: Master
) -> None:
    skip_without_ros()
    with (
        ros_master(tmp_path) as ros,
        running(ROBOT, **told(ros)) as robot,
        running(BRIDGE, master.address, ros, **told(ros)) as bridge,
        nep.node("n") as node,
    ):
        assert (robot.line(), bridge.line()) == ("ready", "ready")
        odom, camera, said = (node.new_sub(each) for each in ("/odom", "/camera", "/said"))
        message = odom.receive(30.0)
        assert message is not None
        assert message.msg_type == "geometry_msgs/TwistStamped"
        assert message.payload["twist"]["linear"]["x"] == 0.25  # type: ignore[index]
        picture = camera.receive(30.0)
        assert picture is not None
        assert (picture.codec, picture.extension["encoding"]) == ("image", "bgr8"), "as it was: raw"
        assert picture.payload.tolist() == [[[0, 1, 2], [3, 4, 5]]]  # type: ignore[attr-defined]
        drive, say, show = node.new_pub("/cmd_vel"), node.new_pub("/said"), node.new_pub("/picture", "image")
        drive.publish({"linear": {"x": 0.5}, "angular": {"z": -1}})
        assert robot.line() == "drives 0.5 -1.0"
        say.publish({"text": "grüß"})
        assert robot.line() == 'hears {"text":"grüß"}'
        show.publish(np.zeros((4, 4, 3), np.uint8))
        assert robot.line() == "sees jpeg"
        robot.say('{"n": 1}')
        assert robot.line() == 'hears {"n": 1}', "the robot hears itself"
        assert said.listen(timeout_s=30.0) == (True, {"text": "grüß"})
        assert said.listen(timeout_s=30.0) == (True, {"n": 1})
        assert said.listen(timeout_s=0.3) == (False, {}), "nothing goes round"
        bridge.say("")
        counts = bridge.line()
        assert "('/cmd_vel', 1, 1, 0)" in counts
        eventually(lambda: said.lost == 0)
