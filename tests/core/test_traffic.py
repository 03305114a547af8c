"""What was shown of what was sent: exact, and only of the last 30 s."""

from __future__ import annotations

from app.core.losses import WINDOW_S
from app.core.mailbox import Batch
from app.core.topics import Topics
from app.core.traffic import Traffic
from nep.message import Message
from nep.views import GraphView, PublisherInfo, TopicInfo


def batch(kept: int, dropped: int) -> Batch:
    return Batch([Message("/a", b"{}", "json", "json", seq=n) for n in range(kept)], dropped)


def test_what_was_dropped_and_what_never_arrived_count_as_sent_and_not_shown() -> None:
    topics = Topics()
    traffic = Traffic(topics)
    topics.add("/a", batch(2, 5), 1.0)
    traffic.add({"/a": batch(2, 5), "/b": batch(1, 0)}, 1.0)
    assert (traffic.shown_30s, traffic.sent_30s) == (3, 8)
    traffic.miss({"/a": 10, "/unknown": 99}, 2.0)
    traffic.miss({"/a": 14}, 3.0)
    assert (traffic.shown_30s, traffic.sent_30s) == (3, 22)
    assert topics["/a"].shown_of == (2, 7 + 14)


def test_only_the_last_half_minute_counts() -> None:
    traffic = Traffic(Topics())
    traffic.add({"/a": batch(1, 1)}, 0.0)
    traffic.add({"/a": batch(2, 0)}, 20.0)
    traffic.add({}, 1.0 + WINDOW_S)
    assert (traffic.shown_30s, traffic.sent_30s) == (2, 2)
    traffic.add({}, 21.0 + WINDOW_S)
    assert (traffic.shown_30s, traffic.sent_30s) == (0, 0)


def test_a_subscription_that_begins_anew_counts_from_nothing() -> None:
    topics = Topics()
    traffic = Traffic(topics)
    topics.add("/a", batch(1, 0), 0.0)
    traffic.miss({"/a": 7}, 0.0)
    topics.unwatch("/a")
    topics.add("/a", batch(1, 0), 1.0)
    traffic.miss({"/a": 2}, 1.0)
    assert topics["/a"].shown_of == (1, 3)
    assert traffic.sent_30s == 9


def test_the_figures_of_the_network_come_from_the_graph() -> None:
    traffic = Traffic(Topics())
    one = PublisherInfo(1, "n1", (), False, 5, 50, 5, 1, 10.0, 100.0)

    def view(lost: int) -> GraphView:
        return GraphView(1, 1, {}, {"/a": TopicInfo("/a", "json", "json", (one,), lost=lost, rate_hz=10.0)})

    traffic.follow(view(4), 0.0)
    assert (traffic.messages_per_s, traffic.lost_30s) == (10.0, 0)
    traffic.follow(view(9), 1.0)
    assert traffic.lost_30s == 5
