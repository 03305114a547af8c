"""Tests of the live source: the name of its node, missed messages, and retries without a master."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import nep
from app.core.network.source import GraphReceived, JobFailed, LiveSource, MasterFound, MasterLost, WatchFailed
from nep.masters.master import Master
from nep.masters.process import view_or_none
from nep.nodes.log_handler import LOG_TOPIC, LOG_TYPE
from tests.e2e.waiting import until


@pytest.fixture
def events() -> list[object]:
    return []


@pytest.fixture
def sources(master: Master, events: list[object]) -> Iterator[list[LiveSource]]:
    made: list[LiveSource] = []

    yield made
    for source in made:
        source.close()


def begin(address: str, events: list[object], made: list[LiveSource]) -> LiveSource:
    source = LiveSource(address, [], events.append, permanent_topics={LOG_TOPIC: LOG_TYPE})
    made.append(source)
    source.start()
    return source


def names(address: str) -> list[str]:
    view = view_or_none(address)
    return sorted(node.name for node in view.nodes.values()) if view is not None else []


def test_second_studio_has_unique_node_name(
    master: Master, events: list[object], sources: list[LiveSource]
) -> None:
    for wanted in (["studio"], ["studio", "studio 2"], ["studio", "studio 2", "studio 3"]):
        begin(master.address, events, sources)
        until(lambda wanted=wanted: names(master.address) == wanted, f"{wanted} are there")
    assert not master.view().alerts
    sources[1].close()
    until(lambda: names(master.address) == ["studio", "studio 3"], "the second left")
    begin(master.address, events, sources)
    until(lambda: names(master.address) == ["studio", "studio 2", "studio 3"], "its name is used again")


def test_missing_master_is_reported_once(events: list[object]) -> None:
    source = LiveSource("127.0.0.1:1", [], events.append)
    source.start()
    try:
        until(lambda: events, "it is told")
    finally:
        source.close()
    assert [type(event) for event in events] == [MasterLost]


def test_lost_messages_are_counted_from_start_of_watch(
    master: Master, events: list[object], sources: list[LiveSource]
) -> None:
    source = begin(master.address, events, sources)
    with nep.node("talker") as node:
        publisher = node.new_pub("/a", "json")
        source.watch("/a")
        until(lambda: publisher.subscribers == 1, "it listens")
        publisher.publish(1)
        until(lambda: source.lost_counts().get("/a") == 0, "nothing was lost")
        _, subscriber = source._subscribers["/a"]
        subscriber._transport._readable.sources.lost += 5  # as after an overrun in libzmq
        assert source.lost_counts()["/a"] == 5
        source.watch("/a")  # a new watch counts losses from zero
        assert source.lost_counts()["/a"] == 0
        source.unwatch("/a")
        until(lambda: "/a" not in source.lost_counts(), "nobody looks")
    assert {MasterFound, GraphReceived} <= {type(event) for event in events}
    assert not [event for event in events if isinstance(event, WatchFailed | JobFailed)]
