"""Tests of the list of topics: new, live and vanished ones; newest messages only while watched."""

from __future__ import annotations

from itertools import count

from msgspec.structs import replace

from app.core.network.mailbox import Batch
from app.core.network.topics import (
    GONE_DISPLAY_S,
    MIN_REPORTED_SILENCE_S,
    START_GRACE_S,
    Topics,
    total_rate_hz,
)
from nep.messages.clocks import ClockDifference, PublisherClock
from nep.messages.message import Message, message_kind
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

NODE = NodeInfo("n1", "camera_driver", "here", 5, "python", "native", 0)


def publisher(rate: float | None = 10.0) -> PublisherInfo:
    return PublisherInfo(1, "n1", (), False, 5, 50, 5, 1_000_000_000, rate, 100.0)


def info(name: str, *, publishers: int = 1, **values: object) -> TopicInfo:
    given = {"rate_hz": 10.0, "bandwidth_Bps": 100.0, "last_stamp_ns": 1_000_000_000, **values}
    return TopicInfo(name, "json", "json", tuple(publisher() for _ in range(publishers)), **given)  # type: ignore[arg-type]


REVISIONS = count(100)


def view(*topics: TopicInfo, revision: int | None = None) -> GraphView:
    """Return a graph of these topics, with a new revision unless one is given."""
    number = next(REVISIONS) if revision is None else revision
    return GraphView(1, number, {"n1": NODE}, {topic.name: topic for topic in topics})


def message(number: int, data: bytes = b"{}", stamp_ns: int | None = None) -> Message:
    return Message("/a", data, "json", "json", seq=number, stamp_ns=stamp_ns)


def test_topics_added_after_the_first_graph_are_marked_new_until_seen() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    topics.update(view(info("/a"), info("/b")), 1)
    assert [topic.is_new for topic in topics] == [False, True]
    topics.mark_seen("/b")
    assert not topics["/b"].is_new


def test_topic_stats_and_publisher_nodes_come_from_the_graph() -> None:
    topics = Topics()
    topics.update(view(info("/a", rate_hz=30.0, lost=3, loss_ratio=0.1)), 0)
    topic = topics["/a"]
    assert (topic.rate_hz, topic.bandwidth_Bps, topic.lost, topic.loss_ratio) == (30.0, 100.0, 3, 0.1)
    assert topic.publisher_nodes == ("camera_driver",)
    topics.update_ages(0, 1_500_000_000)
    assert topic.age_s == 0.5


def test_removed_topic_stays_listed_for_ten_seconds_without_stats() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    topics.update(view(), 5)
    topics.update_ages(9, 0)
    assert topics["/a"].gone_s == 4
    assert (topics["/a"].rate_hz, topics["/a"].age_s, topics["/a"].publishers) == (None, None, 0)
    assert topics.existing_topics() == []
    topics.update_ages(5 + GONE_DISPLAY_S, 0)
    assert len(topics) == 0


def test_removed_watched_topic_is_unlisted_and_can_reappear() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    topics["/a"].is_watched = True
    topics.update(view(), 5)
    topics.update_ages(5 + GONE_DISPLAY_S, 0)
    before = topics.revision
    topics.update_ages(6 + GONE_DISPLAY_S, 0)
    assert (len(topics), list(topics), topics.revision) == (0, [], before)
    assert topics.get("/a") is not None, "whoever looks at it keeps it"
    topics.update(view(info("/a")), 30)
    assert [topic.name for topic in topics] == ["/a"]
    topics.update(view(), 40)
    topics.update_ages(40 + GONE_DISPLAY_S, 0)
    topics.unwatch("/a")
    topics.update_ages(41 + GONE_DISPLAY_S, 0)
    assert (len(topics), topics.get("/a")) == (0, None)


def test_own_subscription_does_not_keep_topic_alive() -> None:
    topics = Topics(own_process=("here", 77))
    looking = NodeInfo("n2", "studio", "here", 77, "python", "native", 0)
    there = GraphView(
        1, 1, {"n1": NODE, "n2": looking}, {"/a": info("/a", subscribers=(SubscriberInfo(9, "n2", 0, 0),))}
    )
    topics.update(there, 0)
    assert topics.existing_topics()
    left = info("/a", publishers=0, subscribers=(SubscriberInfo(9, "n2", 0, 0),))
    topics.update(GraphView(1, 2, {"n2": looking}, {"/a": left}), 1)
    assert topics.existing_topics() == []
    foreign = info(
        "/a", publishers=0, subscribers=(SubscriberInfo(9, "n2", 0, 0), SubscriberInfo(8, "n1", 0, 0))
    )
    topics.update(GraphView(1, 3, {"n1": NODE, "n2": looking}, {"/a": foreign}), 2)
    assert [topic.name for topic in topics.existing_topics()] == ["/a"]


def test_reappearing_topic_is_live_again() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    topics.update(view(), 1)
    topics.update(view(info("/a")), 2)
    assert topics["/a"].gone_s is None
    assert topics["/a"].rate_hz == 10.0


def test_rate_change_increases_only_the_revision_of_values() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    revision, values = topics.revision, topics.values_revision
    topics.update(view(info("/a", rate_hz=11.0)), 1)
    assert topics.revision == revision
    assert topics.values_revision > values


def test_newest_and_previous_message_and_arrivals_are_tracked() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    topics.add("/a", Batch([message(1)]), 1)
    topics.add("/a", Batch([message(2), message(3)], dropped=4), 2)
    topic = topics["/a"]
    assert topic.newest is not None
    assert topic.previous is not None
    assert (topic.newest.seq, topic.previous.seq, topic.received, topic.dropped) == (3, 2, 7, 4)
    topics.unwatch("/a")
    assert topic.newest is None


def test_age_without_time_stamps_counts_from_arrival() -> None:
    topics = Topics()
    topics.update(view(info("/a", last_stamp_ns=None)), 0)
    topics.add("/a", Batch([message(1)]), 10)
    topics.update_ages(12, 999)
    assert topics["/a"].age_s == 2


def test_total_rate_is_unknown_without_reported_rates() -> None:
    assert total_rate_hz([info("/a", rate_hz=None)]) is None
    assert total_rate_hz([info("/a"), info("/b", rate_hz=None)]) == 10.0


def test_graph_of_the_same_revision_updates_only_stats() -> None:
    topics = Topics()
    topics.update(view(info("/a", rate_hz=10.0), revision=7), 0)
    before = topics.revision
    topics.update(view(info("/a", rate_hz=12.0, lost=3, last_stamp_ns=2_000_000_000), revision=7), 1)
    topic = topics["/a"]
    assert (topic.rate_hz, topic.lost, topic.last_stamp_ns) == (12.0, 3, 2_000_000_000)
    assert list(topic.rates) == [10.0, 12.0]
    assert (topics.revision, topic.publisher_nodes) == (before, ("camera_driver",))


def test_many_topics_are_updated_and_aged_incrementally() -> None:
    topics = Topics()
    names = [f"/{number}" for number in range(4000)]
    topics.update(view(*map(info, names), revision=7), 0)
    topics.update(view(*[info(name, rate_hz=12.0) for name in names], revision=7), 0)
    for _ in range(3):
        topics.update_ages(0, 4_000_000_000)
    assert {(topic.age_s, topic.rate_hz) for topic in topics} == {(3.0, 12.0)}
    for _ in range(3):
        topics.update_ages(0, 5_000_000_000)
    assert {tuple(topic.rates) for topic in topics} == {(10.0, 12.0)}
    topics.update(GraphView(1, 2, {"n1": NODE}, {}), 10.0)
    for _ in range(6):
        topics.update_ages(10.0 + GONE_DISPLAY_S, 0)
    assert len(topics) == 0


def heard(
    count: int = 1, *, last_stamp_ns: int = 1_000_000_000, node: str = "n9", sender: int = 1
) -> TopicInfo:
    made = info("/a", last_stamp_ns=last_stamp_ns)
    publishers = tuple(replace(each, id=sender) for each in made.publishers)
    return replace(
        made, publishers=publishers, subscribers=tuple(SubscriberInfo(n, node, 5, 0) for n in range(count))
    )


def silence(topics: Topics, now: float) -> float | None:
    topics.update_ages(now, 90_000_000_000)
    return topics["/a"].silent_s


def test_unwatched_stream_is_not_silent() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    assert silence(topics, 1000) is None
    assert topics["/a"].age_s == 89.0, "its age is told all the same"


def test_watched_stream_is_silent_since_its_last_message() -> None:
    topics = Topics()
    topics.update(view(heard()), 10)
    topics["/a"].is_watched = True
    topics.add("/a", Batch([message(1)]), 20)
    assert silence(topics, 20.5) == 0.5
    assert silence(topics, 24) == 4.0
    topics.update(view(info("/a")), 25)
    assert silence(topics, 60) is None, "nobody looks any more"


def test_newly_watched_stream_has_grace_period() -> None:
    topics = Topics()
    topics.update(view(info("/a")), 0)
    topics.update(view(heard()), 100)
    topics["/a"].is_watched = True
    assert silence(topics, 100 + START_GRACE_S) == 0.0
    assert silence(topics, 104 + START_GRACE_S) == 4.0
    topics.update(view(heard(sender=2)), 110)
    assert silence(topics, 112) == 0.0, "another publisher has taken its place"


def test_wrong_clock_does_not_mark_a_stream_as_silent() -> None:
    topics = Topics()
    topics.update(view(heard()), 0)
    topics["/a"].is_watched = True
    topics.add("/a", Batch([message(1, stamp_ns=1)]), 8)
    topics.update_ages(8.1, 10**18)
    assert (round(topics["/a"].silent_s or 0, 3), topics["/a"].age_s) == (0.1, (10**18 - 10**9) / 1e9)


def test_silence_of_topics_received_by_other_nodes_follows_last_master_report() -> None:
    topics = Topics()
    topics.update(view(heard()), 0)
    topics.update(view(heard(last_stamp_ns=2_000_000_000), revision=5), 10)
    assert silence(topics, 60) == 0.0, "the master has gone; nobody knows"
    topics.update(view(heard(last_stamp_ns=2_000_000_000), revision=5), 10 + MIN_REPORTED_SILENCE_S)
    assert silence(topics, 60) == MIN_REPORTED_SILENCE_S


def test_topic_that_never_sent_is_not_silent() -> None:
    topics = Topics()
    never = replace(heard(), last_stamp_ns=None)
    topics.update(view(never), 0)
    topics["/a"].is_watched = True
    assert silence(topics, 100) is None


def test_message_ages_are_corrected_by_clock_offset() -> None:
    hour = 3600 * 10**9
    topics = Topics(own_process=("mine", 7))
    mine = replace(NODE, id="me", host="mine", pid=7, clock_offset_ns=2 * hour, clock_uncertainty_ns=5)
    far = replace(NODE, clock_offset_ns=-hour, clock_uncertainty_ns=5)
    seen = replace(view(info("/a")), nodes={"n1": far, "me": mine})
    topics.update(seen, 0)
    # The publisher's clock is three hours ahead of ours.
    topics.update_ages(0, 1_000_000_000 - 3 * hour + 500_000_000)
    assert topics["/a"].age_s == 0.5
    newest = message(1, stamp_ns=1_200_000_000)
    newest.kind = message_kind("/a", "json", "json", clock=PublisherClock(ClockDifference(-3 * hour, 10)))
    topics.add("/a", Batch([newest]), 0)
    topics.update_ages(0, 1_000_000_000 - 3 * hour + 500_000_000)
    assert topics["/a"].age_s == 0.3


def test_newest_message_of_publishers_on_two_computers_counts() -> None:
    topics = Topics(own_process=("mine", 7))
    mine = replace(NODE, id="me", host="mine", pid=7, clock_offset_ns=0)
    far = replace(NODE, clock_offset_ns=-(10**12))
    near = replace(publisher(), id=2, node_id="me", last_stamp_ns=4_000_000_000)
    both = replace(info("/a"), publishers=(replace(publisher(), last_stamp_ns=10**12), near))
    topics.update(replace(view(both), nodes={"n1": far, "me": mine}), 0)
    topics.update_ages(0, 4_250_000_000)
    assert topics["/a"].age_s == 0.25


def test_ages_are_not_corrected_without_own_clock_offset() -> None:
    topics = Topics(own_process=("mine", 7))
    far = replace(NODE, clock_offset_ns=-(10**12))
    topics.update(replace(view(info("/a")), nodes={"n1": far}), 0)
    topics.update_ages(0, 1_500_000_000)
    assert topics["/a"].age_s == 0.5
