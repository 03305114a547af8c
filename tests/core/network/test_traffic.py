"""Tests of the counts of sent and shown messages over the last 30 s."""

from __future__ import annotations

from collections.abc import ValuesView

from msgspec.structs import replace

from app.core.network.mailbox import Batch
from app.core.network.topics import MAX_TOPICS_PER_UPDATE, Topics
from app.core.network.traffic import WINDOW_S, RecentLosses, Traffic
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, PublisherInfo, TopicInfo


def batch(kept: int, dropped: int) -> Batch:
    return Batch([Message("/a", b"{}", "json", "json", seq=n) for n in range(kept)], dropped)


def test_dropped_and_lost_messages_count_as_sent_but_not_shown() -> None:
    topics = Topics()
    traffic = Traffic(topics)
    topics.add("/a", batch(2, 5), 1.0)
    traffic.add({"/a": batch(2, 5), "/b": batch(1, 0)}, 1.0)
    assert (traffic.shown_30s, traffic.sent_30s) == (3, 8)
    traffic.count_lost({"/a": 10, "/unknown": 99}, 2.0)
    traffic.count_lost({"/a": 14}, 3.0)
    assert (traffic.shown_30s, traffic.sent_30s) == (3, 22)
    assert topics["/a"].displayed_and_sent_counts == (2, 7 + 14)


def test_only_last_30_seconds_are_counted() -> None:
    traffic = Traffic(Topics())
    traffic.add({"/a": batch(1, 1)}, 0.0)
    traffic.add({"/a": batch(2, 0)}, 20.0)
    traffic.add({}, 1.0 + WINDOW_S)
    assert (traffic.shown_30s, traffic.sent_30s) == (2, 2)
    traffic.add({}, 21.0 + WINDOW_S)
    assert (traffic.shown_30s, traffic.sent_30s) == (0, 0)


def test_new_subscription_counts_from_zero() -> None:
    topics = Topics()
    traffic = Traffic(topics)
    topics.add("/a", batch(1, 0), 0.0)
    traffic.count_lost({"/a": 7}, 0.0)
    topics.unwatch("/a")
    topics.add("/a", batch(1, 0), 1.0)
    traffic.count_lost({"/a": 2}, 1.0)
    assert topics["/a"].displayed_and_sent_counts == (1, 3)
    assert traffic.sent_30s == 9


def test_network_stats_are_read_from_the_graph() -> None:
    traffic = Traffic(Topics())
    one = PublisherInfo(1, "n1", (), False, 5, 50, 5, 1, 10.0, 100.0)

    def view(lost: int) -> GraphView:
        return GraphView(1, 1, {}, {"/a": TopicInfo("/a", "json", "json", (one,), lost=lost, rate_hz=10.0)})

    traffic.update_graph(view(4), 0.0)
    assert (traffic.messages_per_s, traffic.lost_30s) == (10.0, 0)
    traffic.update_graph(view(9), 1.0)
    assert traffic.lost_30s == 5


class Counted(dict[str, TopicInfo]):
    """Dictionary of topics that counts complete iterations."""

    times = 0

    def values(self) -> ValuesView[TopicInfo]:
        self.times += 1
        return super().values()


def test_stats_of_many_topics_are_summed_twice_a_second_including_the_last_update() -> None:
    traffic = Traffic(Topics())
    one = TopicInfo("/a", "json", "json", lost=1, rate_hz=2.0)
    views = [
        GraphView(
            1, 1, {}, Counted({f"/{n}": replace(one, lost=told) for n in range(MAX_TOPICS_PER_UPDATE + 1)})
        )
        for told in range(1, 21)
    ]
    for number, view in enumerate(views):
        traffic.update_graph(view, number / 20)
        traffic.add({}, number / 20)
    went = sum(view.topics.times for view in views if isinstance(view.topics, Counted))
    assert 4 <= went <= 6  # each update takes one pass for losses and one for rates
    traffic.add({}, 2.0)
    assert traffic.messages_per_s == 2.0 * (MAX_TOPICS_PER_UPDATE + 1)
    assert traffic.lost_30s == 19 * (MAX_TOPICS_PER_UPDATE + 1)


def test_only_recent_losses_are_counted() -> None:
    losses = RecentLosses()
    assert losses.count(100, 0.0) == 0  # lost before the first count
    assert losses.count(103, 1.0) == 3
    assert losses.count(105, 20.0) == 5
    assert losses.count(105, 1.5 + WINDOW_S) == 2
    assert losses.count(105, 21.0 + WINDOW_S) == 0


def test_removed_topic_is_excluded_from_total_losses() -> None:
    losses = RecentLosses()
    losses.count(10, 0.0)
    assert losses.count(0, 1.0) == 0
    assert losses.count(2, 2.0) == 2
