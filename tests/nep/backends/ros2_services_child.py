"""Contract tests of services over ROS 2, and tests with programs that use plain DDS.

Run by test_ros2.py in a separate network namespace. Parts of the contract that DDS can't provide are
left out: a request goes to all servers of a name.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from tests.nep.backends.ros2_programs import killed_soon
from tests.nep.programs import eventually, running
from tests.nep.services import test_calls as contract
from tests.nep.services.forking import check_fork
from tests.nep.services.test_calls import spin

__all__ = ["spin"]

Make = contract.Make
LEFT_OUT = {
    "test_closing_server_finishes_its_running_call",
    "test_second_server_raises_an_alert_and_takes_over",
}
globals().update({
    name: test
    for name, test in vars(contract).items()
    if name.startswith("test_") and name not in LEFT_OUT
})  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def there() -> Iterator[None]:
    """Node that stays open, so that this process discovers the domain only once and not for each test."""
    os.environ["ROS_DOMAIN_ID"] = "200"
    with nep.node("there", "ros2") as node:
        node.graph()
        yield
    del os.environ["ROS_DOMAIN_ID"]


@pytest.fixture
def make() -> Iterator[Make]:
    made: list[nep.Node] = []

    def new(name: str) -> nep.Node:
        made.append(nep.node(name, "ros2"))
        return made[-1]

    yield new
    for node in made:
        node.close()


@pytest.fixture
def registered(make: Make) -> Make:
    """Same as `make`: with DDS, nodes discover each other without a master."""
    return make


# ---- ROS types


LONG_S = 60.0


def test_common_service_types_are_exchanged_as_dicts(make: Make) -> None:
    def switched(request):
        return {"success": request["data"], "message": "grüß"}

    node = make("server")
    node.new_server("/switch", switched, msg_type="std_srvs/srv/SetBool", threads=1)
    node.new_server("/go", lambda _request: {"success": True}, msg_type="std_srvs/Trigger", threads=1)
    node.new_server("/rest", lambda request: request, msg_type="std_srvs/Empty", threads=1)
    node.new_server(
        "/add", lambda asked: {"sum": asked["a"] + asked["b"]},
        msg_type="example_interfaces/srv/AddTwoInts", threads=1,
    )  # fmt: skip
    other = make("client")
    switch = other.new_client("/switch", msg_type="std_srvs/srv/SetBool", timeout_s=LONG_S)
    assert switch.call({"data": True}) == {"success": True, "message": "grüß"}
    assert switch.call({}) == {"success": False, "message": "grüß"}
    add = other.new_client("/add", msg_type="example_interfaces/AddTwoInts", timeout_s=LONG_S)
    assert add.call({"a": 2**63 - 1, "b": -1}) == {"sum": 2**63 - 2}
    # A client without a type uses the server's type.
    for service, answer in (("/go", {"success": True, "message": ""}), ("rest", {})):
        assert other.new_client(service, timeout_s=LONG_S).call({}) == answer
    assert make("plain").new_client("/add", timeout_s=LONG_S).call({"a": 1, "b": 2}) == {"sum": 3}


def test_invalid_request_or_reply_is_reported_with_its_field(make: Make) -> None:
    make("server").new_server(
        "/add", lambda asked: {"sum": "three"}, msg_type="example_interfaces/AddTwoInts", threads=1
    )
    add = make("client").new_client("/add", msg_type="example_interfaces/AddTwoInts", timeout_s=LONG_S)
    with pytest.raises(nep.EncodeError, match=r"'a' .* -9223372036854775808 to"):
        add.call({"a": 2**63})
    with pytest.raises(nep.EncodeError, match=r"'c' .*fields: 'a', 'b'"):
        add.call({"c": 1})
    with pytest.raises(nep.ServiceError, match="'sum' is a 'str'; expected a whole number"):
        add.call({"a": 1})


def test_service_errors_are_reported_between_nep_programs(make: Make) -> None:
    def answer(_request):
        raise LookupError("no map")

    server = make("server").new_server("/x", answer, msg_type="std_srvs/Trigger", threads=1)
    client = make("client").new_client("/x", msg_type="std_srvs/Trigger", timeout_s=LONG_S)
    with pytest.raises(nep.ServiceError, match="LookupError: no map"):
        client.call({})
    assert (server.calls, server.errors) == (1, 1)


def test_invalid_service_types_and_names_are_rejected_and_custom_types_are_exchanged(
    make: Make, tmp_path, monkeypatch
) -> None:
    node = make("node")
    with pytest.raises(nep.NepError, match="'std_srvs/srv/SetBol'; did you mean 'std_srvs/srv/SetBool'"):
        node.new_server("/x", msg_type="std_srvs/SetBol")
    with pytest.raises(nep.NepError, match=r"'image'.*'std_srvs/srv/SetBool'"):
        node.new_server("/x", msg_type="image")
    with pytest.raises(nep.BadTopicError, match=r"'/ü' .*ASCII"):
        node.new_client("/ü")
    with pytest.raises(nep.NepError, match=r"'ros2' .*direct connections"):
        node.new_client("/x", node.direct(port=7000))
    folder = tmp_path / "my_robot" / "srv"
    folder.mkdir(parents=True)
    (folder / "Grip.srv").write_text("float64 force  # N\n---\nbool is_held\ngeometry_msgs/Point at\n")
    (folder / "Bad.srv").write_text("float64 force\n")
    monkeypatch.setenv("NEP_ROS_MSG_PATH", str(tmp_path))
    answer = {"is_held": True, "at": {"x": 1.0, "y": 0.0, "z": 0.0}}
    node.new_server("/grip", lambda _request: answer, msg_type="my_robot/srv/Grip", threads=1)
    client = node.new_client("/grip", msg_type="my_robot/Grip", timeout_s=LONG_S)
    assert client.call({"force": 2.5}) == answer
    with pytest.raises(nep.NepError, match=r"Bad\.srv.*'---'"):
        node.new_client("/y", msg_type="my_robot/Bad")


# ---- other programs


@pytest.fixture(params=["cyclone", "dust"])
def peer(request: pytest.FixtureRequest):
    """Function that starts a program with plain Cyclone DDS or another vendor's DDS, without nep."""
    if request.param == "dust":
        pytest.importorskip("dust_dds", reason="needs another vendor's DDS: pip install dust-dds==0.15.0")
        if "AddTwoInts" not in request.node.name:
            pytest.skip("its program knows one type")
    code = Path(__file__).with_name(f"{request.param}_service_peer.py").read_text(encoding="utf-8")
    return lambda what, name, kind: running(code, what, f"{name}/{request.param}", kind)


@pytest.mark.parametrize(
    ("kind", "asked", "heard", "said"),
    [
        ("std_srvs/srv/SetBool", {"data": True}, [True], {"success": True, "message": "set to True"}),
        ("std_srvs/srv/Trigger", {}, [0], {"success": True, "message": "grüß"}),
        ("example_interfaces/srv/AddTwoInts", {"a": -5, "b": 2**40}, [-5, 2**40], {"sum": 2**40 - 5}),
    ],
)
def test_nep_calls_a_server_that_uses_plain_dds(make: Make, peer, request, kind, asked, heard, said) -> None:
    last = kind.rpartition("/")[2]
    service = f"/to/{last}/{request.node.callspec.params['peer']}"
    with peer("serve", f"to/{last}", last) as other:  # a killed peer stays visible for ten more seconds
        assert other.line() == "ready"
        client = make("client").new_client(service, msg_type=kind, timeout_s=LONG_S)
        for _ in range(3):
            assert client.call(asked) == said
            assert json.loads(other.line()) == heard
        plain = make("plain").new_client(service, timeout_s=LONG_S)
        assert plain.call(asked) == said
        seen = make("viewer").graph().services[service]
        assert (seen.msg_type, len(seen.servers), len(seen.clients)) == (kind, 1, 2)


@pytest.mark.parametrize(
    ("kind", "given", "asked", "answer", "said"),
    [
        ("std_srvs/SetBool", [True], {"data": True}, {"success": True, "message": "ok"}, [True, "ok"]),
        ("std_srvs/Trigger", [7], {}, {"success": False, "message": ""}, [False, ""]),
        ("example_interfaces/AddTwoInts", [2, 3], {"a": 2, "b": 3}, {"sum": -5}, [-5]),
    ],
)
def test_client_that_uses_plain_dds_calls_nep(
    make: Make, peer, request, kind, given, asked, answer, said
) -> None:
    seen = []
    last = kind.rpartition("/")[2]
    service = f"/of/{last}/{request.node.callspec.params['peer']}"
    server = make("server").new_server(
        service, lambda request: seen.append(request) or answer, msg_type=kind, threads=1
    )
    with peer("call", f"of/{last}", last) as other:
        assert other.line() == "ready"
        for _ in range(3):
            other.say(json.dumps(given))
            assert json.loads(other.line()) == said
        eventually(lambda: len(make("viewer").graph().services[service].clients) == 1)
        other.end()  # leaves before the server has to wait for its last acknowledgement
    assert seen == [asked] * 3
    assert (server.calls, server.errors, server.refused) == (3, 0, 0)


SERVER = """
    import os, nep, sys, threading
    node = nep.node("server", "ros2")
    def answer(request):
        if request == "hang":
            print("asked")
            threading.Event().wait()
        return {"pid": os.getpid()}
    node.new_server("/x", answer, threads=2)
    print("ready")
    sys.stdin.read()
    node.close()
"""


def test_server_that_dies_during_a_call_is_reported(make: Make) -> None:
    client = make("client").new_client("/x", timeout_s=LONG_S)
    with running(SERVER, **killed_soon()) as program:
        program.line()
        future = client.call_async("hang", timeout_s=None)
        assert program.line() == "asked"
        assert client.call({}) == {"pid": program.process.pid}
        assert make("viewer").graph().services["/x"].msg_type == "nep_msgs/srv/Call"
        program.kill()
        with pytest.raises(nep.ServerGoneError, match="'/x'"):
            future.result(LONG_S)
    with running(SERVER) as program:  # the client finds the restarted server
        program.line()
        assert client.call({}) == {"pid": program.process.pid}


def test_service_commands_list_and_call_ros_services(make: Make) -> None:
    make("server").new_server(
        "/add", lambda asked: {"sum": asked["a"] + asked["b"]},
        msg_type="example_interfaces/AddTwoInts", threads=1,
    )  # fmt: skip

    def said(*words: str) -> str:
        told = [sys.executable, "-m", "nep", "service", *words, "--backend", "ros2"]
        done = subprocess.run(told, capture_output=True, text=True, check=False, timeout=LONG_S)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "/add" in [each["name"] for each in json.loads(said("list", "--json"))]
    assert "example_interfaces/srv/AddTwoInts" in said("info", "/add", "--json")
    assert json.loads(said("call", "/add", '{"a": 2, "b": 40}', "--json")) == {"sum": 42}


STRANGER = """
    import os, sys
    from dataclasses import dataclass
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.idl import IdlStruct
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    @dataclass
    class Request(IdlStruct, typename="odd_msgs::srv::dds_::Odd_Request_"):
        x: int
    @dataclass
    class Response(IdlStruct, typename="odd_msgs::srv::dds_::Odd_Response_"):
        x: int
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    reader = DataReader(participant, Topic(participant, "rq/oddRequest", Request))
    writer = DataWriter(participant, Topic(participant, "rr/oddReply", Response))
    print("ready")
    sys.stdin.read()
"""


def test_server_of_unknown_type_is_reported_at_the_call(make: Make) -> None:
    node = make("node")
    client = node.new_client("/odd", timeout_s=LONG_S)
    with running(STRANGER) as other:
        assert other.line() == "ready"
        eventually(lambda: "/odd" in node.graph().services)
        assert not client.is_connected
        with pytest.raises(nep.NepError, match=r"'odd_msgs/srv/Odd'.*\.srv files"):
            client.call({})
        late = node.new_client("/odd")
        with pytest.raises(nep.NepError, match="'odd_msgs/srv/Odd'"):
            late.call({}, timeout_s=LONG_S)
        told = node.new_client("/odd", msg_type="std_srvs/Trigger")
        with pytest.raises(nep.NoServerError):
            told.call({}, timeout_s=0.2)


def test_surveys_are_rejected(make: Make) -> None:
    node = make("node")
    for new in (node.new_surveyor, node.new_respondent):
        with pytest.raises(nep.NepError, match="the back end 'ros2' doesn't support surveys; use 'zeromq'"):
            new("/who")


def test_forked_child_raises_an_error_and_exits(make: Make) -> None:
    check_fork("nep.node('parent', 'ros2')")


@pytest.mark.parametrize("has_digit", [True, False])
def test_parameters_are_read_and_set_for_ids_starting_with_digit_or_letter(
    make: Make, has_digit: bool
) -> None:
    node = next(each for n in range(200) if (each := make(f"robot {n}")).id[0].isdigit() is has_digit)
    node.parameters.declare("speed", 0.5, max=2)
    code = f"""
    import nep
    with nep.node("tool", "ros2") as node:
        while "/nep/parameters/{node.id}" not in node.graph().services:
            pass
        with node.parameters_of({node.id!r}) as parameters:
            parameters.set("speed", 1.5)
            print(parameters.get("speed"))
    """
    with running(code) as tool:
        assert tool.line() == "1.5"
    assert node.parameters["speed"] == 1.5
