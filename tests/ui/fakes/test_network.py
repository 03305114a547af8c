"""Tests that the fake network and the real network deliver the same events and messages."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Protocol

import pytest

import nep
from app.core.network.source import GraphReceived, JobFailed, LiveSource, MasterFound, Source
from nep.masters.master import Master
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from tests.blocks.fakes import until
from tests.ui.fakes.network import Network


class World(Protocol):
    """Network with a program that publishes, and what Studio receives from it."""

    source: Source
    events: list[object]
    heard: list[tuple[str, object]]

    def begin(self) -> None:
        """Start Studio's connection; the master reports that the program publishes /a."""

    def send(self, payload: object) -> None:
        """Publish on /a; return when all subscribers have received the message."""

    def listens(self, listens: bool) -> bool:
        """Wait until Studio is, or is not, subscribed to /a; return True on success."""


class RealWorld:
    """Real network with sockets and a master."""

    def __init__(self, master: Master) -> None:
        self.events: list[object] = []
        self.heard: list[tuple[str, object]] = []
        self.source = LiveSource(master.address, [self._take, self._take], self.events.append)
        self.node = nep.node("talker", master=master.address)
        self.publisher = self.node.new_pub("/a", "json")
        self._sent = 0

    def _take(self, topic: str, messages: Sequence[Message]) -> None:
        self.heard += [(topic, message.payload) for message in messages]

    def begin(self) -> None:
        self.source.start()
        until(
            lambda: any(isinstance(each, GraphReceived) and "/a" in each.view.topics for each in self.events)
        )

    def send(self, payload: object) -> None:
        before = len(self.heard)
        self.publisher.publish(payload)
        if self.publisher.subscribers:
            until(lambda: len(self.heard) == before + 2)

    def listens(self, listens: bool) -> bool:
        until(lambda: (self.publisher.subscribers == 1) is listens)
        return True

    def close(self) -> None:
        self.source.close()
        self.node.close()


class MadeUpWorld:
    """Fake network."""

    def __init__(self) -> None:
        self.events: list[object] = []
        self.heard: list[tuple[str, object]] = []
        self.source = Network("127.0.0.1:7780", [self._take, self._take], self.events.append)

    def _take(self, topic: str, messages: Sequence[Message]) -> None:
        self.heard += [(topic, message.payload) for message in messages]

    def begin(self) -> None:
        self.source.start()
        self.source.find_master()
        self.source.tell(GraphView(1, 1))

    def send(self, payload: object) -> None:
        self.source.send(Message("/a", json.dumps(payload).encode(), "json", "json"))

    def listens(self, listens: bool) -> bool:
        return ("/a" in self.source.wanted) is listens

    def close(self) -> None:
        self.source.close()


@pytest.fixture(params=["real", "made up"])
def world(request: pytest.FixtureRequest) -> Iterator[World]:
    made = RealWorld(request.getfixturevalue("master")) if request.param == "real" else MadeUpWorld()
    yield made
    made.close()


def test_master_is_found_before_the_graph_is_reported(world: World) -> None:
    assert world.events == []
    world.begin()
    assert [type(event) for event in world.events[:2]] == [MasterFound, GraphReceived]
    assert world.events[0] == MasterFound(world.source.address)


def test_messages_of_a_watched_topic_reach_every_sink(world: World) -> None:
    world.begin()
    world.send("nobody listens")
    assert world.heard == []
    world.source.watch("/a")
    assert world.listens(True)
    world.send(1)
    world.send({"two": 2})
    assert world.heard == [("/a", 1), ("/a", 1), ("/a", {"two": 2}), ("/a", {"two": 2})]
    world.source.watch("/a")  # watching twice is one watch
    world.source.unwatch("/a")
    assert world.listens(False)
    world.send("nobody listens")
    assert len(world.heard) == 4
    world.source.unwatch("/a")  # a second unwatch has no effect


def test_lost_counts_contain_only_watched_topics(world: World) -> None:
    world.begin()
    assert world.source.lost_counts() == {}
    world.source.watch("/a")
    assert world.listens(True)
    until(lambda: world.source.lost_counts() == {"/a": 0})
    world.source.unwatch("/a")
    assert world.listens(False)
    until(lambda: world.source.lost_counts() == {})


def test_jobs_run_in_order_with_a_node_and_failures_are_reported(world: World) -> None:
    world.begin()
    done: list[object] = []

    def talk(node: Node) -> None:
        with node.new_sub("/b", "json") as ear, node.new_pub("/b", "json") as publisher:
            until(lambda: publisher.subscribers == 1)
            publisher.publish({"n": 1})
            done.append(ear.receive(20).payload)  # type: ignore[union-attr]

    def wrong(_node: Node) -> None:
        raise nep.NepError("no such thing")

    def broken(_node: Node) -> None:
        raise ValueError("no such luck")

    for what, job in (
        ("talk", talk),
        ("ask", wrong),
        ("count", broken),
        ("end", lambda _n: done.append("end")),
    ):
        world.source.submit(what, job)
    until(lambda: "end" in done)
    assert done == [{"n": 1}, "end"]
    failed = [event for event in world.events if isinstance(event, JobFailed)]
    assert failed == [JobFailed("ask", "no such thing"), JobFailed("count", "ValueError: no such luck")]
