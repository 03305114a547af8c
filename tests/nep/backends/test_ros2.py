"""Tests of ROS 2 without a network, and a run of the other tests in a network namespace.

Cyclone DDS listens on all addresses of a computer (0.0.0.0) in any configuration. Tests that open it
(ros2_child.py and the contract tests) run in a network namespace that has only the loopback interface.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

import nep
from nep.backends.base import find_backend
from nep.backends.ros2.environment import cyclonedds_config, is_loopback_only, resolve_domain
from nep.backends.ros2.library import load_dds, load_typesys
from nep.backends.ros2.message_types import MessageTypes
from nep.backends.ros2.mismatches import NodeEndpoint, mismatches
from nep.backends.ros2.names import (
    dds_service,
    dds_topic,
    dds_type,
    decode_user_data,
    is_type_name,
    ros_service,
    ros_topic,
    ros_type,
    service_type_name,
    service_type_of,
    split_node_name,
)
from nep.backends.ros2.participant import DdsEndpoint
from nep.backends.ros2.type_mapping import mapping_for
from nep.errors import WireError, WrongTypeError

HERE = Path(__file__).parent
NEEDS = "ROS 2 without an installation needs Cyclone DDS: pip install 'nep-studio[ros2]'"
NAMESPACE = [
    "unshare", "-rn", "bash", "-c",
    'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"', "--",
]  # fmt: skip


def why_not() -> str:
    """Return why a network namespace can't be created, or "" if it can."""
    missing = [each for each in ("unshare", "bash", "ip") if shutil.which(each) is None]
    if missing:
        return f"a network of its own needs {', '.join(missing)} (Linux: util-linux, iproute2)"
    done = subprocess.run([*NAMESPACE, "true"], capture_output=True, text=True, check=False)
    return f"a network of its own cannot be made: {done.stderr.strip()[:200]}" if done.returncode else ""


def why_no_fast_dds() -> str:
    """Return why no Fast DDS program can be built, or "" if one can."""
    if shutil.which("g++") is not None:
        header = "#include <fastdds/dds/domain/DomainParticipant.hpp>\n"
        command = ["g++", "-E", "-xc++", "-"]
        done = subprocess.run(command, input=header, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return ""
    return "Fast DDS, what ROS 2 has by default, is not there: apt-get install g++ libfastrtps-dev"


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("file", "chosen"),
    [
        ("ros2_child.py", ""),
        ("ros2_vendors_child.py", "dust"),
        ("ros2_vendors_child.py", "fast"),
        ("test_contract.py", ""),
        ("ros2_services_child.py", "(plain_dds and AddTwoInts) or service_errors"),
        ("ros2_history_child.py", "history_has_no_duplicates_or_gaps_during_continuous_publishing"),
        pytest.param("ros2_services_child.py", "", marks=pytest.mark.long),
        pytest.param("ros2_history_child.py", "", marks=pytest.mark.long),
    ],
)
def test_ros2_back_end_passes_the_contract_in_an_isolated_network(file: str, chosen: str) -> None:
    pytest.importorskip("cyclonedds", reason=NEEDS)
    pytest.importorskip("rosbags", reason=NEEDS)
    if reason := why_not() or (why_no_fast_dds() if chosen == "fast" else ""):
        pytest.skip(reason)
    known = {key: value for key, value in os.environ.items() if not key.startswith(("ROS_", "CYCLONEDDS_"))}
    done = subprocess.run(
        [
            *NAMESPACE,
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-n0",
            "--color=no",
            "-k",
            chosen,
            str(HERE / file),
        ],
        env=known | {"NEP_TEST_ROS2": "1"},
        cwd=HERE.parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-2000:]
    assert " passed" in done.stdout


# ---- names and the environment


def test_topic_service_and_type_names_are_translated_to_and_from_dds() -> None:
    assert dds_topic("chatter") == dds_topic("/chatter") == "rt/chatter"
    for node_id in ("0123456789abcdef", "f123456789abcde0"):
        place = f"/nep/parameters/{node_id}"  # ROS 2 doesn't allow a digit after a "/" in a name
        assert ros_topic(dds_topic(place)) == place
        assert ros_service(dds_service(place)[0]) == place
        assert dds_topic(place).rpartition("/")[2].isidentifier()
    assert dds_service("add") == dds_service("/add") == ("rq/addRequest", "rr/addReply")
    assert ros_service("rt/add") is ros_service("rq/add") is ros_service("rr/addReply") is None
    assert dds_type("std_srvs/srv/SetBool_Request") == "std_srvs::srv::dds_::SetBool_Request_"
    assert service_type_of("std_srvs::srv::dds_::SetBool_Request_") == "std_srvs/srv/SetBool"
    assert service_type_of("std_srvs::srv::dds_::SetBool_Response_") is None
    assert service_type_name("std_srvs/SetBool") == "std_srvs/srv/SetBool"
    assert not any(map(service_type_name, ("json", "std_srvs/msg/SetBool", "a/b", "", "/A", "a/srv/")))
    assert dds_type("std_msgs/msg/String") == "std_msgs::msg::dds_::String_"
    assert ros_type("std_msgs::msg::dds_::String_") == "std_msgs/msg/String"
    assert ros_type("Anything") == "Anything"
    assert is_type_name("std_msgs/String")
    assert not any(map(is_type_name, ("json", "robot/description", "a/srv/B", "std_msgs/msg/", "/String")))
    assert split_node_name("face tracker") == ("/", "face_tracker")
    assert split_node_name("/a/1b") == ("/a", "_1b")
    assert split_node_name("/") == ("/", "_")
    assert decode_user_data(b"typehash=RIHS01_a;x=;=y;\xff;nepid=1f;") == {
        "typehash": "RIHS01_a",
        "nepid": "1f",
    }


@pytest.mark.parametrize("said", ["-1", "233", "1.0", "9" * 5000, "\u0661", "x"])
def test_invalid_domains_are_rejected(said: str) -> None:
    with pytest.raises(nep.NepError, match="set it to a number from 0 to 232"):
        resolve_domain(None, {"ROS_DOMAIN_ID": said})
    with pytest.raises(nep.NepError, match=r"ROS 2 domain.* 0 to 232"):
        resolve_domain(said, {})


def test_domain_of_the_node_overrides_the_environment() -> None:
    assert resolve_domain("7", {"ROS_DOMAIN_ID": "5"}) == resolve_domain(" 007 ", {}) == "7"
    assert resolve_domain(None, {"ROS_DOMAIN_ID": "232"}) == "232"
    assert resolve_domain("", {}) == resolve_domain(None, {"ROS_DOMAIN_ID": ""}) == "0"
    with pytest.raises(WrongTypeError, match="a ROS 2 domain must be a 'str' such as '5', not a 'int'"):
        resolve_domain(5, {})  # type: ignore[arg-type]


def test_discovery_is_loopback_only_unless_configured() -> None:
    assert is_loopback_only({})
    assert is_loopback_only({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert is_loopback_only({"ROS_LOCALHOST_ONLY": "1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})
    assert not is_loopback_only({"ROS_AUTOMATIC_DISCOVERY_RANGE": "subnet"})
    assert not is_loopback_only({"ROS_LOCALHOST_ONLY": "0"})
    assert '"127.0.0.1" multicast' in str(cyclonedds_config({}))
    assert "127.0.0.1" not in str(cyclonedds_config({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}))
    assert "Peer" not in str(cyclonedds_config({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}))
    named = {"ROS_STATIC_PEERS": '192.0.2.1; "<;'}
    peers = str(cyclonedds_config(named))
    assert not is_loopback_only(named)
    assert '<Peer Address="192.0.2.1"/>' in peers
    assert "<AllowMulticast>false" in peers
    assert "Peer" not in str(cyclonedds_config(named | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}))
    assert "192.0.2.1" not in str(cyclonedds_config(named | {"ROS_LOCALHOST_ONLY": "1"}))
    assert '<Peer Address="&quot;&lt;"/>' in peers
    assert cyclonedds_config({"CYCLONEDDS_URI": "file:///mine.xml"}) is None
    with pytest.raises(nep.NepError, match=r"DISCOVERY_RANGE .*'EVERYWHERE'.* SUBNET, LOCALHOST or OFF"):
        cyclonedds_config({"ROS_AUTOMATIC_DISCOVERY_RANGE": "everywhere"})


# ---- missing packages and other back ends


def test_missing_packages_are_reported_with_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_name: str) -> object:
        raise ImportError

    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    for library in (load_dds, load_typesys):
        with pytest.raises(nep.NepError, match=r"'ros2' isn't installed; install it with 'pip install"):
            library(missing)  # type: ignore[operator]


def test_platform_without_wheels_is_reported_with_build_instructions(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_name: str) -> object:
        raise ImportError

    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(nep.NepError, match=r"Cyclone DDS .*'aarch64'.*'cyclonedds' 11"):
        load_dds(missing)  # type: ignore[arg-type]


def test_ros2_packages_are_not_imported_unless_requested() -> None:
    code = "import sys, nep; nep.node('a', 'memory').close(); "
    code += "sys.exit(bool({'cyclonedds', 'rosbags'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_back_end_name_is_case_insensitive() -> None:
    assert find_backend("ROS2") is find_backend("ros2")


# ---- incompatible endpoints


def party(
    node: str,
    *,
    kind: str = "std_msgs/msg/String",
    is_latched: bool = False,
    is_reliable: bool = True,
    **told: str,
) -> NodeEndpoint:
    gid = f"{node}{kind}{is_latched}{is_reliable}".encode()
    return NodeEndpoint(node, DdsEndpoint(gid, b"", "rt/t", dds_type(kind), is_latched, is_reliable, told))


def alerts(writers: list[NodeEndpoint], readers: list[NodeEndpoint]) -> dict[str, str]:
    return {each.id: each.sentence for each in mismatches("t", writers, readers)}


def test_compatible_endpoints_raise_no_alert() -> None:
    writers = [party("a", typehash="RIHS01_1"), party("b", is_latched=True)]
    readers = [party("c", typehash="RIHS01_1"), party("d", is_reliable=False)]
    assert alerts(writers, readers) == alerts([], readers) == alerts(writers, []) == {}


def test_incompatible_endpoints_raise_alerts_with_the_differing_settings() -> None:
    heard = "“t” from “a” doesn't reach “c”: the subscriber requests "
    assert alerts([party("a", is_reliable=False)], [party("c")]) == {
        "ros2-reliability:t": heard + "“reliable”, but the publisher offers “best effort”"
    }
    assert alerts([party("a")], [party("c", kind="std_msgs/msg/Int8")]) == {
        "ros2-type:t": heard + "“std_msgs/msg/Int8”, but the publisher offers “std_msgs/msg/String”"
    }
    (said,) = alerts([party("a"), party("b", is_latched=True)], [party("c", is_latched=True)]).values()
    assert said == (
        f"{heard}earlier messages (“transient local”), but the publisher doesn't keep them (“volatile”)"
    )
    assert alerts([party("a", typehash="RIHS01_1")], [party("c", typehash="RIHS01_2")]) == {
        "ros2-definition:t": "“c” and “a” have different definitions of “std_msgs/msg/String” on “t”"
    }
    many = [party(f"n{number}", is_reliable=False) for number in range(5000)]
    (said,) = alerts(many, [party(f"m{number}") for number in range(5000)]).values()
    assert "“n0”, “n1”, “n10” and 97 more" in said


def test_second_reader_of_a_subscriber_raises_no_alert() -> None:
    readers = [party("c", nepid="1", is_latched=latched) for latched in (True, False)]
    for order in (readers, readers[::-1]):
        assert alerts([party("a"), party("b", is_latched=True)], order) == {}


# ---- messages


@pytest.fixture(scope="module")
def types() -> MessageTypes:
    pytest.importorskip("rosbags", reason=NEEDS)
    return MessageTypes("jazzy")


def test_every_known_type_round_trips(types: MessageTypes) -> None:
    assert len(types.names) > 150
    for name in types.names:
        empty = types.encode(name, {})
        assert types.encode(name, types.decode(name, empty)) == empty


def test_type_hashes_match_those_of_ros_2(types: MessageTypes) -> None:
    """The hashes come from ROS 2; `Gid` has a `char` field, which rosbags treats as its own type."""
    string = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    info = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"
    assert types.type_hash("std_msgs/msg/String") == string
    assert types.type_hash("rmw_dds_common/msg/ParticipantEntitiesInfo") == info


@pytest.mark.parametrize(
    ("name", "payload", "sentence"),
    [
        ("geometry_msgs/msg/Twist", {"linear": {"q": 1}}, r"'linear\.q' .*'x', 'y', 'z'"),
        ("geometry_msgs/msg/Twist", {"linear": 5}, "'linear' is a 'int'; expected a map of the fields"),
        ("geometry_msgs/msg/Twist", {1: 2}, "'1' .*'linear', 'angular'"),
        (
            "sensor_msgs/msg/Image",
            {"height": -1},
            "'height' must be from 0 to 4294967295, the range of 'uint32'",
        ),
        ("sensor_msgs/msg/Image", {"data": [0, 256]}, r"'data\[1\]' .* 0 to 255"),
        ("sensor_msgs/msg/Image", {"data": "text"}, "'data' is a 'str'; expected a list"),
        ("sensor_msgs/msg/JointState", {"name": ["a", 1]}, "'name\\[1\\]' is a 'int'; expected a 'str'"),
        ("sensor_msgs/msg/JointState", {"position": [1, None]}, r"'position\[1\]' is a 'NoneType'"),
        ("sensor_msgs/msg/JointState", {"position": b"ab"}, "'position' is a 'bytes'; expected a list"),
        ("geometry_msgs/msg/PoseWithCovariance", {"covariance": []}, "'covariance' has 0 items; expected 36"),
        ("std_msgs/msg/UInt64", {"data": 2**64}, "'data' .* 0 to 18446744073709551615"),
        ("std_msgs/msg/Int64", {"data": 2**63}, "'data' .* -9223372036854775808 to 9223372036854775807"),
        ("std_msgs/msg/Int64", {"data": 1.0}, "'data' is a 'float'; expected a whole number"),
        ("std_msgs/msg/Int8", {"data": True}, "'data' is a 'bool'"),
        ("std_msgs/msg/Float32", {"data": 1e39}, "'data' is too large for 'float32'"),
        ("std_msgs/msg/Float64", {"data": 10**400}, "'data' is too large for 'float64'"),
        ("std_msgs/msg/Bool", {"data": 1}, "'data' is a 'int'; expected True or False"),
        ("std_msgs/msg/String", {"data": "\ud800"}, "'data' contains an unpaired surrogate"),
        ("std_msgs/msg/String", {"data": "a\0"}, "'data' .*null character"),
        ("std_msgs/msg/Float32MultiArray", {"data": [1e39]}, r"'data\[0\]' is too large"),
        (
            "tf2_msgs/msg/TFMessage",
            {"transforms": [{"child": 1}]},
            r"'transforms\[0\]\.child' .*'child_frame_id'",
        ),
    ],
)
def test_invalid_value_is_rejected_with_its_path(
    types: MessageTypes, name: str, payload: object, sentence: str
) -> None:
    with pytest.raises(nep.EncodeError, match=sentence) as caught:
        types.encode(name, payload)
    assert caught.value.place


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("std_msgs/msg/UInt64", 2**64 - 1),
        ("std_msgs/msg/Int64", -(2**63)),
        ("std_msgs/msg/Float32", float("inf")),
        ("std_msgs/msg/Byte", 255),
        ("std_msgs/msg/Char", 255),
        ("std_msgs/msg/String", "grüß \U0001f916"),
        ("std_msgs/msg/UInt8MultiArray", b""),
        ("std_msgs/msg/ByteMultiArray", b"\0\x7f\x80\xff"),
        ("std_msgs/msg/Int64MultiArray", [-(2**63), 0, 2**63 - 1]),
        ("std_msgs/msg/UInt64MultiArray", [0, 2**64 - 1]),
        ("std_msgs/msg/Float64MultiArray", [0.5, float("-inf")]),
    ],
)
def test_extreme_values_round_trip(types: MessageTypes, name: str, value: object) -> None:
    decoded = types.decode(name, types.encode(name, {"data": value}))
    assert isinstance(decoded, dict)
    assert decoded["data"] == value


def test_nan_and_numpy_arrays_round_trip(types: MessageTypes) -> None:
    np = pytest.importorskip("numpy")
    name = "sensor_msgs/msg/LaserScan"
    ranges = np.array([1.0, np.nan, np.inf])
    decoded = types.decode(name, types.encode(name, {"ranges": ranges, "angle_min": np.float64(0.5)}))
    assert isinstance(decoded, dict)
    assert np.array_equal(decoded["ranges"], ranges, equal_nan=True)
    assert decoded["angle_min"] == 0.5


@pytest.mark.parametrize("cut", range(0, 60, 3))
def test_truncated_bytes_raise_decode_error(types: MessageTypes, cut: int) -> None:
    name = "sensor_msgs/msg/JointState"
    whole = types.encode(name, {"name": ["a", "b"], "position": [1.0, 2.0]})
    with pytest.raises(nep.DecodeError):
        types.decode(name, whole[:cut])


def test_invalid_definitions_are_rejected(types: MessageTypes, tmp_path: Path) -> None:
    types.add("mine/Arm", "float64[2] joints\n")
    types.add("mine/msg/Arm", "float64[2] joints\n")  # the same definition again
    with pytest.raises(nep.NepError, match=r"'mine/msg/Arm' .*other fields"):
        types.add("mine/Arm", "float64[3] joints\n")
    with pytest.raises(nep.NepError, match="the definition of 'mine/msg/Leg' can't be read"):
        types.add("mine/Leg", "nonsense\n")
    with pytest.raises(nep.NepError, match=r"'mine/msg/Leg' has .*'a' .*'no/msg/Thing'"):
        types.add("mine/Leg", "no/Thing a\n")
    with pytest.raises(nep.NepError, match=r"'mine' .*'std_msgs/msg/String'"):
        types.add("mine", "int8 a\n")
    with pytest.raises(nep.NepError, match=rf"\.msg files .*'{re.escape(str(tmp_path))}'"):
        types.add_folder(tmp_path)
    assert "mine/msg/Leg" not in types.names


def test_wide_strings_are_rejected(types: MessageTypes) -> None:
    with pytest.raises(nep.NepError, match=r"'mine/msg/Wide' .*'a' .*wstring.*'ros2'"):
        types.add("mine/Wide", "wstring a\n")


def test_invalid_file_in_a_definition_folder_is_reported_when_its_type_is_used(
    types: MessageTypes, tmp_path: Path
) -> None:
    for name, text in {
        "Good": "int8 a\nfolder/Also b\n",
        "Also": "bool[2] c\n",
        "Wide": "wstring[] a\n",
    }.items():
        (tmp_path / "folder").mkdir(exist_ok=True)
        (tmp_path / "folder" / f"{name}.msg").write_text(text)
    (tmp_path / "folder" / "Uses.msg").write_text("folder/Wide a\n")
    types.add_folder(tmp_path)
    assert types.decode("folder/msg/Good", types.encode("folder/msg/Good", {"a": -1})) == {
        "a": -1, "b": {"c": [False, False]},
    }  # fmt: skip
    with pytest.raises(nep.NepError, match=r"'folder/msg/Wide' .*wstring"):
        types.validate("folder/Wide")
    with pytest.raises(nep.NepError, match=r"'folder/msg/Uses' has .*'a' .*'folder/msg/Wide'"):
        types.validate("folder/Uses")


def test_scalar_array_bounded_and_nested_fields_round_trip(types: MessageTypes) -> None:
    types.add("mine/Inner", "float32[2] f\nuint64 u\nbyte[] raw\nstring<=3[<=2] s\n")
    types.add("mine/Outer", "int8 first\nmine/Inner[2] two\nmine/Inner[] more\nbool[] flags\nbool[3] three\n")
    inner = {"f": [float("-inf"), 0.0], "u": 2**64 - 1, "raw": b"\x80\xff", "s": ["", "é"]}
    zero = {"f": [0.0, 0.0], "u": 0, "raw": b"", "s": []}
    said = {"first": -128, "two": [inner, {}], "more": [], "flags": [True, False, True]}
    assert types.decode("mine/msg/Outer", types.encode("mine/msg/Outer", said)) == said | {
        "two": [inner, zero], "three": [False] * 3,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("payload", "sentence"),
    [
        ({"two": [{}]}, "'two' has 1 items; expected 2"),
        ({"more": [{}, {"s": ["abcd"]}]}, "'more\\[1\\].s\\[0\\]' is 4 bytes; at most 3 are allowed"),
        ({"more": [{"s": [""] * 3}]}, "'more\\[0\\].s' has 3 items; at most 2 are allowed"),
        ({"more": [{"f": [0]}]}, r"'more\[0\].f' has 1 items; expected 2"),
        ({"flags": [1]}, "'flags\\[0\\]' is a 'int'; expected True or False"),
        ({"three": [True] * 4}, "'three' has 4 items; expected 3"),
    ],
)
def test_array_and_string_bounds_are_enforced(types: MessageTypes, payload: object, sentence: str) -> None:
    types.add("mine/Inner", "float32[2] f\nuint64 u\nbyte[] raw\nstring<=3[<=2] s\n")
    types.add("mine/Outer", "int8 first\nmine/Inner[2] two\nmine/Inner[] more\nbool[] flags\nbool[3] three\n")
    with pytest.raises(nep.EncodeError, match=sentence):
        types.encode("mine/msg/Outer", payload)


@pytest.mark.parametrize(("shape", "count"), [((2, 3), 2), ((), 0)])
def test_multidimensional_array_is_rejected(types: MessageTypes, shape: tuple[int, ...], count: int) -> None:
    np = pytest.importorskip("numpy")
    with pytest.raises(nep.EncodeError, match=rf"'data' .*{count} dimensions.*'ravel\(\)'"):
        types.encode("sensor_msgs/msg/Image", {"data": np.zeros(shape, np.uint8)})


def test_corrupted_bytes_are_decoded_or_raise_decode_error(types: MessageTypes) -> None:
    """Damages the graph information and two other message types in random places."""
    chance = random.Random(1)
    names = ["rmw_dds_common/msg/ParticipantEntitiesInfo", "sensor_msgs/msg/Image", "tf2_msgs/msg/TFMessage"]
    gid = {"data": bytes(16)}
    entities = [{"node_name": "a", "reader_gid_seq": [gid]}]
    given = ({"gid": gid, "node_entities_info_seq": entities}, {"data": b"ab"}, {"transforms": [{}]})
    refused = 0
    for name, payload in zip(names, given, strict=True):
        whole = types.encode(name, payload)
        for _ in range(500):
            damaged = bytearray(whole)
            at = chance.randrange(len(damaged) - 4)
            damaged[at : at + 4] = struct.pack("<I", chance.choice([0, 2, 10**6, 2**31, 2**32 - 1]))
            try:
                assert isinstance(
                    types.decode(name, bytes(damaged[: chance.randrange(4 * len(whole))])), dict
                )
            except nep.DecodeError:
                refused += 1
    assert refused > 300


def test_unknown_ros_distribution_is_rejected() -> None:
    pytest.importorskip("rosbags", reason=NEEDS)
    with pytest.raises(nep.NepError, match="ROS_DISTRO is 'jazy', which rosbags doesn't know; did you mean"):
        MessageTypes("jazy")


@pytest.mark.parametrize("msg_type", ["json", "string", "bytes", "image"])
@pytest.mark.parametrize(
    "cdr",
    [
        b"", b"\0", b"\0\1\0\0", b"\0\1\0\0\0\0\0\0", b"\0\1\0\0\xff\xff\xff\xff", b"\0\3\0\0\2\0\0\0a\0",
        b"\0\1\0\0\2\0\0\0ab", b"\0\1\0\0\0\0\0\0\0\0\0\0\xff\xff\xff\xff",
    ],
)  # fmt: skip
def test_invalid_cdr_bytes_of_plain_message_types_are_rejected(msg_type: str, cdr: bytes) -> None:
    pytest.importorskip("rosbags", reason=NEEDS)
    with pytest.raises(WireError):
        mapping_for(msg_type).unpack(cdr)


def test_strings_in_big_endian_byte_order_are_decoded() -> None:
    assert bytes(mapping_for("string").unpack(b"\0\0\0\0\0\0\0\3ab\0")) == b"ab"
