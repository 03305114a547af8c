"""Tests with thousands of short-lived topics and with clocks that jump."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from app.core.network.source import GraphReceived
from app.core.session import Session
from app.core.storage.settings import Settings
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from tests.ui.fakes.network import Network


class Clocks:
    """Fake monotonic and wall clock of a session."""

    def __init__(self) -> None:
        self.now, self.wall_ns = 100.0, 1_700_000_000_000_000_000

    def go_on(self, seconds: float) -> None:
        self.now += seconds
        self.wall_ns += round(seconds * 1e9)


@pytest.fixture
def clocks() -> Clocks:
    return Clocks()


@pytest.fixture
def quiet(tmp_path: Path, clocks: Clocks) -> Iterator[Session]:
    session = Session(
        Settings(tmp_path),
        address="127.0.0.1:1",
        source=Network,
        journal_folder=tmp_path,
        clock=lambda: clocks.now,
        clock_ns=lambda: clocks.wall_ns,
        start_processes=False,
    )
    yield session
    session.close()


def graph(revision: int, names: Mapping[str, str], stamp_ns: int) -> GraphView:
    nodes = {node: NodeInfo(node, node, "there", 5, "python", "native", 0) for node in set(names.values())}
    one = {
        name: TopicInfo(
            name,
            "json",
            "json",
            (PublisherInfo(1, node, (), False, 1, 1, 1, 1, 1.0, 1.0),),
            rate_hz=1.0,
            last_stamp_ns=stamp_ns,
        )
        for name, node in names.items()
    }
    return GraphView(1, revision, nodes, one)


def test_10_000_short_lived_topics_and_their_nodes_are_removed_without_alerts(
    quiet: Session, clocks: Clocks
) -> None:
    post: Callable[[object], None] = quiet._mailbox.post_event
    most = 0
    for wave in range(100):
        names = {f"/short/{wave}/{number}": f"node {wave}" for number in range(100)}
        post(GraphReceived(graph(wave + 2, names, clocks.wall_ns), 0.001))
        quiet.tick()
        clocks.go_on(0.5)
        most = max(most, len(quiet.live.topics))
    assert most <= 100 * (10 / 0.5 + 3)  # removed topics are shown for only ten seconds
    post(GraphReceived(graph(1000, {}, 0), 0.001))
    quiet.tick()
    for _ in range(4):
        clocks.go_on(11.0)
        quiet.tick()
    assert len(quiet.live.topics) == len(quiet.live.nodes) == 0
    assert len(quiet.console.records) < 10_000
    assert not quiet.alerts.active


@pytest.mark.parametrize("jump_s", [-3600.0, 3600.0, -1e9])
def test_clock_jump_causes_no_negative_age_no_removed_topic_and_no_alert(
    quiet: Session, clocks: Clocks, jump_s: float
) -> None:
    names = {"/steady": "steady"}
    quiet._mailbox.post_event(GraphReceived(graph(2, names, clocks.wall_ns), 0.001))
    quiet.tick()
    clocks.wall_ns += round(jump_s * 1e9)
    for number in range(5):
        clocks.go_on(0.5)
        quiet._mailbox.post_event(GraphReceived(graph(2, names, clocks.wall_ns), 0.001))
        quiet.tick()
        age = quiet.live.topics["/steady"].age_s
        assert age is not None, number
        assert age >= 0.0
    assert quiet.live.topics["/steady"].gone_s is None
    assert not quiet.alerts.active
