"""Tests of the bounds on everything that the network can make grow: tables of master, nodes and gateway."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import zmq

from nep.backends.zeromq.rpc import RpcClient
from nep.masters.bad_requests import BadRequestCounter
from nep.masters.graph import Graph
from nep.masters.registry import Registry
from nep.masters.router import MasterRouter
from nep.masters.snapshot import GraphSnapshotBuilder
from nep.messages.packing import pack
from nep.programs.gateway.attachment import NativeNetwork
from nep.programs.gateway.framing import PORT_A
from nep.programs.gateway.graph_registrar import GraphRegistrar
from nep.programs.gateway.portmap import PortMap, Registration, TopicLine
from nep.programs.gateway.programs import OriginalProgram, ProgramTable, TopicLink
from nep.programs.gateway.requests import RequestError, parse_request
from nep.protocol import encoding
from nep.protocol.requests import (
    AddPublisher,
    Join,
    NodeRecord,
    Ping,
    PublisherRecord,
    QueryGraph,
    Renew,
    RenewedReply,
    SubscriberCount,
    SubscriberRecord,
    TopicPublishers,
)
from nep.text import first_control
from tests.nep.programs import eventually


def census_with_node() -> Registry:
    registry = Registry()
    registry.add_node(NodeRecord("n", "N", "host", 1), 0.0)
    return registry


def test_removed_topics_leave_no_entries_in_master_tables() -> None:
    registry = census_with_node()
    member, viewer = registry.members["n"], GraphSnapshotBuilder(registry)
    for n in range(20_000):
        registry.add_publisher(member, PublisherRecord(1, f"/p{n}", "json", "json", ("tcp://h:1",)))
        registry.add_subscriber(member, SubscriberRecord(2, f"/s{n}", "json"))
        if n % 1000 == 500:
            assert set(viewer.view(7).topics) == {f"/p{n}", f"/s{n}"}
            assert len(viewer._topics) == 2
        registry.remove_publisher("n", 1)
        registry.remove_subscriber("n", 2)
    assert (registry.changed_topics, registry._topic_revisions) == (set(), {})
    assert (registry.publisher_owners, registry.subscriber_owners) == ({}, {})
    assert viewer.view(7).topics == {}
    assert (viewer._topics, viewer._alerts) == ({}, {})


def test_topic_with_a_changed_type_is_updated_in_the_next_graph_view() -> None:
    registry = census_with_node()
    member, viewer = registry.members["n"], GraphSnapshotBuilder(registry)
    registry.add_publisher(member, PublisherRecord(1, "/t", "json", "json"))
    assert viewer.view(7).topics["/t"].msg_type == "json"
    registry.remove_publisher("n", 1)
    registry.add_publisher(member, PublisherRecord(1, "/t", "image", "image"))
    assert viewer.view(7).topics["/t"].msg_type == "image"


def test_renewal_reports_a_topic_whose_last_publisher_was_removed() -> None:
    graph = Graph(epoch=7, now=0.0, learn_s=0.0)
    subscriber, publisher = SubscriberRecord(2, "/t", "json"), PublisherRecord(1, "/t", "json", "json")
    graph.apply(Join(NodeRecord("s", "S", "h", 1), 0, (), (subscriber,)), 1, 0.0, "s")
    revision = graph.revision
    graph.apply(AddPublisher(NodeRecord("p", "P", "h", 1), publisher), 1, 0.0, "p")
    graph.unregister_nodes(["p"])
    (reply,) = graph.apply(Renew("s", 7, revision, (), (SubscriberCount(2, 0, 0),)), 1, 0.5, "s")
    assert isinstance(reply.body, RenewedReply)
    assert reply.body.topics == (TopicPublishers("/t", ()),)


def test_malformed_requests_of_many_senders_are_logged_at_a_bounded_rate(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.WARNING, "nep.master")
    bad = BadRequestCounter()
    for n in range(10_000):
        bad.add(f"{n}", f"S{n}", "reason", 100.0 + n / 1000)
    assert len(caplog.records) <= 13


@pytest.fixture
def pair() -> Iterator[SimpleNamespace]:
    """RPC client of a node and the router socket of its master."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    router = context.socket(zmq.ROUTER)
    port = router.bind_to_random_port("tcp://127.0.0.1")
    calls = RpcClient(context.socket(zmq.DEALER), f"127.0.0.1:{port}", lambda: None)
    calls.connect(f"127.0.0.1:{port}")
    yield SimpleNamespace(router=router, calls=calls)
    calls.release()
    router.close(0)
    context.term()


def test_many_pushes_are_read_in_batches(pair: SimpleNamespace) -> None:
    pair.calls.send_request(Ping())
    eventually(lambda: pair.calls.read() == [] and bool(pair.router.poll(10)))
    sender, _body = pair.router.recv_multipart()
    for _ in range(120):
        pair.router.send_multipart([sender, encoding.encode_reply(RenewedReply(7, 1))])
    sizes: list[int] = []

    def read() -> bool:
        sizes.append(len(pair.calls.read()))
        assert pair.calls.has_more == (sizes[-1] == 50)
        return sum(sizes) == 120

    eventually(read)
    assert max(sizes) <= 50


def test_unread_graph_replies_use_bounded_master_memory() -> None:
    port = MasterRouter("127.0.0.1:0")
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.DEALER) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.RCVHWM, 1)
        socket.connect(f"tcp://{port.address}")
        socket.send(b"look")
        assert port.socket.poll(60_000)
        sender, _body = port.receive()
        graph = b"x" * 2**20
        for _ in range(500):
            assert port.send(sender, graph)
        assert len(port._unread[sender]) <= 32
        assert port.send(sender, b"small")  # its later replies are still sent
        got = 0
        while socket.poll(500):
            got += len(socket.recv()) == len(graph)
        assert 32 <= got < 200
        eventually(lambda: port.take_ended_senders(0.0) == [] and not port._unread)
        assert port.send(sender, graph)
        assert socket.poll(60_000)
    context.term()
    port.close()


CONTROLS = "Arm\x1b[2J\u202e\n\u2028"


def test_original_node_names_are_escaped_and_truncated() -> None:
    graph = Graph(epoch=7, now=0.0, learn_s=0.0)
    listing = GraphRegistrar(lambda request: graph.apply(request, -1, 0.0, "")[-1].body, 7)  # type: ignore[arg-type, return-value]
    line = TopicLine("t", "bare", "json", "many2many")
    registration = Registration(line, CONTROLS, "publisher", "json", "A", None, None, None)
    link = TopicLink("t", "json", "json", "publisher")
    listing.set_programs(
        (OriginalProgram(registration.node_id, CONTROLS * 100, None, "A", "\x1b]0;x\x07", (link,)),)
    )
    (node,) = graph.view().nodes.values()
    assert not any(map(first_control, (node.id, node.name, node.language)))
    assert node.name.startswith("Arm\\x1b[2J\\u202e\\n\\u2028Arm")
    assert len(node.name) < 200
    assert all(0 < each.id < 2**63 for each in graph.view().topics["t"].publishers)


def test_alerts_about_original_nodes_are_escaped_and_bounded() -> None:
    told: list[int] = []
    shown: list[str] = []

    def report(alerts: tuple[object, ...]) -> None:
        told.append(len(alerts))
        shown.extend(each.sentence for each in alerts[-1:])  # type: ignore[attr-defined]

    native = NativeNetwork(
        lambda: pytest.fail("no node is needed"), GraphRegistrar(lambda _request: None, 7), report
    )  # type: ignore[arg-type, return-value]
    for n in range(1000):
        native.report(f"topic:{n}", f"“{n}{CONTROLS}” stays")
    assert max(told) == 200
    assert not any(map(first_control, shown))
    for n in range(1000):
        native.resolve(f"topic:{n}")
    assert told[-1] == 0


def test_oldest_unconnected_registration_is_evicted_first() -> None:
    known = PortMap(None)
    line = TopicLine("t", "bare", "json", "many2many")
    processes = SimpleNamespace(started=lambda _pid: None, is_connected=lambda *_a, **_k: None)
    registry = ProgramTable(known, processes, lambda _line: None)  # type: ignore[arg-type]
    for n in range(3):
        known.add(Registration(line, f"n{n}", "publisher", "json", "A", None, None, None))
    registry.remove_ended()
    assert registry.evict_unconnected()
    assert [each.node for each in known.registrations] == ["n1", "n2"]
    assert registry.evict_unconnected()
    assert registry.evict_unconnected()
    assert not registry.evict_unconnected()


def test_original_request_with_oversized_text_is_rejected() -> None:
    request = b'{"node":"n","topic":"t","socket":"publisher","msg_type":"%s"}' % (b"x" * 10_000)
    with pytest.raises(RequestError, match="has 10000 characters"):
        parse_request(request, PORT_A)


def test_undecodable_reply_raises_in_the_waiting_thread(pair: SimpleNamespace) -> None:
    asked = pair.calls.send_request(QueryGraph())
    eventually(lambda: pair.calls.read() == [] and bool(pair.router.poll(10)))
    sender, body = pair.router.recv_multipart()
    what = {"epoch": 7, "revision": 1, "view": 5}
    pair.router.send_multipart(
        [sender, pack({"is": "seen", "re": encoding.decode_request(body).call, "what": what})]
    )
    failed: list[str] = []

    def wait() -> None:
        try:
            pair.calls.wait(asked, 60.0)
        except Exception as error:  # noqa: BLE001 - what it raises is what is looked at
            failed.append(type(error).__name__ + str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    eventually(lambda: pair.calls.read() == [] and bool(asked.problem))
    thread.join(60.0)
    assert failed == [
        "RequestRefusedErrorthe master's reply can't be read: 'GraphReply.view' must be a map, not 'int'"
    ]


class JustConnected:
    """Fake socket that becomes connected between the first attempt to send and the check of its events."""

    closed = False

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self._is_connected = False

    def setsockopt(self, _option: int, _value: object) -> None:
        pass

    def connect(self, _endpoint: str) -> None:
        pass

    def getsockopt(self, option: int) -> int:
        self._is_connected = self._is_connected or option == zmq.EVENTS
        return int(zmq.POLLOUT)

    def send(self, body: bytes, _flags: int) -> None:
        if not self._is_connected:
            raise zmq.Again
        self.sent.append(body)


def test_request_is_sent_immediately_when_the_socket_connects_during_the_call() -> None:
    """The check of the events consumes the only signal; without a second attempt the request waits 0.5 s."""
    socket = JustConnected()
    calls = RpcClient(socket, "127.0.0.1:9", lambda: None)  # type: ignore[arg-type]
    calls.send_request(Ping())
    assert socket.sent == [encoding.encode_request(Ping(), 1)]
