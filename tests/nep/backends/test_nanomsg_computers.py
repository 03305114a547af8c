"""Tests of nanomsg through a master between computers, for which loopback addresses stand.

Network namespaces are used in `tests/nep/masters/test_two_computers.py` and `tests/faults`.
"""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator
from typing import Any

import pynng
import pytest

import nep
from nep.backends.zeromq import master_session
from nep.masters.master import Master
from nep.masters.process import listen
from nep.protocol.wire import HELLO, hello_part, topic_part
from tests.nep.programs import Program, eventually, running

pytestmark = [
    pytest.mark.skipif(sys.platform == "darwin", reason="macOS answers at one loopback address only"),
    pytest.mark.usefixtures("patient"),
]

OTHER = "127.0.0.2"
WAIT_S = 30.0
PUBLISHER = """
import nep, sys
node = nep.node("publisher", "nanomsg", master=sys.argv[1])
pub = node.new_pub("t")
print(pub.subscribers)
for number, _line in enumerate(sys.stdin, 1):
    pub.publish(number)
    print(number)
"""
SUBSCRIBER = """
import nep, sys
sub = nep.node("subscriber", "nanomsg", master=sys.argv[1]).new_sub("t")
print("ready")
print(sub.listen(True)[1])
sys.stdin.read()
"""


@pytest.fixture
def far(master: Master) -> str:
    """Address at which other computers reach the master."""
    listen([OTHER], master.address)
    return f"{OTHER}:{master.address.rpartition(':')[2]}"


@pytest.fixture
def near_node(master: Master) -> Iterator[nep.Node]:
    with nep.node("near", "nanomsg") as node:
        yield node


@pytest.fixture
def far_node(far: str) -> Iterator[nep.Node]:
    with nep.node("far", "nanomsg", master=far) as node:
        yield node


def endpoints(node: nep.Node, topic: str) -> list[str]:
    return [endpoint for each in node.graph().topics[topic].publishers for endpoint in each.endpoints]


def hosts(node: nep.Node, topic: str) -> set[str]:
    return {each.removeprefix("nanomsg://").rpartition(":")[0] for each in endpoints(node, topic)}


def is_refused(host: str, port: int) -> bool:
    """Return True if no process listens at this port."""
    try:
        socket.create_connection((host, port)).close()
    except ConnectionRefusedError:
        return True
    return False


def test_nodes_on_two_computers_exchange_all_messages_from_the_first(
    near_node: nep.Node, far_node: nep.Node
) -> None:
    far_sub, near_sub = far_node.new_sub("to_far"), near_node.new_sub("to_near")
    to_far, to_near = near_node.new_pub("to_far"), far_node.new_pub("to_near")
    for number in range(40):
        to_far.publish(number)
        to_near.publish(number)
    for sub in (far_sub, near_sub):
        assert [sub.listen(True, timeout_s=WAIT_S)[1] for _ in range(40)] == list(range(40))
        assert sub.lost == 0
    assert hosts(near_node, "to_far") == {"127.0.0.1", OTHER}
    assert to_far.missing == to_near.missing == ()
    far_sub.close()
    eventually(lambda: to_far.subscribers == 0)
    assert to_far.missing == ()


def test_publisher_listens_at_other_addresses_only_while_the_master_serves_other_computers(
    master: Master, near_node: nep.Node
) -> None:
    pub = near_node.new_pub("t", latched=True, history=3)
    for number in range(5):
        pub.publish(number)
    assert hosts(near_node, "t") == {"127.0.0.1"}
    listen([OTHER], master.address)
    eventually(lambda: hosts(near_node, "t") == {"127.0.0.1", OTHER}, WAIT_S)
    (far_address,) = (each.partition("://")[2] for each in endpoints(near_node, "t") if OTHER in each)
    far_host, _colon, far_port = far_address.rpartition(":")
    with nep.node("far", "nanomsg", master=f"{OTHER}:{master.address.rpartition(':')[2]}") as far_node:
        sub = far_node.new_sub("t")
        assert [sub.listen(True, timeout_s=WAIT_S)[1] for _ in range(3)] == [2, 3, 4]
    listen([], master.address)
    eventually(lambda: hosts(near_node, "t") == {"127.0.0.1"}, WAIT_S)
    eventually(lambda: is_refused(far_host, int(far_port)))


def test_services_work_between_computers(near_node: nep.Node, far_node: nep.Node) -> None:
    for server_node, client_node in ((near_node, far_node), (far_node, near_node)):
        name = f"/add/{server_node.name}"
        server = server_node.new_server(name, lambda request: request + 1)
        client = client_node.new_client(name, timeout_s=WAIT_S)
        reply = client.call_async(1)
        eventually(lambda node=server_node, reply=reply: node.spin(0.01) or reply.done())
        assert reply.result() == 2
        server.close()


def test_publisher_and_subscriber_continue_after_a_change_of_address(
    near_node: nep.Node, far: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    addresses = ["127.0.0.3"]
    monkeypatch.setattr(master_session, "local_address_towards", lambda _master: addresses[-1])
    with nep.node("moving", "nanomsg", master=far) as moving:
        from_moving, to_moving = moving.new_pub("from"), near_node.new_pub("to")
        near_sub, moving_sub = near_node.new_sub("from"), moving.new_sub("to")
        connection = next(iter(to_moving._transport._connections.values()))
        addresses.append("127.0.0.4")
        eventually(lambda: hosts(near_node, "from") == {"127.0.0.4"}, WAIT_S)
        for pub, sub in ((from_moving, near_sub), (to_moving, moving_sub)):
            eventually(lambda pub=pub, sub=sub: pub.publish(1) is None and sub.listen(timeout_s=0.1)[0])
        eventually(lambda: connection not in to_moving._transport._connections.values())
        eventually(lambda: to_moving.subscribers == 1)


def publish(program: Program) -> int:
    program.say("")
    return int(program.line())


def test_killed_publisher_is_replaced_by_its_successor_at_a_new_endpoint(
    near_node: nep.Node, far: str
) -> None:
    sub = near_node.new_sub("t")
    endpoint = []
    for _start in range(2):
        with running(PUBLISHER, far) as program:
            assert program.line() == "1", "the subscriber was connected before new_pub returned"
            numbers = [publish(program) for _ in range(3)]
            assert [sub.listen(True, timeout_s=WAIT_S)[1] for _ in numbers] == numbers
            endpoint += endpoints(near_node, "t")[-1:]
            program.kill()
    assert len(set(endpoint)) == 2
    assert sub.lost == 0


def test_killed_subscriber_is_no_longer_counted(near_node: nep.Node, far: str) -> None:
    pub, other = near_node.new_pub("t"), near_node.new_sub("t")
    with running(SUBSCRIBER, far) as program:
        assert program.line() == "ready"
        eventually(lambda: pub.subscribers == 2)
        pub.publish("both")
        assert program.line() == "both"
        program.kill()
    eventually(lambda: pub.subscribers == 1)
    pub.publish("one")
    assert [other.listen(True, timeout_s=WAIT_S)[1] for _ in range(2)] == ["both", "one"]
    assert other.lost == 0


INVALID_HELLOS = (b"", b"\xff", HELLO, HELLO + b"-" * 16 + b"/t", hello_part(7, "other"), bytes(200))


def test_invalid_hellos_are_counted_and_their_connections_closed(
    near_node: nep.Node, far_node: nep.Node
) -> None:
    pub, sub = near_node.new_pub("t"), far_node.new_sub("t")
    transport: Any = pub._transport
    for url in transport.endpoints:
        for count, hello in enumerate(INVALID_HELLOS, transport.rejections.count + 1):
            with pynng.Bus0(reconnect_time_min=60_000, reconnect_time_max=60_000) as peer:
                peer.dial(url, block=True)
                peer.send(hello)
                eventually(lambda peer=peer: not peer.pipes)
            assert transport.rejections.count == count
    host, _colon, port = transport.endpoints[0].removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port))) as http:  # no program of nanomsg
        http.sendall(b"GET / HTTP/1.1\r\n\r\n")
        while http.recv(100):
            pass
    with pynng.Bus0() as peer:
        peer.dial(transport.endpoints[0], block=True)
        for _ in range(3_000):  # only the first hello of a connection is processed
            peer.send(hello_part(8, "t"))
        eventually(lambda: pub.subscribers == 2)
    eventually(lambda: pub.subscribers == 1)
    pub.publish("still here")
    assert sub.listen(True, timeout_s=WAIT_S) == (True, "still here")


def test_malformed_messages_of_a_publisher_are_counted_and_others_received(
    near_node: nep.Node, far_node: nep.Node
) -> None:
    pub, sub = near_node.new_pub("t"), far_node.new_sub("t")
    own_topic = sub._transport._readable._own_topic  # type: ignore[attr-defined]
    malformed = (b"", b"u\0", topic_part("t"), topic_part("t") + bytes(31), own_topic, own_topic + bytes(33))
    skipped = hello_part(9, "t") + b"\0" + bytes(32)
    with pynng.Bus0(send_buffer_size=8000) as hostile:
        listener = hostile.listen("tcp://127.0.0.5:0")
        record = near_node.graph().topics["t"].publishers[0]
        readable: Any = sub._transport._readable  # type: ignore[attr-defined]
        readable._connect(record.id + 1, f"tcp://{listener.local_address}")
        assert hostile.recv() == hello_part(sub._transport.spec.id, "t")  # type: ignore[attr-defined]
        for message in (*malformed, *([skipped] * 3000)):
            hostile.send(message)
        eventually(lambda: sub.listen(timeout_s=0.0)[0] or sub.refused == len(malformed))
        pub.publish("from the other publisher")
        assert sub.listen(True, timeout_s=WAIT_S) == (True, "from the other publisher")
        assert (sub.refused, sub.received, sub.lost) == (len(malformed), 1, 0)


def test_repeated_hello_over_another_connection_closes_the_old_connection(near_node: nep.Node) -> None:
    pub: Any = near_node.new_pub("t")
    with pynng.Bus0(reconnect_time_min=60_000, reconnect_time_max=60_000) as old, pynng.Bus0() as new:
        for peer in (old, new):
            peer.dial(pub._transport.endpoints[0], block=True)
            peer.send(hello_part(7, "t"))
            assert peer.recv().startswith(hello_part(7, "t"))
        eventually(lambda: not old.pipes)
        assert pub.subscribers == 1


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
def test_forked_child_keeps_neither_port_nor_connections(master: Master) -> None:
    code = """
import os, signal, sys, nep
node = nep.node("parent", "nanomsg")
pub, sub = node.new_pub("here"), node.new_sub("there")
waits, ends = os.pipe()
child = os.fork()
if not child:
    signal.alarm(60)
    os.close(ends)
    for use in (lambda: pub.publish(1), lambda: nep.node("child", "nanomsg")):
        try:
            use()
        except nep.NepError as error:
            print(error, flush=True)
    os.read(waits, 1)  # until the parent ends it
    sys.exit(7)
sys.stdin.readline()
pub.publish("parent")
pub.close()
sub.close()
print("closed", flush=True)
sys.stdin.readline()
os.close(ends)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
node.close()
"""
    with (
        nep.node("peer", "nanomsg") as peer,
        peer.new_sub("here") as sub,
        peer.new_pub("there") as pub,
        running(code) as program,
    ):
        assert "'here' belongs to the parent process" in program.line()
        assert "fork" in program.line()
        eventually(lambda: pub.subscribers == 1)
        (endpoint,) = endpoints(peer, "here")
        program.say("close")
        assert program.line() == "closed"
        assert sub.listen(True, timeout_s=WAIT_S) == (True, "parent")
        eventually(lambda: pub.subscribers == 0)
        host, _colon, port = endpoint.partition("://")[2].rpartition(":")
        eventually(lambda: is_refused(host, int(port)))
        program.say("end")
        assert program.line() == "7"
        assert program.end()[1] == ""
