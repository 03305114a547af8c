"""Tests of the back end `ros` with real ROS programs; its contract tests run in a separate process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

import nep
from tests.nep.backends.ros_programs import FIND_ROS, free_port, ros_master, skip_without_ros, told
from tests.nep.programs import ROOT, running


@pytest.fixture
def debian() -> None:
    """Skip the test without ROS."""
    skip_without_ros()


@pytest.fixture
def ros(debian: None, tmp_path: Path) -> Iterator[str]:
    with ros_master(tmp_path) as address:
        yield address


def test_ros_back_end_passes_the_contract(debian: None) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "tests/nep/backends/ros_contract.py"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "ROS_"))}
    ended = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=140
    )
    assert ended.returncode == 0, ended.stdout[-8000:] + ended.stderr[-2000:]
    assert " passed" in ended.stdout
    assert "skipped" not in ended.stdout


NEP_HEARS = """
import sys, nep
with nep.node("hearer", "ROS") as node:
    subs = [node.new_sub(topic, kind) for topic, kind in (each.split(":") for each in sys.argv[1:])]
    print("ready")
    for sub in subs:
        message = sub.receive(60.0)
        print(repr((message.codec, message.msg_type, message.is_latched, message.payload)))
"""
ROS_SPEAKS = (
    FIND_ROS
    + """
import sys
from std_msgs.msg import String, UInt8MultiArray
from geometry_msgs.msg import PoseStamped
rospy.init_node("speaker", disable_signals=True)
pubs = [rospy.Publisher(topic, kind, queue_size=10, latch=True) for topic, kind in (
    ("/text", String), ("/json", String), ("/bytes", UInt8MultiArray), ("/pose", PoseStamped))]
pose = PoseStamped()
pose.header.frame_id, pose.header.stamp, pose.pose.position.x = "map", rospy.Time(5, 7), 1.5
said = String("grüß"), String('{"a": [1, null]}'), UInt8MultiArray(data=b"\\0\\xff"), pose
for pub, message in zip(pubs, said):
    pub.publish(message)
print("ready")
sys.stdin.readline()
"""
)


def test_nep_receives_messages_from_a_ros_program(ros: str) -> None:
    words = ["/text:string", "json:json", "/bytes:bytes", "/pose:geometry_msgs/PoseStamped", "/pose:json"]
    with running(ROS_SPEAKS, **told(ros)) as speaker:
        assert speaker.line() == "ready"
        with running(NEP_HEARS, *words, **told(ros)) as hearer:
            assert hearer.line() == "ready"
            assert eval(hearer.line()) == ("string", "string", True, "grüß")
            assert eval(hearer.line()) == ("json", "json", True, {"a": [1, None]})
            assert eval(hearer.line()) == ("bytes", "bytes", True, b"\0\xff")
            for _both in range(2):
                codec, kind, _latched, pose = eval(hearer.line())
                assert (codec, kind) == ("ros", "geometry_msgs/PoseStamped")
                assert pose["header"] == {"seq": 1, "stamp": {"secs": 5, "nsecs": 7}, "frame_id": "map"}
                assert pose["pose"]["position"] == {"x": 1.5, "y": 0.0, "z": 0.0}
            hearer.end()


ROS_HEARS = (
    FIND_ROS
    + """
import queue
from std_msgs.msg import String, UInt8MultiArray
from geometry_msgs.msg import TwistStamped
came = queue.Queue()
rospy.init_node("hearer", disable_signals=True)
subs = [rospy.Subscriber(topic, kind, came.put) for topic, kind in (
    ("/json", String), ("/bytes", UInt8MultiArray), ("/twist", TwistStamped))]
print("ready")
print(came.get().data)
print(bytes(came.get().data))
twist = came.get()
print(twist.header.seq, twist.header.frame_id, twist.header.stamp.secs > 10**9, twist.twist.angular.z)
"""
)
NEP_SPEAKS = """
import nep
with nep.node("speaker", "ros1") as node:
    kinds = {"json": "json", "/bytes": "bytes", "/twist": "geometry_msgs/TwistStamped"}
    pubs = [node.new_pub(topic, kind) for topic, kind in kinds.items()]
    print([pub.subscribers for pub in pubs])
    twist = {"header": {"frame_id": "base"}, "twist": {"angular": {"z": 2}}}
    for pub, payload in zip(pubs, ({"a": 1}, b"xyz", twist)):
        pub.publish(payload)
        input()
"""


def test_existing_ros_subscriber_receives_the_first_message(ros: str) -> None:
    with running(ROS_HEARS, **told(ros)) as hearer:
        assert hearer.line() == "ready"
        with running(NEP_SPEAKS, **told(ros)) as speaker:
            assert speaker.line() == "[1, 1, 1]"
            for expected in ('{"a":1}', "b'xyz'", "1 base True 2.0"):
                assert hearer.line() == expected
                speaker.say("")
            speaker.end()


LISTING_4 = """
import nep, sys
def callback(message):
    print(message)
    if message["n"] == 2: node.stop_spin()
node = nep.node("callback_node", "ROS")
node.new_callback("example", "json", callback)
print("ready")
node.spin()
print(sorted(each.name for each in node.graph().nodes.values())[:1])
"""
LISTING_2 = """
import nep
node = nep.node("publisher_node", "ROS")
pub = node.new_pub("example", "json")
for n in range(3):
    pub.publish({"n": n})
"""


def test_listing_4_of_the_paper_receives_messages_of_listing_2_and_both_exit_cleanly(ros: str) -> None:
    with running(LISTING_4, **told(ros)) as hearer:
        assert hearer.line() == "ready"
        with running(LISTING_2, **told(ros)) as speaker:
            assert [hearer.line() for _ in range(3)] == ["{'n': 0}", "{'n': 1}", "{'n': 2}"]
            speaker.end()
            assert speaker.process.returncode == 0
        assert hearer.line() == "['callback_node']"
        hearer.end()
        assert hearer.process.returncode == 0


PICTURES = (
    FIND_ROS
    + """
import nep, numpy as np, sys
from sensor_msgs.msg import Image
from rospy.msg import AnyMsg
node = nep.node("camera", "ros")
sub, exact = node.new_sub("/camera", "image"), node.new_sub("/camera", "sensor_msgs/Image")
pub = rospy.Publisher("/camera", Image, queue_size=10)
while pub.get_num_connections() < 1:
    rospy.sleep(0.01)
def send(encoding, height, width, step, data, big=0):
    pub.publish(Image(encoding=encoding, height=height, width=width, step=step, data=data, is_bigendian=big))
    for each in (sub, exact):
        picture = each.listen(timeout_s=30.0)[1]
        print(picture.dtype, picture.shape, picture.ravel().tolist())
send("rgb8", 1, 2, 8, bytes([1, 2, 3, 4, 5, 6, 9, 9]))
send("bgr8", 1, 2, 6, bytes([1, 2, 3, 4, 5, 6]))
send("mono8", 2, 1, 1, b"ab")
send("mono16", 2, 1, 3, b"\\1\\0x\\2\\0x")
send("16UC1", 1, 2, 4, b"\\1\\0\\2\\0")
send("16UC1", 1, 2, 4, b"\\0\\1\\0\\2", 1)
pub.publish(Image(encoding="bayer_rggb8", height=1, width=1, step=1, data=b"x"))
pub.publish(Image(encoding="rgb8", height=100, width=2, step=6, data=b"x"))
send("32FC1", 1, 1, 4, np.float32(1.5).tobytes())
print(sub.refused)
node.close()
"""
)


def test_raw_ros_images_are_decoded_in_colour_grey_and_float_layouts(ros: str) -> None:
    pytest.importorskip("cv2")
    with running(PICTURES, **told(ros)) as program:
        for expected in (
            "uint8 (1, 2, 3) [3, 2, 1, 6, 5, 4]",
            "uint8 (1, 2, 3) [1, 2, 3, 4, 5, 6]",
            "uint8 (2, 1) [97, 98]",
            "uint16 (2, 1) [1, 2]",
            "uint16 (1, 2) [1, 2]",
            "uint16 (1, 2) [1, 2]",
            "float32 (1, 1) [1.5]",
        ):
            assert [program.line(), program.line()] == [expected, expected]
        assert program.line() == "2"
        program.end()


FRAMES = (
    FIND_ROS
    + """
import nep, numpy as np, queue
from sensor_msgs.msg import CompressedImage, Image
came = queue.Queue()
node = nep.node("camera", "ros")
pubs = [node.new_pub("/jpeg", "image"), node.new_pub("/raw", "sensor_msgs/Image")]
subs = [rospy.Subscriber("/jpeg", CompressedImage, came.put), rospy.Subscriber("/raw", Image, came.put)]
while not all(pub.subscribers for pub in pubs):
    rospy.sleep(0.01)
frame = np.full((4, 6, 3), 200, np.uint8)
pubs[0].publish(frame)
made = came.get()
print(made.format, made.data[:2] == b"\\xff\\xd8", made.header.stamp.secs > 10**9)
pubs[1].publish(frame)
made = came.get()
print(made.encoding, made.height, made.width, made.step, bytes(made.data) == frame.tobytes())
pubs[0].publish(np.zeros((2, 2), np.float32))
print(pubs[0].count, pubs[0].refused)
def raw(payload):
    pubs[1].publish(payload)
    made = came.get()
    print(made.encoding, made.height, made.width, made.step, made.is_bigendian, bytes(made.data)[:4])
raw(np.full((2, 3), 7, np.uint8))
raw(np.full((2, 3), 258, np.uint16))
raw(np.full((2, 3, 4), 7, np.uint8))
raw(np.full((2, 3), 1, np.float32))
raw(nep.Encoded(bytes(range(18)), {"encoding": "rgb8", "shape": [2, 3, 3]}))
raw(nep.Encoded(bytes(range(12)), {"encoding": "16UC1", "shape": [2, 3, 1]}))
raw({"encoding": "bayer_rggb8", "height": 1, "width": 2, "step": 2, "data": b"ab"})
big = np.arange(1400 * 2000 * 3, dtype=np.uint32).astype(np.uint8).reshape(1400, 2000, 3)
pubs[1].publish(big)
made = came.get()
print(len(made.data), bytes(made.data) == big.tobytes())
node.close()
"""
)


def test_ros_programs_receive_images(ros: str) -> None:
    pytest.importorskip("cv2")
    with running(FRAMES, **told(ros)) as program:
        assert program.line() == "jpeg True True"
        assert program.line() == "bgr8 4 6 18 True"
        assert program.line() == "1 1"
        for expected in (
            r"mono8 2 3 3 0 b'\x07\x07\x07\x07'", r"mono16 2 3 6 0 b'\x02\x01\x02\x01'",
            r"bgra8 2 3 12 0 b'\x07\x07\x07\x07'", r"32FC1 2 3 12 0 b'\x00\x00\x80?'",
            r"rgb8 2 3 9 0 b'\x00\x01\x02\x03'", r"16UC1 2 3 6 0 b'\x00\x01\x02\x03'",
            "bayer_rggb8 1 2 2 0 b'ab'", "8400000 True",
        ):  # fmt: skip
            assert program.line() == expected
        program.end()


LISTENS = """
import nep, os, psutil
node = nep.node("n", "ros", master=os.environ["ADDRESS"])
node.new_pub("topic")
print(sorted({each.laddr.ip for each in psutil.Process().net_connections("inet") if each.status == "LISTEN"}))
import logging
print(logging.getLoggerClass().__name__, logging.getLogger().handlers, logging.getLogger().level)
"""


def test_ros_node_binds_to_loopback_by_default_and_keeps_the_logging_configuration(ros: str) -> None:
    with running(LISTENS, ADDRESS=ros) as program:
        assert program.line() == "['127.0.0.1']"
        assert program.line() == "Logger [] 30"
        program.end()
        assert program.process.returncode == 0


def test_missing_ros_master_is_reported_with_the_command_to_start_it(debian: None) -> None:
    address = f"127.0.0.1:{free_port()}"
    with (
        nep.node("n", "ros", master=f"http://{address}/", wait_s=0.2) as node,
        pytest.raises(nep.MasterUnreachable, match=f"'{address}'.*'roscore'"),
    ):
        node.new_pub("topic")
    with (
        nep.node("n", "ros", master=address) as node,
        pytest.raises(nep.MasterUnreachable, match="'rosmaster --core'"),
    ):
        node.graph(0.2)


def test_unsupported_options_and_types_are_rejected(ros: str) -> None:
    with nep.node("n", "ros", master=ros) as node:
        with pytest.raises(nep.NepError, match=r"'ros' .*direct connections"):
            node.new_pub("topic", "json", node.direct())
        with pytest.raises(nep.NepError, match="'nav_nothing/Odometry'"):
            node.new_pub("topic", "nav_nothing/Odometry")
        with pytest.raises(nep.NepError, match="sudo apt install python3-geometry-msgs"):
            node.new_pub("topic", "geometry_msgs/Twisst")


MUCH = """
import nep
pub = nep.node("speaker", "ros").new_pub("much", "bytes")
print(pub.subscribers)
for n in range(20):
    pub.publish(bytes([n]) * 8_000_000)
"""
HEARS_MUCH = """
import nep
with nep.node("hearer", "ros") as node:
    sub = node.new_sub("much", "bytes")
    print("ready")
    print([sub.listen(timeout_s=30.0)[1][:1].hex() for _ in range(20)])
"""


def test_published_messages_are_delivered_when_the_program_exits(ros: str) -> None:
    with running(HEARS_MUCH, **told(ros)) as hearer:
        assert hearer.line() == "ready"
        with running(MUCH, **told(ros)) as speaker:
            assert speaker.line() == "1"
            assert hearer.line() == str([f"{n:02x}" for n in range(20)])
            speaker.end()
            assert speaker.process.returncode == 0


HUNG = """
import nep, sys, time
node = nep.node("n", "ros")
things = [node.new_pub("a"), node.new_sub("a"), node.new_sub("b")]
print("ready")
sys.stdin.readline()
started = time.monotonic()
node.close()
print(time.monotonic() - started < 20)
"""


def test_hung_ros_master_does_not_prevent_a_program_from_exiting(debian: None, tmp_path: Path) -> None:
    with ros_master(tmp_path) as address, running(HUNG, **told(address)) as program:
        assert program.line() == "ready"
        (master,) = [
            each for each in psutil.Process().children() if address.rpartition(":")[2] in each.cmdline()
        ]
        master.suspend()
        program.say("")
        assert program.line() == "True"
        program.end()
        assert program.process.returncode == 0
