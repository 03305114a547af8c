"""Tests of a master under attack: three honest nodes must not be affected by what a hostile program sends."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import psutil
import pytest
import zmq

import nep
from nep.messages.packing import pack, pack_saturated
from nep.protocol import encoding
from nep.protocol.requests import (
    AddPublisher,
    Join,
    Leave,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    QueryGraph,
    RemovePublisher,
    Renew,
    Request,
    SubscriberCount,
    SubscriberRecord,
    derive_node_id,
)
from tests.nep.programs import MASTER, eventually, running

NAMES = ("Arm", "Eye", "Leg")
MEMORY_MAX_BYTES = 400 * 2**20


class Siege:
    """Three honest nodes, each with a publisher and a subscriber of one topic, and an attacker's sockets."""

    def __init__(self, address: str, stack: ExitStack) -> None:
        self._address = address
        self.nodes = [stack.enter_context(nep.node(name, master=address)) for name in NAMES]
        self.subs = [each.new_sub("/state") for each in self.nodes]
        self.pubs = [each.new_pub("/state") for each in self.nodes]
        self.epoch = self.nodes[0].graph().epoch
        self._context = stack.enter_context(zmq.Context())
        self._attackers = ExitStack()
        self._said = 0

    def attacker(self, routing_id: bytes = b"") -> zmq.Socket[bytes]:
        """Open another connection to the master."""
        socket = self._attackers.enter_context(self._context.socket(zmq.DEALER))
        socket.setsockopt(zmq.LINGER, 0)
        if routing_id:
            socket.setsockopt(zmq.ROUTING_ID, routing_id)
        socket.connect(f"tcp://{self._address}")
        return socket

    def end_attack(self) -> None:
        """Close the attacker's sockets."""
        self._attackers.close()

    def go_on(self) -> None:
        """Check that all publishers reach all subscribers, and that a new node can join and sees them."""
        self._said += 1
        for pub in self.pubs:
            pub.publish(self._said)
        for sub in self.subs:
            assert [sub.listen(timeout_s=30.0) for _ in self.pubs] == [(True, self._said)] * 3
            assert sub.lost == 0
        with nep.node("Guest", master=self._address) as guest:
            pub = guest.new_pub("/state")
            eventually(lambda: pub.subscribers >= 3)
            eventually(lambda: set(NAMES) <= {each.name for each in guest.graph(30.0).nodes.values()})


@pytest.fixture(scope="module")
def siege() -> Iterator[Siege]:
    with running(MASTER, "127.0.0.1:0") as master, ExitStack() as stack:
        made = Siege(master.line(), stack)
        made.go_on()
        ids = [each.id for each in made.nodes]
        yield made
        made.go_on()
        assert [each.id for each in made.nodes] == ids
        eventually(lambda: set(ids) <= made.nodes[0].graph(30.0).nodes.keys())
        assert psutil.Process(master.process.pid).memory_info().rss < MEMORY_MAX_BYTES


@pytest.fixture(autouse=True)
def _attackers_end(siege: Siege) -> Iterator[None]:
    yield
    siege.end_attack()


def mallory(n: int) -> NodeRecord:
    return NodeRecord(derive_node_id(f"k{n}"), f"Mallory {n}", "host", 1, key=f"k{n}")


def say(socket: zmq.Socket[bytes], *requests: Request) -> None:
    for request in requests:
        socket.send(encoding.encode_request(request, 1))


def answers(socket: zmq.Socket[bytes], count: int) -> None:
    """Wait for `count` replies of the master."""
    for _ in range(count):
        assert socket.poll(60_000), "the master does not answer any more"
        socket.recv()


def random_bytes(siege: Siege) -> None:
    socket = siege.attacker()
    for size in (0, 1, 7, 100, 5000, 100_000) * 30:
        socket.send(os.urandom(size))
    answers(socket, 180)


def huge_and_nested(siege: Siege) -> None:
    socket = siege.attacker()
    wide = b"\xdd" + (3 * 2**20).to_bytes(4, "big") + b"\xc0" * (3 * 2**20)
    lists: object = [[[[]] * 1000] * 50] * 50
    bodies_sent = [
        b"\x91" * (3 * 2**20) + b"\xc0",
        wide,
        pack({"do": "ping", "call": 1})[:-1] + wide,
        pack({"do": "join", "call": 1, "what": {"node": lists}}),
        pack({"do": "renew", "call": 1, "what": {"node_id": "x", "publishers": lists}}),
        pack({"do": "join", "call": 1, "what": {str(n): n for n in range(200_000)}}),
    ]
    for body in bodies_sent * 4:
        socket.send(body)
    answers(socket, 24)


def many_topics(siege: Siege) -> None:
    """Register 100 000 topics: most are rejected; the registered ones are removed with their nodes."""
    sockets = [siege.attacker() for _ in range(20)]
    for n, socket in enumerate(sockets):
        records = (
            PublisherRecord(n * 10_000 + k, f"/m{n}/{k}", "json", "json", ("tcp://127.0.0.1:9",))
            for k in range(1, 5001)
        )
        say(socket, Join(mallory(n), 0, tuple(records)))
    for socket in sockets:
        answers(socket, 1)
    assert len(siege.nodes[0].graph(30.0).topics) <= 20_010
    siege.go_on()
    for n, socket in enumerate(sockets):
        say(socket, Leave(mallory(n).id))
        answers(socket, 1)
    eventually(lambda: len(siege.nodes[0].graph(30.0).topics) <= 10)


def numbers_that_cannot_be(siege: Siege) -> None:
    socket = siege.attacker()
    me = mallory(50)
    publisher = PublisherRecord(5, "/elsewhere", "json", "json", ("tcp://127.0.0.1:9",))
    say(socket, Join(me, 2**63, (publisher,), (SubscriberRecord(6, "/state", "json"),)))
    answers(socket, 1)
    count = 0
    for epoch in (siege.epoch, 0, -1, 2**63, 2**64 - 1):
        for revision in (0, -5, 2**64 - 1):
            for ratio in (math.nan, math.inf, -1.0, 1e308):
                publishers = (PublisherCount(5, -(2**63), 2**64 - 1, 2**64 - 1, -7),)
                subscribers = (SubscriberCount(6, -1, 2**64 - 1, "\x1b[2J" * 1000),)
                say(socket, Renew(me.id, epoch, revision, publishers, subscribers, ratio))
                count += 1
    for what in (math.nan, [], {}, "x", -1, 2**64 - 1):
        socket.send(pack_saturated({"do": "renew", "call": what, "what": {"node_id": what, "epoch": what}}))
        count += 1
    answers(socket, count)
    say(socket, Leave(me.id))
    answers(socket, 1)


def ids_of_others(siege: Siege) -> None:
    for victim, pub in zip(siege.nodes, siege.pubs, strict=True):
        for routing_id in (victim.id.encode(), b""):
            socket = siege.attacker(routing_id)
            taken = PublisherRecord(pub.id, "/state", "json", "json", ("tcp://127.0.0.1:9",))
            said: list[Request] = [
                Leave(victim.id),
                Join(NodeRecord(victim.id, "x", "host", 1)),
                Join(NodeRecord(victim.id, "x", "host", 1, key="guessed")),
                RemovePublisher(victim.id, pub.id, 0),
                AddPublisher(mallory(60), taken),
                Join(mallory(60), 0, (taken,)),
            ]
            say(socket, *said)
            answers(socket, len(said))


def coming_and_going(siege: Siege) -> None:
    for n in range(100):
        with siege.attacker() as socket:
            record = PublisherRecord(10**9 + n, "/state", "json", "json", ("tcp://127.0.0.1:9",))
            say(socket, AddPublisher(mallory(1000 + n), record))
            answers(socket, 1)


def looks_that_are_never_read(siege: Siege) -> None:
    socket = siege.attacker()
    for _ in range(3000):
        if not socket.poll(1000, zmq.POLLOUT):
            break
        say(socket, QueryGraph())


@pytest.mark.parametrize(
    "attack",
    [
        random_bytes,
        huge_and_nested,
        many_topics,
        numbers_that_cannot_be,
        ids_of_others,
        coming_and_going,
        looks_that_are_never_read,
    ],
    ids=lambda attack: attack.__name__,
)
def test_honest_nodes_are_unaffected_by_attacks(siege: Siege, attack: Callable[[Siege], None]) -> None:
    attack(siege)
    siege.go_on()
    eventually(lambda: set(NAMES) <= {each.name for each in siege.nodes[0].graph(30.0).nodes.values()})
