"""Tests of ROS 2's conventions over real sockets. Run by test_ros2.py in a separate network namespace."""

from __future__ import annotations

import hashlib
import os
import signal
import socket
import threading
from pathlib import Path

import numpy as np
import pytest

import nep
from nep.backends.ros2 import MessageTypes, message_types
from nep.backends.ros2.library import load_dds
from nep.backends.ros2.names import decode_user_data
from nep.backends.ros2.topics import DdsTopics, create_sample
from nep.geometry import Header, Point, Pose, PoseStamped, Time
from tests.nep.backends.ros2_programs import (  # noqa: F401 - fixtures
    Bytes,
    Make,
    a_domain_for_each_test,
    all_are_patient,
    killed_soon,
    knows,
    making,
    nep_program,
)
from tests.nep.programs import eventually

# ---- two programs


@pytest.mark.parametrize("quality", ["", "reliable"])
def test_first_message_reaches_an_existing_subscriber_of_another_program(make: Make, quality: str) -> None:
    code = f"sub = node.new_sub('t', qos={quality!r})\nsay('ready')\n"
    code += "for _ in range(3): say(sub.listen(timeout_s=60)[1])\nsay(sub.lost)"
    with nep_program(code) as other:
        assert other.line() == "ready"
        pub = knows(make("a"), "t").new_pub("t", qos=quality)
        assert pub.subscribers == 1
        for number in range(3):
            pub.publish(number)
        assert [other.line() for _ in range(4)] == ["0", "1", "2", "0"]


def test_next_message_reaches_a_new_subscriber_of_another_program(make: Make) -> None:
    pub = make("a").new_pub("t")
    code = "knows('t')\nsub = node.new_sub('t')\nsay('ready')\nsay(sub.listen(timeout_s=60)[1])"
    with nep_program(code) as other:
        assert other.line() == "ready"
        pub.publish("first")
        assert other.line() == "first"


def test_every_type_is_exchanged_between_programs(make: Make) -> None:
    code = """
import numpy as np
pubs = [node.new_pub(*each) for each in [
    ('j', 'json'), ('s', 'string'), ('b', 'bytes'), ('i', 'image'), ('m', 'msgpack'),
    ('twist', 'geometry_msgs/Twist'), ('scan', 'sensor_msgs/msg/LaserScan'),
    ('raw', 'sensor_msgs/msg/Image')]]
say('ready')
sys.stdin.readline()
for pub, payload in zip(pubs, [
    {'a': [1, None]}, 'grüß', bytes(range(256)), np.full((40, 60, 3), 200, np.uint8), {'b': b'x'},
    {'linear': {'x': 0.5}}, {'ranges': np.arange(3, dtype=np.float32)},
    {'height': 2, 'width': 2, 'encoding': 'mono8', 'step': 2, 'data': b'abcd'}]):
    pub.publish(payload)
sys.stdin.read()
"""
    node = make("a")
    with nep_program(code) as other:
        assert other.line() == "ready"
        knows(node, "raw")
        subs = [node.new_sub(*each) for each in [("j", "json"), ("s", "string"), ("b", "bytes")]]
        picture, packed = node.new_sub("i", "image"), node.new_sub("m", "msgpack")
        twist = node.new_sub("/twist", "geometry_msgs/msg/Twist")
        scan, raw = (
            node.new_sub("scan", "sensor_msgs/LaserScan"),
            node.new_sub("raw", "sensor_msgs/msg/Image"),
        )
        other.say("")
        got = [sub.listen(timeout_s=60.0)[1] for sub in subs]
        assert got == [{"a": [1, None]}, "grüß", bytes(range(256))]
        frame = picture.listen(timeout_s=60.0)[1]
        assert isinstance(frame, np.ndarray)
        assert (frame.shape, int(frame.mean())) == ((40, 60, 3), 200)
        assert packed.listen(timeout_s=60.0) == (True, {"b": b"x"})
        message = twist.receive(60.0)
        assert message is not None
        zero = {"x": 0.0, "y": 0.0, "z": 0.0}
        assert message.payload == {"linear": zero | {"x": 0.5}, "angular": zero}
        assert (message.codec, message.msg_type) == ("cdr", "geometry_msgs/msg/Twist")
        assert scan.listen(timeout_s=60.0)[1]["ranges"] == [0.0, 1.0, 2.0]  # type: ignore[index]
        assert raw.listen(timeout_s=60.0)[1]["data"] == b"abcd"  # type: ignore[index]


def test_dataclasses_named_like_ros_types_are_sent_as_those_types(make: Make) -> None:
    a, b = make("a"), make("b")
    poses, maps = b.new_sub("p", PoseStamped), b.new_sub("p", "geometry_msgs/msg/PoseStamped")
    pub = a.new_pub("p", PoseStamped)
    pose = PoseStamped(Header(Time(5, 6), "map"), Pose(Point(1.0)))
    pub.publish(pose)
    assert poses.listen(timeout_s=60) == (True, pose)
    plain = maps.listen(timeout_s=60)[1]
    assert isinstance(plain, dict)
    assert plain["header"] == {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "map"}


def test_burst_and_8_mb_messages_arrive_complete(make: Make) -> None:
    code = """
sub = node.new_sub('t', 'bytes')
say('ready')
import hashlib
for _ in range(5): say(hashlib.sha256(sub.listen(timeout_s=60)[1]).hexdigest())
many = node.new_sub('many')
say('ready')
got = [many.listen(timeout_s=60)[1] for _ in range(5000)]
say(got == list(range(5000))); say(many.lost)
"""
    sent = [b"", b"\0", os.urandom(65_000), os.urandom(8_000_000), os.urandom(8_000_001)]
    with nep_program(code) as other:
        assert other.line() == "ready"
        node = knows(make("a"), "t")
        pub = node.new_pub("t", "bytes")
        for data in sent:
            pub.publish(data)
        assert [other.line() for _ in sent] == [hashlib.sha256(data).hexdigest() for data in sent]
        assert other.line() == "ready"
        many = knows(node, "many").new_pub("many")
        for number in range(5000):
            many.publish(number)
        assert (other.line(), other.line()) == ("True", "0")


def test_latched_message_reaches_another_program_once(make: Make) -> None:
    pub = make("a").new_pub("/robot/description", latched=True)
    pub.publish(1)
    pub.publish(2)
    code = "sub = node.new_sub('robot/description')\nm = sub.receive(60)\nsay((m.payload, m.is_latched))\n"
    code += "say('ready')\nsay(sub.listen(timeout_s=60)[1])\nsay(sub.listen(timeout_s=0.3))"
    with nep_program(code) as other:
        assert other.line() == "(2, True)"
        assert other.line() == "ready"
        pub.publish(3)
        assert (other.line(), other.line()) == ("3", "(False, {})")


def test_subscriber_survives_a_killed_publisher(make: Make) -> None:
    node = make("a")
    sub = node.new_sub("t")
    code = "knows('t')\npub = node.new_pub('t')\npub.publish(1)\nsay('ready')\nsys.stdin.read()"
    with nep_program(code, **killed_soon()) as other:
        assert other.line() == "ready"
        assert sub.listen(timeout_s=60.0) == (True, 1)
        other.kill()
    with nep_program(code) as other:
        assert sub.listen(timeout_s=60.0) == (True, 1)
    assert sub.lost == 0
    eventually(lambda: "other" not in {each.name.strip("/") for each in node.graph().nodes.values()})


def test_killed_subscriber_does_not_block_the_publisher(make: Make) -> None:
    code = "sub = node.new_sub('t', 'bytes')\nsay('ready')\nsys.stdin.read()"
    pub = make("a").new_pub("t", "bytes")
    with nep_program(code, **killed_soon()) as other:
        assert other.line() == "ready"
        other.kill()
        for _ in range(20):
            pub.publish(bytes(1_000_000))
        assert pub.count == 20
    sub = make("b").new_sub("t", "bytes")
    pub.publish(b"1")
    assert sub.listen(timeout_s=60.0) == (True, b"1")


def test_unresponsive_subscriber_is_named_and_waited_for_only_until_the_timeout(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nep.backends.ros2.publisher.HANDSHAKE_TIMEOUT_S", 0.2)
    node = make("a")
    code = "sub = node.new_sub('t')\nsay('ready')\nsay(sub.listen(timeout_s=60)[1])"
    with nep_program(code) as other:
        assert other.line() == "ready"
        knows(node, "t")
        other.stop()
        pub = node.new_pub("t", latched=True)
        assert pub.missing == ("/other",)
        pub.publish("later")
        other.signal(signal.SIGCONT)
        assert other.line() == "later"


# ---- graph of ROS 2


def test_graph_has_nodes_topics_and_ids_of_another_program(make: Make) -> None:
    code = """
second = nep.node('space/second', 'ros2')
pub = node.new_pub('t', 'geometry_msgs/Twist'); sub = second.new_sub('u', 'json')
say(node.id); say(second.id); say(pub.id); say(sub.id)
sys.stdin.read()
"""
    node = make("a")
    mine = node.new_sub("t", "geometry_msgs/Twist")
    with nep_program(code) as other:
        first, second, pub, sub = (other.line() for _ in range(4))
        eventually(lambda: {first, second} <= set(node.graph().nodes))
        view = node.graph()
        assert {view.nodes[first].name, view.nodes[second].name} == {"/other", "/space/second"}
        topic = view.topics["t"]
        assert (topic.msg_type, topic.codec, topic.rate_hz) == ("geometry_msgs/Twist", "cdr", None)
        assert [(each.id, each.node_id) for each in topic.publishers] == [(int(pub), first)]
        assert [(each.id, each.node_id) for each in topic.subscribers] == [(mine.id, node.id)]
        assert [(each.id, each.node_id) for each in view.topics["/u"].subscribers] == [(int(sub), second)]
        assert view.topics["/u"].msg_type == "json"
        assert not view.alerts
    eventually(lambda: set(node.graph().nodes) == {node.id})


def discovered(topic: str) -> tuple[object, object]:
    """Return a new participant and the only writer of a topic that it discovers."""
    library = load_dds()
    participant = library.domain.DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    reader = library.builtin.BuiltinDataReader(participant, library.builtin.BuiltinTopicDcpsPublication)
    found: list[object] = []

    def has_come() -> bool:
        found.extend(each for each in reader.take(100) if each.topic_name == topic)
        return bool(found)

    eventually(has_come)
    return participant, found[0]


def test_writer_announces_type_and_qos_as_ros_2_expects(make: Make) -> None:
    make("a").new_pub("/chatter", "std_msgs/msg/String", qos="sensor")
    participant, found = discovered("rt/chatter")
    policies = load_dds().qos.Policy
    assert found.type_name == "std_msgs::msg::dds_::String_"  # type: ignore[attr-defined]
    qos = found.qos  # type: ignore[attr-defined]
    told = decode_user_data(qos[policies.Userdata].data)
    assert told["typehash"] == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert policies.Reliability.BestEffort in qos
    assert policies.Durability.Volatile in qos
    participant.__del__()  # type: ignore[attr-defined]


def test_gid_length_matches_the_ros_release() -> None:
    code = """
from nep.backends.ros2 import message_types
print(message_types().gid_bytes, len(message_types().encode('rmw_dds_common/msg/Gid', {})) - 4)
pub = node.new_pub('t')
say([each.name for each in node.graph().nodes.values()])
"""
    with nep_program(code, ROS_DISTRO="humble") as other:
        assert other.line() == "24 24"
        assert other.line() == "['other']"
    assert (MessageTypes("iron").gid_bytes, MessageTypes("jazzy").gid_bytes) == (16, 16)


def test_discovery_topic_has_the_type_hash_of_ros_2(make: Make) -> None:
    make("a").new_pub("t")
    participant, found = discovered("ros_discovery_info")
    told = decode_user_data(found.qos[load_dds().qos.Policy.Userdata].data)  # type: ignore[attr-defined]
    assert told == {"typehash": "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"}
    participant.__del__()  # type: ignore[attr-defined]


def test_ros_discovery_info_lists_nodes_with_their_readers_and_writers(make: Make) -> None:
    """Decodes the bytes of `ros_discovery_info` by hand, in the layout of ROS 2's message."""
    first, second = make("talker"), make("arm/left/grip per")
    pub, sub = first.new_pub("t", "std_msgs/String"), second.new_sub("t", "std_msgs/String")
    writer, readers = pub._transport._writer.guid.bytes, sub._transport.gids
    library, types = load_dds(), message_types()
    participant = library.domain.DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    topics = DdsTopics(library, types, participant)
    reader = topics.create_state_reader("ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo")
    told: list[bytes] = []

    def has_come() -> bool:
        told.extend(each.cdr for each in reader.take(10))
        return bool(told)

    eventually(has_come)
    participant.__del__()
    info = Bytes(told[-1])
    assert info.take("4s") == b"\0\1\0\0"
    gid = info.take("16s")
    assert gid[:12] == writer[:12]
    assert info.take("I") == 2
    assert (info.text(), info.text()) == ("/", "talker")
    assert (info.gids(), info.gids()) == ([], [writer])
    assert (info.text(), info.text()) == ("/arm/left", "grip_per")
    assert (info.gids(), info.gids()) == (list(readers), [])
    assert info.at == len(info.data)


# ---- discovery range


def udp_sockets() -> dict[int, tuple[str, bytes]]:
    """Return the address and the bound device of each UDP socket of this process, by port."""
    found = {}
    for each in Path("/proc/self/fd").iterdir():
        if not each.is_socket():
            continue
        with socket.socket(fileno=os.dup(int(each.name))) as copy:
            if copy.family == socket.AF_INET and copy.type == socket.SOCK_DGRAM:
                host, port = copy.getsockname()
                device = copy.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
                found[port] = (host, device.rstrip(b"\0"))
    return found


@pytest.mark.parametrize(
    ("environment", "is_open"),
    [
        ({}, False),
        ({"ROS_LOCALHOST_ONLY": "1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, True),
        ({"ROS_STATIC_PEERS": "127.0.0.1"}, True),
    ],
)
def test_sockets_are_bound_to_loopback_unless_configured(
    make: Make, monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], *, is_open: bool
) -> None:
    for key, value in environment.items():
        monkeypatch.setenv(key, value)
    make("a").new_pub("t")
    found = udp_sockets()
    assert len(found) >= 3
    heard = {host for host, device in found.values() if device != b"lo"}
    assert (heard <= {"127.0.0.1"}) is not is_open


def test_lack_of_a_free_participant_index_is_reported() -> None:
    """Runs in a separate process, because Cyclone DDS leaks its sockets on this error."""
    code = """
    from nep.backends.ros2 import environment
    environment._MAX_PARTICIPANT_INDEX = 0
    try:
        node.new_pub('t')
    except nep.NepError as error:
        say(error)
    """
    with nep_program(code) as other:
        assert other.line().endswith("whether the domain already has 100 programs")


def test_discovery_range_off_isolates_the_node(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with nep_program("node.new_pub('t'); say('ready'); sys.stdin.read()") as other:
        assert other.line() == "ready"
        node = make("a")
        node.new_sub("t")
        assert {each.name for each in node.graph().nodes.values()} == {"a"}


# ---- quality of service and alerts


def test_reliable_subscriber_does_not_receive_from_a_best_effort_publisher(make: Make) -> None:
    pub = make("a").new_pub("t", qos="best_effort")
    node = make("b")
    wants, takes = node.new_sub("t"), node.new_sub("t", qos="sensor")
    assert pub.subscribers == 1
    pub.publish(1)
    assert takes.listen(timeout_s=60.0) == (True, 1)
    assert wants.listen() == (False, {})
    (alert,) = node.graph().alerts
    assert (
        alert.sentence
        == "“t” from “a” doesn't reach “b”: the subscriber requests “reliable”, but the publisher "
        "offers “best effort”"
    )
    wants.close()
    assert node.graph().alerts == ()


def test_type_mismatch_on_a_topic_raises_an_alert_and_delivers_nothing(make: Make) -> None:
    node = make("a")
    sub = node.new_sub("t", "std_msgs/Int64")
    code = "knows('t')\npub = node.new_pub('t', 'std_msgs/Float64')\nsay('ready')\n"
    code += "pub.publish({'data': 1.0})\nsys.stdin.read()"
    with nep_program(code) as other:
        assert other.line() == "ready"
        said = "the subscriber requests “std_msgs/msg/Int64”, but the publisher offers “std_msgs/msg/Float64”"
        said = f"“t” from “/other” doesn't reach “a”: {said}"
        eventually(lambda: [each.sentence for each in node.graph().alerts] == [said])
        assert sub.listen() == (False, {})
    eventually(lambda: node.graph().alerts == ())


def test_differing_definition_of_a_type_raises_an_alert(make: Make, tmp_path: Path) -> None:
    code = "sub = node.new_sub('t', 'changed/Pose')\nsay('ready')\nsys.stdin.read()"
    (tmp_path / "changed").mkdir()
    (tmp_path / "changed" / "Pose.msg").write_text("float64 x\nfloat64 y\n")
    message_types().add("changed/Pose", "float64 x\n")
    with nep_program(code, NEP_ROS_MSG_PATH=str(tmp_path)) as other:
        assert other.line() == "ready"
        node = knows(make("a"), "t")
        node.new_pub("t", "changed/Pose").publish({"x": 1.0})
        (alert,) = node.graph().alerts
        assert alert.sentence == "“/other” and “a” have different definitions of “changed/msg/Pose” on “t”"


def test_invalid_qos_types_and_names_are_rejected(make: Make) -> None:
    node = make("a")
    with pytest.raises(ValueError, match="qos is 'quick'; use '', 'reliable', 'best_effort' or 'sensor'"):
        node.new_pub("t", qos="quick")
    with pytest.raises(nep.NepError, match="'std_msgs/msg/Strng'; did you mean 'std_msgs/msg/String'"):
        node.new_sub("t", "std_msgs/Strng")
    with pytest.raises(nep.NepError, match=r"'ros2' .*direct connections"):
        node.new_pub("t", "json", node.direct())
    for topic in ("ü", "a b"[:1] + "-b", "1a", "a//b", "a/", "a__b"):
        with pytest.raises(nep.BadTopicError, match="ROS 2 allows"):
            node.new_pub(topic)
    assert node.graph().topics == {}


def test_node_joins_only_its_own_domain(make: Make) -> None:
    here = make("here")
    hears = here.new_sub("t")
    with nep.node("there", "ros2", master="201") as there, nep.node("too", "ros2", master="201") as too:
        pub, sub = there.new_pub("t"), too.new_sub("t")
        pub.publish(1)
        assert sub.listen(timeout_s=60.0) == (True, 1)
        assert pub.subscribers == 1
        assert {each.name for each in there.graph().nodes.values()} == {"there", "too"}
        with pytest.raises(nep.NepError, match=r"'there' .* 201; .*master='202'"):
            there.new_sub("t", "json", there.hybrid("202"))
    assert hears.listen() == (False, {})
    assert {each.name for each in here.graph().nodes.values()} == {"here"}


def test_invalid_payload_field_is_named_in_log_error_and_alert(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    node = make("a")
    pub = node.new_pub("t", "geometry_msgs/Twist")
    sub = make("b").new_sub("t", "geometry_msgs/Twist")
    pub.publish({"linear": {"x": 1}, "angular": {"z": "fast"}})
    assert "'angular.z' is a 'str'; expected a number" in caplog.text
    assert "the value is at" not in caplog.text
    with pytest.raises(nep.EncodeError, match="publish a map of the fields of 'geometry_msgs/msg/Twist'"):
        pub.publish([1])
    (alert,) = node.graph().alerts
    assert "'angular.z' is a 'str'" in alert.sentence
    pub.publish({"angular": {"z": 1}})
    assert sub.listen(timeout_s=60.0)[0]
    assert (pub.count, pub.refused) == (1, 1)


def test_invalid_message_bytes_are_rejected_and_the_next_message_is_received(make: Make) -> None:
    node = make("a")
    twist, pub = node.new_sub("t", "geometry_msgs/Twist"), node.new_pub("t", "geometry_msgs/Twist")
    bad = (b"", b"ab", b"\0\1\0\0", b"\0\1\0\0" + bytes(40), b"\0\3\0\0" + bytes(48))
    for data in bad:
        pub.publish_bytes(data)
    assert (pub.count, pub.refused) == (0, len(bad))
    with pytest.raises(nep.EncodeError):
        pub.publish_bytes("text")  # type: ignore[arg-type]
    pub.publish_bytes(message_types().encode("geometry_msgs/msg/Twist", {"linear": {"x": 1}}))
    got = twist.listen(timeout_s=60.0)[1]
    assert isinstance(got, dict)
    assert got["linear"]["x"] == 1.0
    assert twist.listen() == (False, {})


def test_forged_match_messages_are_ignored(make: Make, caplog: pytest.LogCaptureFixture) -> None:
    node = make("a")
    pub, sub = node.new_pub("t"), node.new_sub("t")
    own = pub._transport._writer.guid.bytes
    library, types, kind = load_dds(), message_types(), "std_msgs/msg/UInt8MultiArray"
    participant = library.domain.DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    topics = DdsTopics(library, types, participant)
    writer, stranger = topics.create_state_writer("nep_matches", kind), bytes(range(16))
    matches = node._transport._participant.matches
    eventually(lambda: bool(writer.get_matched_subscriptions()))
    mine = own[:12] + b"1234"
    for data in (
        b"",
        b"x" * 15,
        stranger + b"x" * 31,
        mine + stranger + own,
        bytes(10**6),
        stranger * 2 + own,
    ):
        writer.write(create_sample(topics.sample_class(kind), types.encode(kind, {"data": data})))
    eventually(lambda: matches.is_confirmed(own, stranger, stranger))
    assert not matches.is_confirmed(own, b"another one" + bytes(5), stranger)
    participant.__del__()
    pub.publish(1)
    assert sub.listen(timeout_s=60.0) == (True, 1)
    assert caplog.text == ""


def test_string_with_a_null_byte_is_rejected(make: Make) -> None:
    node = make("a")
    sub, pub = node.new_sub("t", "string"), node.new_pub("t", "string")
    pub.publish("a\0b")
    pub.publish("c")
    assert sub.listen(timeout_s=60.0) == (True, "c")
    assert pub.refused == 1


def test_node_is_closed_in_a_forked_child(make: Make) -> None:
    node = make("a")
    sub, pub = node.new_sub("t"), node.new_pub("t")
    child = os.fork()
    if child == 0:
        status = 1
        try:
            with pytest.raises(nep.ClosedError):
                sub.listen()
            with pytest.raises(nep.ClosedError):
                pub.publish(1)
            with pytest.raises(nep.NepError, match="forked"):
                nep.node("child", "ros2")
            node.close()
            sub.close()
            status = 0
        finally:
            os._exit(status)
    assert os.waitpid(child, 0)[1] == 0
    pub.publish(1)
    assert sub.listen(timeout_s=60.0) == (True, 1)


def test_forked_interpreter_exits_cleanly() -> None:
    code = """
import os
pub, sub = node.new_pub('t'), node.new_sub('t')
child = os.fork()
if child:
    say(os.waitpid(child, 0)[1])
"""
    with nep_program(code) as other:
        assert other.line() == "0"


def test_node_closed_while_other_threads_open_endpoints_raises_closed_error(make: Make) -> None:
    def work(node: nep.Node, begun: threading.Event, ended: list[object]) -> None:
        try:
            while True:
                with node.new_pub("t") as pub, node.new_sub("t") as sub:
                    pub.publish(1)
                    sub.listen(timeout_s=0.01)
                    node.graph()
                    begun.set()
        except nep.ClosedError:
            ended.append(node)

    for number in range(5):
        node, begun = make(f"a{number}"), threading.Event()
        ended: list[object] = []
        threads = [threading.Thread(target=work, args=(node, begun, ended)) for _ in range(3)]
        for thread in threads:
            thread.start()
        assert begun.wait(60.0)
        node.close()
        for thread in threads:
            thread.join(60.0)
        assert ended == [node] * 3


def test_publishers_and_subscribers_can_be_closed_after_their_nodes_and_nodes_twice(make: Make) -> None:
    first, second = make("a"), make("b")
    pub, sub = first.new_pub("t"), second.new_sub("t")
    first.close()
    first.close()
    pub.close()
    second.close()
    sub.close()
    with pytest.raises(nep.ClosedError):
        pub.publish(1)
    third = make("c")
    sub, pub = third.new_sub("t"), third.new_pub("t")
    pub.publish(1)
    assert sub.listen(timeout_s=60.0) == (True, 1)


def test_custom_types_are_exchanged(make: Make, tmp_path: Path) -> None:
    folder = tmp_path / "my_robot" / "msg"
    folder.mkdir(parents=True)
    (folder / "Arm.msg").write_text("float64[2] joints\nJoint[] more\nstring<=3 name\n")
    (folder / "Joint.msg").write_text("uint8 id\nbuiltin_interfaces/Time at\n")
    code = "sub = node.new_sub('t', 'my_robot/Arm')\nsay('ready')\nsay(sub.listen(timeout_s=60)[1])"
    message_types().add_folder(tmp_path)
    with nep_program(code, NEP_ROS_MSG_PATH=str(tmp_path)) as other:
        assert other.line() == "ready"
        payload = {"joints": [1, 2], "more": [{"id": 7, "at": {"sec": 1}}], "name": "abc"}
        knows(make("a"), "t").new_pub("t", "my_robot/msg/Arm").publish(payload)
        said = "{'joints': [1.0, 2.0], 'more': [{'id': 7, 'at': {'sec': 1, 'nanosec': 0}}], 'name': 'abc'}"
        assert other.line() == said
