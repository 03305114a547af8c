"""Rules about what a subscriber counts as lost."""

from __future__ import annotations

from nep.i18n import lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.rule import rule
from nep.programs.conformance.verdict import expect

_SECTION = "notices"


def _counts(bench: Bench, sub: int, received: int, lost: int) -> None:
    """Wait until the adapter counts so; what it counts in the end breaks the rule."""
    bench.need(lambda: len(bench.events(sub)) >= received, "message")
    for _turn in range(40):
        if bench.counts(sub) == (received, lost):
            return
        bench.wait(0.05)
    expect("received, lost", bench.counts(sub), (received, lost))


@rule(
    "lost-gap", lazy("Gaps in seq are lost, but not what came before the first message."), _SECTION, "losses"
)
def lost_gap(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    publisher = bench.publisher(topic, echoes=False)
    publisher.seq = 100
    sub = bench.new_sub(topic)
    publisher.send(b"1")
    publisher.send(b"1", seq=105)
    publisher.send(b"1", seq=106)
    _counts(bench, sub, 3, 3)


@rule("lost-echo", lazy("What is missing between the last message and an echo is lost."), _SECTION, "losses")
def lost_echo(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b"1")
    publisher.seq = 5
    publisher.echo(next(iter(publisher.hellos)))
    publisher.send(b"1")
    _counts(bench, sub, 2, 4)


@rule("lost-bye", lazy("What is missing between the last message and a bye is lost."), _SECTION, "losses")
def lost_bye(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b"1")
    publisher.seq = 4
    publisher.bye()
    _counts(bench, sub, 1, 3)


@rule(
    "lost-last-seq",
    lazy("What the master says was sent one renewal ago, and has not come, is lost."),
    _SECTION,
    "losses",
)
def lost_last_seq(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b"1")
    bench.need(lambda: bool(bench.events(sub)), "message")
    bench.master.change = lambda _heard, reply: (
        {**reply, "what": {**reply["what"], "last_seqs": {publisher.id: 3}}}
        if reply["is"] == "renewed"
        else reply
    )
    for _turn in range(3):
        bench.renewal(len(bench.master.heard))
    _counts(bench, sub, 1, 2)


@rule(
    "lost-late",
    lazy("What was counted as lost by the master's word is found again when it comes after all."),
    _SECTION,
    "losses",
)
def lost_late(bench: Bench) -> None:
    """See the rule."""
    lost_last_seq(bench)
    (publisher,) = bench.publishers
    publisher.send(b"1", seq=2)
    publisher.send(b"1", seq=3)
    (sub,) = {int(each["sub"]) for each in bench.adapter.events}
    _counts(bench, sub, 3, 0)


@rule(
    "lost-leap",
    lazy("A message whose seq leaps by more than 2^32 is rejected, and nothing counts as lost."),
    _SECTION,
    "losses",
)
def lost_leap(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b"1")
    publisher.send(b"1", seq=2**40)
    publisher.send(b"1", seq=2)
    _counts(bench, sub, 2, 0)
