"""Tests of the sockets of a pattern's topics: polling as one descriptor, turns, limits and statistics."""

from __future__ import annotations

import asyncio
import select
import sys
import threading
from collections.abc import Iterator

import pytest

import nep
from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import PublisherTracker
from nep.backends.bases.message_parser import MessageBuffer
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.connection import Hybrid
from nep.backends.zeromq import topic_sockets
from nep.backends.zeromq.topic_sockets import DescriptorGroup, EpollGroup, ThreadGroup, TopicSockets
from nep.masters.master import Master
from nep.messages.message import Message
from nep.protocol.requests import RemotePublisher
from nep.system.wakeup import Waker
from tests.nep.programs import eventually


class FakeSocket:
    """Socket of one topic. Like ZMQ_FD, its descriptor signals messages only until input is checked."""

    def __init__(self, spec: SubscriberSpec) -> None:
        self.spec = spec
        self.sources = PublisherTracker()
        self.rejections = RejectionCounter()
        self.waker = Waker()
        self.fd = self.waker.fd
        self.messages: list[Message] = []
        self.received, self.lost = 0, 0
        self.problem = ""
        self.is_closed = False

    def put(self, *payloads: int) -> None:
        self.messages += [Message(self.spec.topic, b"%d" % each, "json", "json") for each in payloads]
        self.waker.wake()

    @property
    def has_input(self) -> bool:
        self.waker.clear()
        return bool(self.messages)

    def read_into(
        self, buffer: MessageBuffer, max_messages: int, max_bytes: int, *, may_wait: bool = False
    ) -> int:
        self.waker.clear()
        count = min(max_messages, len(self.messages))
        buffer.extend(self.messages[:count])
        del self.messages[:count]
        self.received += count
        return count

    def connect(self, remote: RemotePublisher) -> None:
        self.sources.add_listed(remote)

    def disconnect(self, publisher: int) -> None:
        self.sources.pop(publisher)

    def reconnect_remote(self) -> None:
        """Do nothing."""

    def reconnect(self, publisher: int) -> None:
        """Do nothing."""

    def count_dropped(self, count: int) -> None:
        """Do nothing."""

    def close(self) -> None:
        self.is_closed = True
        self.waker.close()


class Topics:
    """`TopicSockets` with fake sockets by topic."""

    def __init__(self) -> None:
        self.by_topic: dict[str, FakeSocket] = {}
        spec = SubscriberSpec(1, "*", "json", Hybrid("127.0.0.1:0"), None, is_pattern=True)
        self.sockets = TopicSockets(self._new_socket, spec)

    def _new_socket(self, spec: SubscriberSpec) -> FakeSocket:
        assert not spec.is_pattern
        socket = self.by_topic[spec.topic] = FakeSocket(spec)
        return socket

    def open(self, topic: str) -> FakeSocket:
        assert self.sockets.open(topic) is self.by_topic[topic]
        return self.by_topic[topic]

    def read(self, max_messages: int = 10_000, max_bytes: int = 1000) -> list[tuple[str, object]]:
        messages: list[Message] = []
        assert self.sockets.read_into(messages, max_messages, max_bytes) == len(messages)
        return [(each.topic, each.payload) for each in messages]


@pytest.fixture
def topics() -> Iterator[Topics]:
    made = Topics()
    yield made
    made.sockets.close()
    assert all(each.is_closed for each in made.by_topic.values())


GROUPS = [
    pytest.param(
        EpollGroup, marks=pytest.mark.skipif(sys.platform != "linux", reason="only Linux has epoll")
    ),
    ThreadGroup,
]


def is_readable(fd: int, timeout_s: float) -> bool:
    return bool(select.select([fd], [], [], timeout_s)[0])


@pytest.mark.parametrize("new_group", GROUPS)
def test_group_is_readable_while_one_of_its_descriptors_is(new_group: type[DescriptorGroup]) -> None:
    group, one, other = new_group(), Waker(), Waker()
    group.add(one.fd)
    group.add(other.fd)
    assert not is_readable(group.fd, 0.0)
    other.wake()
    for _repetition in range(3):
        assert is_readable(group.fd, 30.0)
        assert list(group.take_readable()) == [other.fd]
    one.wake()
    found: set[int] = set()
    while found != {one.fd, other.fd}:
        assert is_readable(group.fd, 30.0)
        found |= set(group.take_readable())
    one.clear()
    group.remove(other.fd)
    eventually(lambda: not group.take_readable() and not is_readable(group.fd, 0.0))
    one.wake()
    assert is_readable(group.fd, 30.0)
    assert list(group.take_readable()) == [one.fd]
    group.close()
    for waker in (one, other):
        waker.close()


def test_thread_of_a_closed_group_ends() -> None:
    group = ThreadGroup()
    group.close()
    eventually(lambda: not any(each.name == "nep-topics" for each in threading.enumerate()))


def test_topics_are_read_in_turn(topics: Topics) -> None:
    busy, quiet = topics.open("busy"), topics.open("quiet")
    busy.put(*range(100))
    quiet.put(7)
    first, second = topics.read(50), topics.read(50)
    assert len(first) == len(second) == 50
    assert ("quiet", 7) in first + second
    assert sorted(topics.read(), key=str) == [("busy", 99)]
    assert topics.read() == []


def test_rest_of_a_topic_is_read_without_another_signal(topics: Topics) -> None:
    topics.open("a").put(1, 2, 3)
    assert topics.read(2) == [("a", 1), ("a", 2)]
    assert not is_readable(topics.sockets.fd, 0.0)
    assert topics.sockets.has_input
    assert topics.read() == [("a", 3)]
    assert not topics.sockets.has_input


def test_socket_that_lost_its_signal_is_read_after_a_recheck(topics: Topics) -> None:
    socket = topics.open("a")
    socket.put(1)
    assert socket.has_input
    assert not topics.sockets.has_input
    topics.sockets.recheck(socket)
    assert topics.read() == [("a", 1)]


def test_reading_stops_at_the_limit_of_bytes(topics: Topics) -> None:
    topics.open("a").put(1, 2, 3)
    topics.open("b").put(4)
    assert len({topic for topic, _payload in topics.read(max_bytes=1)}) == 1


def test_counters_contain_closed_topics_and_dropped_messages(topics: Topics) -> None:
    kept, unused = topics.open("kept"), topics.open("unused")
    kept.sources.expect_all_messages(5)
    kept.put(1)
    unused.put(2, 3)
    unused.lost = 4
    topics.sockets.close_unused()
    assert not unused.is_closed, "its messages aren't read yet"
    topics.read()
    topics.sockets.close_unused()
    assert (kept.is_closed, unused.is_closed) == (False, True)
    topics.sockets.count_dropped(1)
    assert (topics.sockets.received, topics.sockets.lost) == (2, 5)
    assert [each.fd for each in topics.sockets.sockets] == [kept.fd]
    assert topics.sockets.find("unused") is None


def test_rejected_messages_of_all_topics_are_counted_together(topics: Topics) -> None:
    for topic in ("a", "b"):
        topics.open(topic).rejections.add(topic)
    assert topics.sockets.rejections.count == 2


def test_topics_beyond_the_limit_are_reported_until_one_can_be_opened(
    topics: Topics, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(topic_sockets, "_MAX_TOPICS", 1)
    socket = topics.open("a")
    assert topics.sockets.open("b") is None
    assert topics.sockets.open("a") is socket
    assert "already subscribed to 1 topics" in topics.sockets.problem
    topics.sockets.close_unused()
    topics.open("b").problem = "unreachable"
    assert topics.sockets.problem == "unreachable"


@pytest.mark.usefixtures("patient")
def test_pattern_receives_through_the_polling_thread_of_systems_without_epoll(
    master: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(topic_sockets, "_new_descriptor_group", ThreadGroup)
    sunk: list[object] = []
    called: list[object] = []
    with nep.node("a") as node, nep.node("b") as other:
        sub, _sink = node.new_sub("t/*"), node.new_sub("t/**", sink=sunk.extend)

        def callback(payload: object) -> None:
            called.append(payload)
            if len(called) == 100:
                node.stop_spin()

        node.new_callback("*/*", "json", callback)
        pubs = [other.new_pub(f"t/{n}") for n in range(10)]
        for number in range(100):
            pubs[number % 10].publish(number)
        received = [sub.listen(timeout_s=30.0) for _each in range(50)]
        assert all(is_received for is_received, _payload in received)
        node.spin(30.0)
        assert sorted(map(int, map(str, called))) == list(range(100))
        eventually(lambda: len(sunk) == 100)
        pubs[0].publish("last")

        async def read_rest() -> object:
            while True:
                message = await sub.receive_async(30.0)
                assert message is not None
                if message.payload == "last":
                    return message.topic

        assert asyncio.run(read_rest()) == "t/0"
        assert (sub.received, sub.lost) == (101, 0)
