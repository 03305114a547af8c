"""Tests of the back end `ros` with masters, nodes and subscribers that die, hang or send wrong data."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from tests.nep.backends.ros_programs import FIND_ROS, free_port, ros_master, skip_without_ros, told
from tests.nep.programs import running

HEARS = """
import nep
with nep.node("hearer", "ros") as node:
    sub = node.new_sub("topic", "json")
    print("ready")
    for message in sub:
        print(message.payload)
"""
SPEAKS = """
import nep, sys
node = nep.node("speaker", "ros")
pub = node.new_pub("topic", "json", latched=True)
pub.publish(0)
print("ready")
for line in sys.stdin:
    pub.publish(int(line))
    print(pub.subscribers)
"""


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[str]:
    skip_without_ros()
    with ros_master(tmp_path) as address:
        yield address


def test_nodes_register_again_at_a_restarted_ros_master(tmp_path: Path) -> None:
    skip_without_ros()
    address = f"127.0.0.1:{free_port()}"
    with running(SPEAKS, **told(address)) as speaker, running(HEARS, **told(address)) as early:
        with ros_master(tmp_path, address):
            assert (speaker.line(), early.line()) == ("ready", "ready")
            assert early.line() == "0"
        speaker.say("1")
        assert (speaker.line(), early.line()) == ("1", "1"), "who is connected needs no master"
        with ros_master(tmp_path, address), running(HEARS, **told(address)) as late:
            assert late.line() == "ready"
            assert late.line() == "1"
            speaker.say("2")
            assert (speaker.line(), early.line(), late.line()) == ("2", "2", "2")
            with running(SPEAKS, **told(address)) as other:
                assert other.line() == "ready"
                assert early.line() == "0", "a subscriber of before hears of new publishers"


SHUT_DOWN = """
import asyncio, nep, sys
async def awaited():
    print("ready")
    await sub.receive_async()
node = nep.node("first", "ros")
pub, sub = node.new_pub("topic"), node.new_sub("topic")
node.new_callback("topic", "json", print)
calls = node.spin, sub.listen, sub.receive, lambda: pub.publish(1), lambda: node.new_pub("b")
for call in (lambda: asyncio.run(awaited()), *calls):
    try:
        call()
    except nep.ClosedError as error:
        print(error)
print(list(sub))
node.close()
"""
SAME_NAME = "import nep; nep.node('second', 'ros').new_pub('topic'); print('ready'); input()"


def test_node_shut_down_by_a_node_with_the_same_name_raises_instead_of_blocking(ros: str) -> None:
    with running(SHUT_DOWN, "__name:=same", **told(ros)) as first:
        assert first.line() == "ready"
        with running(SAME_NAME, "__name:=same", **told(ros)) as second:
            assert second.line() == "ready"
            assert first.line().startswith("shutdown request: "), "rospy prints it"
            for _each in range(6):
                assert first.line() == (
                    "rospy was shut down and can't start again in this process; restart the program"
                )
            assert first.line() == "[]"
            said, errors = first.end()
            assert (first.process.returncode, said, "Traceback" in errors) == (0, "", False)
            assert "rospy was shut down" in errors, "a warning, also for who only publishes"


INTERRUPTED = """
import nep
node = nep.node("n", "ros")
node.new_callback("topic", "json", print)
print("ready")
node.spin()
"""


def test_ctrl_c_ends_a_spinning_program_and_unregisters_it(ros: str) -> None:
    with running(INTERRUPTED, **told(ros)) as program, nep.node("n", "ros", master=ros) as node:
        assert program.line() == "ready"
        assert len(node.graph().topics["/topic"].subscribers) == 1
        program.signal(signal.SIGINT)
        said, errors = program.end()
        assert said == ""
        assert errors.strip().endswith("KeyboardInterrupt")
        assert "/topic" not in node.graph().topics


TOO_MUCH = """
import nep, sys
node = nep.node("speaker", "ros")
pub = node.new_pub("much", "bytes")
print(pub.subscribers)
sys.stdin.readline()
for n in range(400):
    pub.publish(n.to_bytes(2, "little") + bytes(2_000_000))
# Not getrusage: that begins with what the program had that started this one, a large worker of the tests.
print(next(int(line.split()[1]) // 1024 for line in open("/proc/self/status") if line.startswith("VmHWM")))
print([each.sentence for each in node.graph().alerts])
sys.stdin.readline()
print(pub._transport._drops.count)
pub.close(60.0)
"""
SLOW = """
import nep, sys
with nep.node("hearer", "ros") as node:
    sub = node.new_sub("much", "bytes")
    print("ready")
    sys.stdin.readline()
    last, count = 0, 0
    while last != 399:
        last, count = int.from_bytes(sub.listen(timeout_s=60.0)[1][:2], "little"), count + 1
    print(count + sub.lost if sub.lost else count)
"""


def test_hung_subscriber_uses_bounded_memory_and_drops_are_counted(ros: str) -> None:
    with running(SLOW, **told(ros)) as hearer:
        assert hearer.line() == "ready"
        with running(TOO_MUCH, **told(ros)) as speaker:
            assert speaker.line() == "1"
            hearer.stop()
            speaker.say("")
            assert int(speaker.line()) < 650, "MB; there are 800 to send"
            assert "“/much”: subscribers are too slow" in speaker.line()
            hearer.signal(signal.SIGCONT)
            hearer.say("")
            speaker.say("")
            dropped = int(speaker.line())
            assert dropped > 100, "of 400 with 2 MB each: the others are all that was held"
            assert int(hearer.line()) + dropped == 400
            speaker.end()


def test_killed_ros_subscriber_does_not_affect_other_subscribers(ros: str) -> None:
    with running(SPEAKS, **told(ros)) as speaker:
        assert speaker.line() == "ready"
        with running(HEARS, **told(ros)) as other:
            with running(HEARS, **told(ros)) as killed:
                assert [killed.line() for _ in range(2)] == ["ready", "0"]
                assert [other.line() for _ in range(2)] == ["ready", "0"]
            for n in range(1, 100):
                speaker.say(str(n))
                heard_by = speaker.line()
                assert other.line() == str(n)
            assert heard_by == "1"


LIES = (
    FIND_ROS
    + """
import nep, sys
from std_msgs.msg import String, Int32
class Other(String):
    _md5sum = "0" * 32
class Mute(Int32):
    _full_text = ""
class Wrong(Mute):
    _md5sum = "0" * 32
rospy.init_node("liar", disable_signals=True)
pubs = [rospy.Publisher(topic, kind, queue_size=10, latch=True) for topic, kind in (
    ("/other", Other), ("/mute", Mute), ("/wrong", Wrong))]
pubs[0].publish(Other("a"))
pubs[1].publish(Mute(5))
pubs[2].publish(Wrong(6))
sub = rospy.Subscriber("/ours", Other, print)
print("ready")
sys.stdin.readline()
"""
)
HEARS_LIES = """
import nep
node = nep.node("hearer", "ros")
subs = [node.new_sub(topic, "json") for topic in ("/other", "/mute", "/wrong")]
print(subs[1].receive(60.0).payload)
for sub in (subs[0], subs[2]):
    while not sub.refused:
        assert not sub.listen(timeout_s=0.01)[0]
print(sorted({each.sentence[-50:] for each in node.graph().alerts}))
pub = node.new_pub("/ours", "json")
print(pub.subscribers, [each[:4] for each in pub.missing])
"""


def test_different_versions_of_a_message_are_rejected_on_both_sides(ros: str) -> None:
    with running(LIES, **told(ros)) as liar:
        assert liar.line() == "ready"
        with running(HEARS_LIES, **told(ros)) as hearer:
            assert hearer.line() == "{'data': 5}"
            assert "use the same version on both sides" in hearer.line()
            assert hearer.line() == "0 ['liar']"


BOTH = (
    FIND_ROS
    + """
import nep, threading
from std_msgs.msg import String
came = threading.Event()
rospy.init_node("own", disable_signals=True)
own = rospy.Subscriber("/topic", String, lambda message: came.set())
node = nep.node("n", "ros")
sub, pub = node.new_sub("/topic", "string"), node.new_pub("/topic", "string")
pub.publish("both")
print(sub.listen(timeout_s=60.0), came.wait(60.0), rospy.get_name())
"""
)


def test_program_can_use_rospy_itself_and_subscribe_to_the_same_topic(ros: str) -> None:
    with running(BOTH, **told(ros)) as program:
        assert program.line() == "(True, 'both') True /own"
        program.end()
        assert program.process.returncode == 0


OWN_ADDRESS = """
import nep
for _each in range(2):
    try:
        nep.node("n", "ros").new_pub("topic")
        print("made")
    except nep.NepError as error:
        print(error)
"""


@pytest.mark.parametrize(
    ("own", "said"),
    [
        ("", "made"),
        ("999.1.2.3", "ROS_IP is '999.1.2.3'; set it to the IP address of this computer"),
    ],
)
def test_invalid_ros_ip_is_reported_and_an_empty_one_is_ignored(ros: str, own: str, said: str) -> None:
    with running(OWN_ADDRESS, **{**told(ros), "ROS_IP": own}) as program:
        assert program.line() == program.line() == said
        assert program.end() == ("", "")
