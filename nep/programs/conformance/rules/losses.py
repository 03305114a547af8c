"""Rules for counting lost messages."""

from __future__ import annotations

from msgspec.structs import replace

from nep.i18n import lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.ports import closed_port
from nep.programs.conformance.rule import rule
from nep.programs.conformance.verdict import expect

_SECTION = "notices"


def _expect_counts(bench: Bench, sub: int, received: int, lost: int) -> None:
    """Check that the counts of the adapter's subscriber reach the expected values within 2 s."""
    bench.require(lambda: len(bench.events(sub)) >= received, "message")
    for _turn in range(40):
        if bench.counts(sub) == (received, lost):
            return
        bench.wait(0.05)
    expect("received, lost", bench.counts(sub), (received, lost))


def _report_last_seq(bench: Bench, publisher: int, seq: int) -> None:
    """Let the master report a publisher's last sequence number in three replies to renewals.

    From the second reply on, missing messages count as lost.
    """
    bench.master.reply_filter = lambda _request, reply: (
        {**reply, "what": {**reply["what"], "last_seqs": {publisher: seq}}}
        if reply["is"] == "renewed"
        else reply
    )
    for _turn in range(3):
        bench.wait_for_renewal(len(bench.master.received))


@rule(
    "lost-gap",
    lazy("Gaps in seq count as lost; messages before the first received one don't."),
    _SECTION,
    "losses",
)
def _lost_gap(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher = bench.create_publisher(topic, should_echo=False)
    publisher.seq = 100
    sub = bench.new_sub(topic)
    publisher.send(b"1")
    publisher.send(b"1", seq=105)
    publisher.send(b"1", seq=106)
    _expect_counts(bench, sub, 3, 3)


@rule(
    "lost-echo",
    lazy("Messages missing between the last received one and an echo count as lost."),
    _SECTION,
    "losses",
)
def _lost_echo(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b"1")
    publisher.seq = 5
    publisher.send_echo(next(iter(publisher.hellos)))
    publisher.send(b"1")
    _expect_counts(bench, sub, 2, 4)


@rule(
    "lost-bye",
    lazy("Messages missing between the last received one and a bye count as lost."),
    _SECTION,
    "losses",
)
def _lost_bye(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b"1")
    publisher.seq = 4
    publisher.send_byes()
    _expect_counts(bench, sub, 1, 3)


@rule(
    "lost-last-seq",
    lazy("Messages missing up to the 'last_seqs' of the previous renewal count as lost."),
    _SECTION,
    "losses",
)
def _lost_last_seq(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b"1")
    bench.require(lambda: bool(bench.events(sub)), "message")
    _report_last_seq(bench, publisher.id, 3)
    _expect_counts(bench, sub, 1, 2)


@rule(
    "lost-late",
    lazy("Messages counted as lost because of 'last_seqs' no longer count once they are received."),
    _SECTION,
    "losses",
)
def _lost_late(bench: Bench) -> None:
    _lost_last_seq(bench)
    (publisher,) = bench.publishers
    publisher.send(b"1", seq=2)
    publisher.send(b"1", seq=3)
    (sub,) = {int(each["sub"]) for each in bench.adapter.events}
    _expect_counts(bench, sub, 3, 0)


@rule(
    "lost-leap",
    lazy("A message whose seq jumps by more than 2^32 is rejected without counting losses."),
    _SECTION,
    "losses",
)
def _lost_seq_jump(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b"1")
    publisher.send(b"1", seq=2**40)
    publisher.send(b"1", seq=2)
    _expect_counts(bench, sub, 2, 0)


@rule(
    "lost-new",
    lazy("Losses count from seq 1 only for publishers whose 'publisher+' has 'is_new'."),
    "closing-a-publisher",
    "losses",
)
def _lost_from_new_publisher(bench: Bench) -> None:
    topic = bench.new_topic()
    sub = bench.new_sub(topic)
    new_publisher, rejoined_publisher = (
        bench.create_publisher(topic, should_echo=False),
        bench.create_publisher(topic, is_listed=False),
    )
    bench.require(lambda: bool(new_publisher.hellos), "hello")
    new_publisher.send(b"1", seq=5)
    _expect_counts(bench, sub, 1, 4)
    rejoined_publisher.seq = 100
    # The pushes lack `is_new`.
    bench.master.repeat_pushes(bench.node_id, rejoined_publisher.record, rejoined_publisher.node)
    bench.require(lambda: bool(rejoined_publisher.hellos), "hello")
    rejoined_publisher.send(b"1", seq=101)
    _expect_counts(bench, sub, 2, 4)


@rule(
    "lost-unreachable",
    lazy("Messages of a new publisher also count as lost while the subscriber can't connect to it."),
    "closing-a-publisher",
    "losses",
)
def _lost_unreachable(bench: Bench) -> None:
    topic = bench.new_topic()
    sub = bench.new_sub(topic)
    publisher = bench.create_publisher(topic, is_listed=False)
    with closed_port() as endpoint:
        publisher.record = replace(publisher.record, endpoints=(endpoint,))
        bench.register_publisher(publisher)
        _report_last_seq(bench, publisher.id, 7)
        _expect_counts(bench, sub, 0, 7)
