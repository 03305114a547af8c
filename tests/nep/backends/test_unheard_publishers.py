"""Tests of the losses of publishers not received from yet, counted from a new publisher's first message."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
import zmq

import nep
from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import MAX_GAP, PublisherTracker
from nep.backends.connection import Hybrid
from nep.backends.zeromq.io_thread import IoThread
from nep.backends.zeromq.native_subscriber import NativeSubscriber
from nep.backends.zeromq.sub_socket import SubSocket
from nep.backends.zeromq.topic_sockets import TopicSockets
from nep.masters.master import Master
from nep.protocol.requests import (
    AddedReply,
    AddPublisher,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    RemotePublisher,
    RemovePublisher,
    Renew,
    derive_id,
    derive_node_id,
)
from tests.nep.masters.test_attacks import Attacker, attacker_at
from tests.nep.programs import eventually

KEY = "a publisher behind a closed port"


def new_publisher(history: int = 0) -> PublisherTracker:
    """Return the losses of a subscriber that was registered when publisher 5 was created."""
    sources = PublisherTracker()
    sources.expect_all_messages(5)
    sources.add_listed(RemotePublisher(PublisherRecord(5, "t", "json", "json", history=history), "n", "name"))
    return sources


def test_messages_before_the_first_received_one_are_lost() -> None:
    sources = new_publisher()
    assert sources.count_message(5, 8, is_alone=False)
    assert (sources.received, sources.lost) == (1, 7)


def test_messages_before_the_echo_are_lost() -> None:
    sources = new_publisher()
    assert sources.advance_to(5, 21975)
    assert sources.lost == 21975


def test_no_message_is_lost_if_the_first_one_arrives() -> None:
    sources = new_publisher()
    assert sources.advance_to(5, 0)
    assert sources.count_message(5, 1, is_alone=False)
    assert (sources.received, sources.lost) == (1, 0)


def test_message_without_a_valid_sequence_number_does_not_make_losses_negative() -> None:
    sources = new_publisher()
    sources.count_message(5, 0, is_alone=False)
    assert sources.lost == 0


def test_losses_grow_with_each_renewal_while_the_publisher_is_unreachable() -> None:
    sources = new_publisher()
    sources.expect_up_to(5, 100)
    assert sources.lost == 0
    sources.expect_up_to(5, 250)
    assert sources.lost == 100
    sources.count_missing(5)
    assert sources.lost == 250


def test_late_message_already_counted_as_lost_is_counted_as_received() -> None:
    sources = new_publisher()
    sources.expect_up_to(5, 2)
    sources.expect_up_to(5, 2)
    assert sources.lost == 2
    assert sources.count_message(5, 2, is_alone=False)
    assert (sources.received, sources.lost) == (1, 1)


def test_messages_older_than_the_history_are_lost() -> None:
    sources = new_publisher(history=3)
    assert sources.is_early(5), "its history brings this message again"
    for seq in (8, 9, 10):
        assert sources.count_message(5, seq, is_alone=True)
    assert sources.advance_to(5, 10)
    assert (sources.received, sources.lost) == (3, 7)


def test_history_that_arrives_after_a_renewal_is_counted_as_received() -> None:
    sources = new_publisher(history=3)
    sources.expect_up_to(5, 9)
    sources.expect_up_to(5, 9)
    assert sources.lost == 9
    assert sources.is_early(5), "its history brings this message again"
    for seq in (8, 9, 10):
        assert sources.count_message(5, seq, is_alone=True)
    assert (sources.received, sources.lost) == (3, 7)


def test_unregistered_pattern_expects_no_messages_of_a_new_publisher() -> None:
    def new_socket(spec: SubscriberSpec) -> SubSocket:
        return SubSocket(context.socket(zmq.SUB), spec)

    def new_remote(publisher: int) -> RemotePublisher:
        return RemotePublisher(PublisherRecord(publisher, "t", "json", "json"), "n", "name")

    spec = SubscriberSpec(1, "*", "json", Hybrid("127.0.0.1:0"), None, is_pattern=True)
    io = IoThread("nep-io-test")
    io.start()
    with zmq.Context() as context:
        sockets = TopicSockets(new_socket, spec)
        pattern = NativeSubscriber(sockets, io, spec, lambda _id: None)
        pattern.expect_all_messages(new_remote(5))
        pattern.connect_listed(())
        pattern.expect_all_messages(new_remote(6))
        assert [list(each.sources.by_id) for each in sockets.sockets] == [[6]]
        pattern.close()
    io.close()


def test_existing_publisher_is_counted_from_its_first_received_message() -> None:
    sources = PublisherTracker()
    sources.expect_up_to(5, 100)
    sources.expect_up_to(5, 100)
    assert sources.count_message(5, 101, is_alone=False)
    sources.expect_all_messages(5)
    assert (sources.received, sources.lost) == (1, 0)


def test_impossible_first_sequence_number_is_rejected_and_not_counted() -> None:
    sources = new_publisher()
    assert not sources.advance_to(5, MAX_GAP + 1)
    assert sources.lost == 0


@pytest.fixture
def closed_port() -> Iterator[str]:
    """Endpoint that rejects connections and stays reserved."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        yield f"tcp://127.0.0.1:{held.getsockname()[1]}"


class UnreachablePublisher:
    """Publisher that no subscriber can connect to."""

    def __init__(self, master: Attacker, endpoint: str) -> None:
        self._master = master
        self.node = NodeRecord(derive_node_id(KEY), "publisher", "host", 1, key=KEY)
        self.record = PublisherRecord(derive_id(KEY, 1), "t", "json", "json", (endpoint,), number=1)
        self._epoch = 0

    def register(self) -> None:
        answer = self._master.ask(AddPublisher(self.node, self.record))
        assert isinstance(answer, AddedReply)
        self._epoch = answer.epoch

    def renew(self, last_seq: int) -> None:
        counts = (PublisherCount(self.record.id, last_seq, 0, last_seq),)
        self._master.ask(Renew(self.node.id, self._epoch, 0, counts))

    def close(self, last_seq: int) -> None:
        self._master.ask(RemovePublisher(self.node.id, self.record.id, last_seq))


@pytest.mark.parametrize("topic", ["t", "*"])
def test_all_messages_of_an_unreachable_new_publisher_are_lost(closed_port: str, topic: str) -> None:
    with Master("127.0.0.1:0") as master, nep.node("s", master=master.address) as node:
        subscriber = node.new_sub(topic)
        with attacker_at(master) as connection:
            publisher = UnreachablePublisher(connection, closed_port)
            publisher.register()

            def is_lost() -> bool:
                publisher.renew(100)  # its lease must not expire
                return subscriber.lost == 100

            eventually(is_lost)
            publisher.close(130)
            eventually(lambda: subscriber.lost == 130)
        assert subscriber.received == 0
