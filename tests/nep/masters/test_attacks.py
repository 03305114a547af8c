"""Tests of a master against a hostile program that impersonates or evicts nodes or registers nonsense.

Each attacker knows what the graph shows to everyone: the ids of nodes, publishers and subscribers. The
victims must not be affected.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import zmq
from msgspec.structs import replace

import nep
from nep.masters.master import Master
from nep.masters.registry import is_publisher_endpoint
from nep.protocol import encoding
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    AddedReply,
    AddPublisher,
    AddSubscriber,
    DoneReply,
    FoundReply,
    GraphReply,
    Join,
    Leave,
    NodeRecord,
    Probe,
    PublisherCount,
    PublisherRecord,
    PublisherRemoved,
    QueryGraph,
    RejectedReply,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    RenewedReply,
    Reply,
    ReportMissing,
    Request,
    SubscriberCount,
    SubscriberRecord,
    derive_id,
    derive_node_id,
)
from tests.nep.programs import eventually

pytestmark = pytest.mark.usefixtures("patient")

OWN_KEY = "an attacker has a key of its own"
OWN_ID = derive_node_id(OWN_KEY)


class Attacker:
    """Connection to the master, optionally with a chosen `routing_id`."""

    def __init__(self, master: Master, routing_id: bytes = b"") -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.socket = self._context.socket(zmq.DEALER)
        self.socket.setsockopt(zmq.LINGER, 0)
        if routing_id:
            self.socket.setsockopt(zmq.ROUTING_ID, routing_id)
        self.socket.connect(f"tcp://{master.address}")
        self._call = 0

    def send(self, request: Request) -> int:
        """Send a request without waiting for the reply; return the number of the call."""
        self._call += 1
        self.socket.send(encoding.encode_request(request, self._call))
        return self._call

    def ask(self, request: Request) -> Reply:
        """Send a request and return the reply, which must arrive within a minute."""
        call = self.send(request)
        while True:
            assert self.socket.poll(60_000), "the master does not answer"
            number, answer = encoding.decode_reply(self.socket.recv())
            if number == call and isinstance(answer, Reply):
                return answer

    def close(self) -> None:
        self.socket.close()
        self._context.term()


@contextmanager
def attacker_at(master: Master, routing_id: bytes = b"") -> Iterator[Attacker]:
    made = Attacker(master, routing_id)
    try:
        yield made
    finally:
        made.close()


class Victims:
    """Publisher and subscriber of one topic, each in its own node."""

    def __init__(self, address: str) -> None:
        self.arm = nep.node("Arm", master=address)
        self.eye = nep.node("Eye", master=address)
        self.sub = self.eye.new_sub("/arm/state")
        self.pub = self.arm.new_pub("/arm/state")
        self._said = self._lost = 0

    def recover(self) -> None:
        """Publish until a message is received: messages sent while the subscriber reconnects may be lost."""

        heard: object = None

        def is_received() -> bool:
            nonlocal heard
            self._said += 1
            self.pub.publish(self._said)
            is_new, heard = self.sub.listen(timeout_s=0.2)
            return is_new

        eventually(is_received, 60.0)
        while heard != self._said:
            is_new, heard = self.sub.listen(timeout_s=30.0)
            assert is_new
        self._lost = self.sub.lost or 0

    def go_on(self) -> None:
        """Check that a published message is received and none was lost."""
        self._said += 1
        self.pub.publish(self._said)
        assert self.sub.listen(timeout_s=30.0) == (True, self._said)
        assert self.sub.lost == self._lost

    def are_listed(self, view: GraphView) -> bool:
        topic = view.topics.get("/arm/state")
        return (
            topic is not None
            and [(each.id, each.node_id) for each in topic.publishers] == [(self.pub.id, self.arm.id)]
            and [(each.id, each.node_id) for each in topic.subscribers] == [(self.sub.id, self.eye.id)]
        )

    def close(self) -> None:
        self.arm.close()
        self.eye.close()


@pytest.fixture
def victims(master: Master) -> Iterator[Victims]:
    made = Victims(master.address)
    made.go_on()
    yield made
    made.close()


def node(**changes: object) -> NodeRecord:
    return replace(NodeRecord(OWN_ID, "Mallory", "host", 1, key=OWN_KEY), **changes)  # type: ignore[arg-type]


def publisher(**changes: object) -> PublisherRecord:
    return replace(PublisherRecord(77, "/arm/state", "json", "json", ("tcp://127.0.0.1:9",)), **changes)  # type: ignore[arg-type]


def test_connection_with_the_routing_id_of_a_node_cannot_remove_that_node(
    master: Master, victims: Victims
) -> None:
    before = master.view().nodes
    for victim in (victims.arm, victims.eye):
        with attacker_at(master, victim.id.encode()) as attacker:
            assert isinstance(attacker.ask(Leave(victim.id)), RejectedReply)
            assert victims.are_listed(master.view())
        victims.go_on()
    assert master.view().nodes.keys() == before.keys()
    eventually(lambda: any(each.id == "request:127.0.0.1" for each in master.view().alerts))


def test_second_connection_with_a_used_routing_id_does_not_replace_the_first(master: Master) -> None:
    mine = node()
    with attacker_at(master, b"first") as first:
        assert isinstance(first.ask(Join(mine)), FoundReply)
        with attacker_at(master, b"first") as second:
            for _ in range(3):
                second.send(Leave(mine.id))
                assert isinstance(first.ask(Renew(mine.id, master.epoch, 0)), RenewedReply)
            with attacker_at(master) as third:
                assert isinstance(third.ask(Leave(mine.id)), RejectedReply)
        assert isinstance(first.ask(Renew(mine.id, master.epoch, 0)), RenewedReply)
        assert mine.id in master.view().nodes


def requests_for(victims: Victims) -> list[Request]:
    """Return every request that a node can send about itself, to be sent by another connection."""
    return [
        Leave(victims.arm.id),
        RemovePublisher(victims.arm.id, victims.pub.id, 0),
        RemoveSubscriber(victims.eye.id, victims.sub.id),
        ReportMissing(victims.arm.id, victims.pub.id, (victims.sub.id,)),
        Join(node(id=victims.arm.id)),
        Join(node(id=victims.arm.id, key="")),
        AddPublisher(node(id=victims.arm.id), publisher()),
        AddSubscriber(node(id=victims.eye.id, key=""), SubscriberRecord(78, "/arm/state", "json")),
        Join(node(), managed=True),
    ]


@pytest.mark.parametrize("number", range(9))
def test_requests_for_another_node_are_rejected(master: Master, victims: Victims, number: int) -> None:
    request = requests_for(victims)[number]
    with attacker_at(master) as attacker:
        assert isinstance(attacker.ask(request), RejectedReply)
        assert not isinstance(attacker.ask(Join(node())), RejectedReply)  # also as a registered node
        assert isinstance(attacker.ask(request), RejectedReply)
        assert victims.are_listed(master.view())
        assert not any(each.id.startswith("missing:") for each in master.view().alerts)
    victims.go_on()


def test_forged_renewal_changes_neither_lease_nor_counts(master: Master, victims: Victims) -> None:
    seen = master.view()
    lie = Renew(
        victims.arm.id,
        master.epoch,
        seen.revision,
        (PublisherCount(victims.pub.id, 10**9, 10**9, 10**9),),
        (),
    )
    with attacker_at(master) as attacker:
        answer = attacker.ask(lie)
        assert isinstance(answer, RenewedReply)
        assert answer.again
        (told,) = master.view().topics["/arm/state"].publishers
        assert told.count < 10
    victims.go_on()


@pytest.mark.parametrize("is_proven", [False, True])
def test_id_of_a_publisher_or_subscriber_cannot_be_taken_over(
    master: Master, victims: Victims, is_proven: bool
) -> None:
    number = 1 if is_proven else 0  # 1: a proof that doesn't match the id; 0: no proof
    with attacker_at(master) as attacker:
        taken = publisher(id=victims.pub.id, number=number)
        assert isinstance(attacker.ask(AddPublisher(node(), taken)), RejectedReply)
        assert isinstance(attacker.ask(AddPublisher(node(), replace(taken, topic="/other"))), RejectedReply)
        assert isinstance(attacker.ask(Join(node(), 0, (taken,))), RejectedReply)
        ears = SubscriberRecord(victims.sub.id, "/arm/state", "json", number)
        assert isinstance(attacker.ask(AddSubscriber(node(), ears)), RejectedReply)
        assert victims.are_listed(master.view())
        assert OWN_ID not in master.view().nodes
    victims.go_on()


def test_squatters_are_evicted_when_the_owner_joins_with_its_key() -> None:
    """After a restart of the master, the attacker registers before the nodes join again."""
    with Master("127.0.0.1:0", learn_s=0.0) as master:
        address = master.address
        victims = Victims(address)
        victims.go_on()
    with Master(address, learn_s=0.0) as again, attacker_at(again) as attacker:
        arm, eye = victims.arm.id, victims.eye.id
        ears = SubscriberRecord(victims.sub.id, "/arm/state", "json")
        taken = publisher(id=victims.pub.id)
        attacker.ask(Join(node(), 0, (taken,), (ears,)))
        with attacker_at(again, arm.encode()) as unproven:
            unproven.ask(Join(node(id=arm, key="")))
            eventually(lambda: victims.are_listed(again.view()))
            assert {arm, eye} <= again.view().nodes.keys()
        victims.recover()
        victims.go_on()
        victims.close()


def test_one_connection_can_speak_for_only_one_node(master: Master) -> None:
    with attacker_at(master) as attacker:
        assert isinstance(attacker.ask(Join(node())), FoundReply)
        second = Join(NodeRecord(derive_node_id("b"), "Second", "host", 1, key="b"))
        answer = attacker.ask(second)
        assert isinstance(answer, RejectedReply)
        assert answer.reason == f"this connection already belongs to the node '{OWN_ID}'"
        assert isinstance(attacker.ask(Leave(OWN_ID)), DoneReply)
        assert isinstance(
            attacker.ask(Join(NodeRecord(derive_node_id("b"), "Second", "host", 1, key="b"))), FoundReply
        )


def test_node_with_a_hung_old_connection_can_rejoin(master: Master) -> None:
    """A node has lost and regained the network while its old connection still exists at the master."""
    with attacker_at(master) as old, attacker_at(master) as new:
        arm = PublisherRecord(derive_id(OWN_KEY, 1), "/arm", "json", "json", ("tcp://127.0.0.1:9",), number=1)
        assert isinstance(old.ask(AddPublisher(node(), arm)), AddedReply)
        answer = new.ask(Renew(OWN_ID, master.epoch, 0, (PublisherCount(arm.id, 1, 1, 1),)))
        assert isinstance(answer, RenewedReply)
        assert answer.again
        assert isinstance(new.ask(Join(node(), master.epoch, (arm,))), FoundReply)
        answer = new.ask(Renew(OWN_ID, master.epoch, 0, (PublisherCount(arm.id, 1, 1, 1),)))
        assert answer == replace(answer, again=False)
        assert isinstance(old.ask(Leave(OWN_ID)), RejectedReply)
        assert [each.node_id for each in master.view().topics["/arm"].publishers] == [OWN_ID]


def test_false_report_of_a_missing_subscriber_does_not_affect_other_publishers(
    master: Master, victims: Victims
) -> None:
    """An attacker reports a subscriber as missing; the next publisher must wait for it nevertheless."""
    with attacker_at(master) as attacker:
        for n in range(3):
            own = publisher(id=100 + n)
            assert isinstance(attacker.ask(AddPublisher(node(), own)), AddedReply)
            assert isinstance(attacker.ask(ReportMissing(OWN_ID, own.id, (victims.sub.id,))), DoneReply)
            with nep.node(f"Other {n}", master=master.address) as other:
                pub = other.new_pub("/arm/state")
                pub.publish("first")
                assert victims.sub.listen(timeout_s=30.0) == (True, "first")
                assert pub.missing == ()


GOOD = "tcp://127.0.0.1:5"
BAD_ENDPOINTS = [
    "", "tcp://", "127.0.0.1:5000", "tcp://127.0.0.1", "tcp://127.0.0.1:", "tcp://127.0.0.1:0", "tcp://127.0.0.1:65536",
    "tcp://127.0.0.1:5000;10.0.0.1:5000", "tcp://eth0;10.0.0.1:5000", "tcp://*:5000", "tcp://127.0.0.1:*",
    "ipc:///tmp/x", "ipc://@nep-5000", "inproc://ended", "pgm://10.0.0.1;239.192.1.1:5555", "ws://10.0.0.1:80",
    "udp://10.0.0.1:5000", "tcp://127.0.0.1:5000\n", "tcp://127.0.0.1:٣٤", "tcp://a b:5000", "tcp://\x1b[2J:5000",
    "tcp://" + "a" * 300 + ":5000", "memory", "TCP://127.0.0.1:5000", "tcp://@127.0.0.1:5000",
    "nanomsg://127.0.0.1:5000/5001", "nanomsg://127.0.0.1:0",
]  # fmt: skip


@pytest.mark.parametrize("endpoint", BAD_ENDPOINTS, ids=ascii)
def test_invalid_endpoints_are_rejected(endpoint: str) -> None:
    assert not is_publisher_endpoint(endpoint)


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp://127.0.0.1:1",
        "tcp://0.0.0.0:65535",
        "tcp://robot-2.local:5000",
        "tcp://[::1]:5000",
        "tcp://[fe80::1%eth0]:5",
        "nanomsg://10.0.0.1:5000",
    ],
)
def test_all_host_forms_are_valid_endpoints(endpoint: str) -> None:
    assert is_publisher_endpoint(endpoint)


@pytest.mark.parametrize("endpoint", ["ipc:///tmp/x", "inproc://x", "udp://127.0.0.1:9", "tcp://a b:9", "x"])
def test_invalid_endpoint_of_a_node_without_a_key_is_rejected(master: Master, endpoint: str) -> None:
    own = NodeRecord("5" * 16, "Mallory", "host", 1)

    def record(where: str) -> PublisherRecord:
        return PublisherRecord(77, "/arm/state", "json", "json", (where,))

    with attacker_at(master, own.id.encode()) as attacker:
        assert isinstance(attacker.ask(AddPublisher(own, record(endpoint))), RejectedReply)
        assert "/arm/state" not in master.view().topics
        assert isinstance(attacker.ask(AddPublisher(own, record("tcp://127.0.0.1:9"))), AddedReply)


@pytest.mark.parametrize(
    ("word", "said"),
    [("x\u202ey", r"'\u202e' isn't allowed"), ("j" * 1000, "use at most 200 characters")],
)
def test_rejected_message_type_is_reported_with_the_reason(master: Master, word: str, said: str) -> None:
    with attacker_at(master) as attacker:
        refused = attacker.ask(AddPublisher(node(), publisher(msg_type=word)))
        assert isinstance(refused, RejectedReply)
        assert said in refused.reason


def test_invalid_registrations_are_rejected_with_a_reason_and_counted(
    master: Master, victims: Victims
) -> None:
    with attacker_at(master) as attacker:
        nonsense: list[Request] = [
            *(
                AddPublisher(node(), publisher(endpoints=("tcp://127.0.0.1:5", each)))
                for each in BAD_ENDPOINTS
            ),
            AddPublisher(node(), publisher(endpoints=("tcp://127.0.0.1:5",) * 33)),
            AddPublisher(node(), publisher(id=0)),
            AddPublisher(node(), publisher(id=2**63)),
            AddPublisher(node(), publisher(id=-5)),
            AddPublisher(node(), publisher(topic="/a\x1b[2Jb")),
            AddPublisher(node(), publisher(msg_type="x\u202ey")),
            AddPublisher(node(), publisher(codec="j" * 1000)),
            Join(node(name="Arm\x1b[2J")),
            Join(node(name="Arm\u202e")),
            Join(node(name="A" * 201)),
            Join(node(name="")),
            Join(node(host="h" * 10_000)),
            Join(node(language="\n")),
            Join(node(id="../../etc")),
            Join(node(id=OWN_ID.upper())),
            Join(node(pid=2**40)),
            Join(node(since_ns=-1)),
            Join(node(), 0, tuple(publisher(id=n) for n in range(1, 5_002))),
        ]
        for request in nonsense:
            answer = attacker.ask(request)
            assert isinstance(answer, RejectedReply), request
            assert answer.reason
            assert answer.reason.isprintable()
        assert victims.are_listed(master.view())
        assert OWN_ID not in master.view().nodes
        count = f" {len(nonsense)} requests "
        eventually(lambda: any(count in each.sentence for each in master.view().alerts))
    victims.go_on()


def test_number_of_publishers_and_subscribers_per_node_is_limited(master: Master) -> None:
    with attacker_at(master) as attacker:
        many = tuple(publisher(id=n, topic=f"/t{n}") for n in range(1, 5_001))
        assert isinstance(attacker.ask(Join(node(), 0, many)), FoundReply)
        more = attacker.ask(AddPublisher(node(), publisher(id=20_000)))
        assert isinstance(more, RejectedReply)
        assert more.reason == "a node can have at most 5000 publishers and subscribers"
        assert isinstance(attacker.ask(RemovePublisher(OWN_ID, 1, 0)), DoneReply)
        assert isinstance(attacker.ask(AddPublisher(node(), publisher(id=20_000))), AddedReply)


def test_key_of_a_node_is_in_no_reply_graph_or_repr(master: Master, victims: Victims) -> None:
    with attacker_at(master) as attacker:
        answers = [
            attacker.ask(QueryGraph()),
            attacker.ask(AddSubscriber(node(), SubscriberRecord(5, "/arm/state", "json"))),
        ]
        assert isinstance(answers[0], GraphReply)
    keys = [victims.arm._key, victims.eye._key]
    for told in (repr(answers), repr(master.view()), repr(NodeRecord("a", "b", "c", 1, key=keys[0]))):
        assert not any(key in told for key in keys)


def test_eviction_of_a_squatter_is_announced_to_subscribers_before_the_owner(master: Master) -> None:
    real = PublisherRecord(derive_id("k", 1), "/t", "json", "json", ("tcp://127.0.0.1:9",), number=1)
    with attacker_at(master) as ear, attacker_at(master) as squatter, attacker_at(master) as owner:
        listener = NodeRecord(derive_node_id("ear"), "Ear", "host", 1, key="ear")
        ear.ask(AddSubscriber(listener, SubscriberRecord(5, "/t", "json")))
        assert isinstance(squatter.ask(AddPublisher(node(), replace(real, number=0))), AddedReply)
        owned = NodeRecord(derive_node_id("k"), "Owner", "host", 1, key="k")
        assert isinstance(owner.ask(AddPublisher(owned, real)), AddedReply)
        told = (encoding.decode_reply(ear.socket.recv())[1] for _ in itertools.count())
        notices = (each for each in told if not isinstance(each, Probe))  # of a node that is slow to renew
        came, gone, again = itertools.islice(notices, 3)
        assert isinstance(gone, PublisherRemoved)
        assert not gone.is_closed
        assert [each.publisher.node_name for each in (came, again)] == ["Mallory", "Owner"]


def test_invalid_loss_counts_of_a_subscriber_are_clamped(master: Master) -> None:
    with attacker_at(master) as attacker, nep.node("honest", master=master.address) as honest:
        record = SubscriberRecord(5, "/t", "json")
        assert isinstance(attacker.ask(AddSubscriber(node(), record)), FoundReply)
        for lost in (2**64 - 1, -1, 2**63):
            count = SubscriberCount(5, lost, lost, "a\x1b[2J" * 1000)
            assert isinstance(attacker.ask(Renew(OWN_ID, master.epoch, 0, (), (count,))), RenewedReply)
            topic = honest.graph().topics["/t"]
            assert topic.lost in {0, 2**63 - 1}
