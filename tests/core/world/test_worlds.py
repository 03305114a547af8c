"""Tests of worlds: watching topics, and showing another world than the live one."""

from __future__ import annotations

import pytest

from app.core.network.mailbox import Batch
from app.core.world.shown import ShownWorld
from app.core.world.world import World
from nep.messages.message import Message


class RecordedWorld(World):
    """World that records its calls; its threads end when the test sets `is_stopped`."""

    def __init__(self, *, is_failing: bool = False) -> None:
        super().__init__()
        self.calls: list[str] = []
        self.is_stopped, self._is_failing = False, is_failing

    def start(self) -> None:
        self.calls.append("start")

    def tick(self) -> None:
        self.calls.append("tick")

    def check(self) -> None:
        self.calls.append("check")

    def request_stop(self) -> None:
        self.calls.append("request_stop")

    @property
    def has_ended(self) -> bool:
        return self.is_stopped

    def close(self) -> None:
        self.calls.append("close")
        if self._is_failing:
            raise OSError

    def subscribe(self, topic: str) -> None:
        self.calls.append(f"subscribe {topic}")

    def unsubscribe(self, topic: str) -> None:
        self.calls.append(f"unsubscribe {topic}")


def batch(topic: str) -> Batch:
    return Batch([Message(topic, b"{}", "json", "json", stamp_ns=1, seq=1, publisher=1)])


@pytest.fixture
def live() -> RecordedWorld:
    return RecordedWorld()


@pytest.fixture
def shown(live: RecordedWorld) -> ShownWorld:
    return ShownWorld(live)


def test_topic_of_a_world_is_subscribed_once_and_receives_only_while_it_is_watched() -> None:
    world = RecordedWorld()
    world.add("/faces", batch("/faces"))
    assert world.topic("/faces") is None
    with world.watch("/faces"), world.watch("/faces"):
        world.add("/faces", batch("/faces"))
        topic = world.topic("/faces")
        assert topic is not None
        assert (topic.received, topic.is_watched) == (1, True)
    assert world.calls == ["subscribe /faces", "unsubscribe /faces"]
    assert not world.is_watched("/faces")


def test_plain_world_is_empty_and_not_live() -> None:
    world = World()
    assert (world.is_live, world.all_topics, world.all_nodes, world.graph) == (False, [], [], None)
    assert not world.console.records


def test_shown_world_is_started_updated_and_stopped_while_the_live_world_is_left_alone(
    live: RecordedWorld, shown: ShownWorld
) -> None:
    assert shown.world is live
    world = RecordedWorld()
    shown.show(world)
    shown.show(world)  # without effect
    shown.tick()
    shown.check()
    assert world.calls == ["start", "tick", "check"]
    shown.show(live)
    shown.tick()
    shown.check()
    assert world.calls[3:] == ["request_stop"]
    assert live.calls == []


def test_revision_increases_with_each_shown_world_and_each_change_of_it(
    live: RecordedWorld, shown: ShownWorld
) -> None:
    world = World()
    shown.show(world)
    assert shown.revision == 1
    shown.tick()
    assert shown.revision == 1
    world.revision += 1
    shown.tick()
    shown.tick()
    assert shown.revision == 2
    shown.show(live)
    assert shown.revision == 3


def test_close_closes_all_worlds_that_have_not_ended_even_if_one_raises(
    live: RecordedWorld, shown: ShownWorld
) -> None:
    ended, failing, open_world = RecordedWorld(), RecordedWorld(is_failing=True), RecordedWorld()
    ended.is_stopped = True
    for world in (ended, failing, open_world):
        shown.show(world)
    shown.close()
    assert shown.world is live
    assert ended.calls == ["start", "request_stop"]
    assert failing.calls == open_world.calls == ["start", "request_stop", "close"]
    assert live.calls == []
