"""Contract tests of back ends: a late subscriber receives the history, then the following messages."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import nep
from nep.backends.bases.loss import EARLY_MESSAGE_WINDOW_S, PublisherTracker
from nep.backends.zenoh.early_messages import EarlyMessages
from nep.masters.master import Master
from nep.messages.history import MAX_HISTORY_BYTES, History
from nep.protocol.requests import PublisherRecord, RemotePublisher
from nep.protocol.wire import Header
from tests.nep.meeting import Make
from tests.nep.programs import eventually, running


def read(sub: nep.Subscriber, most: int) -> list[object]:
    """Receive exactly `most` payloads; fail if another message follows."""
    got: list[object] = []
    while len(got) < most:
        ok, payload = sub.listen(timeout_s=30.0)
        assert ok, got
        got.append(payload)
    assert sub.listen(timeout_s=0.05) == (False, sub._empty())
    return got


@pytest.mark.parametrize("published", [0, 1, 3, 4, 10])
def test_late_subscriber_receives_history_in_order_then_live_messages(make: Make, published: int) -> None:
    pub = make("a").new_pub("topic", history=3)
    early = make("early").new_sub("topic")
    for n in range(published):
        pub.publish(n)
    late = make("late").new_sub("topic")
    pub.publish("live")
    kept = list(range(published))[-3:]
    assert read(late, len(kept) + 1) == [*kept, "live"]
    assert read(early, published + 1) == [*range(published), "live"]
    assert (early.lost, late.lost, late.received) == (0, 0, len(kept) + 1)
    late_again = make("again").new_sub("topic")
    assert read(late_again, min(3, published + 1)) == [*range(published), "live"][-3:]


def test_messages_published_before_any_subscription_are_in_the_history(make: Make) -> None:
    pub = make("a").new_pub("topic", history=100)
    for n in range(250):
        pub.publish(n)
    assert read(make("b").new_sub("topic"), 100) == list(range(150, 250))


def test_latched_is_a_history_of_one(make: Make) -> None:
    node = make("a")
    pubs = [
        node.new_pub("latched", latched=True),
        node.new_pub("one", history=1),
        node.new_pub("both", latched=True, history=2),
    ]
    for pub in pubs:
        for n in range(3):
            pub.publish(n)
    other = make("b")
    assert [read(other.new_sub(pub.topic), most) for pub, most in zip(pubs, (1, 1, 2), strict=True)] == [
        [2],
        [2],
        [1, 2],
    ]
    topics = node.graph().topics
    assert all(topics[pub.topic].publishers[0].latched for pub in pubs)


def test_history_has_no_duplicates_or_gaps_during_continuous_publishing(make: Make) -> None:
    """Subscribers join during a stream; each receives the last `history` messages and all later ones."""
    pub = make("a").new_pub("topic", history=50)
    others = make("b")
    is_over = threading.Event()
    pause = threading.Event()

    def publish() -> None:
        n = 0
        while not is_over.is_set():
            pub.publish(n)
            n += 1
            if n % 5 == 0:
                pause.wait(0.001)

    def number(sub: nep.Subscriber) -> int:
        ok, payload = sub.listen(timeout_s=30.0)
        assert ok
        return int(str(payload))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        for _ in range(15):
            with others.new_sub("topic") as sub:
                got = [number(sub)]
                # The publisher knows a subscriber only after the handshake, some time after its creation.
                count = pub.count
                while got[-1] < count + 100:
                    got.append(number(sub))
                assert got == list(range(got[0], got[0] + len(got)))
                assert got[0] <= max(0, count - 49)  # a message may be sent before it is counted
                assert sub.lost == 0
    finally:
        is_over.set()
        thread.join(30.0)


def test_each_publisher_of_a_topic_has_its_own_history(make: Make) -> None:
    pubs = [make(f"p{n}").new_pub("topic", history=2) for n in range(3)]
    for number in range(5):
        for n, pub in enumerate(pubs):
            pub.publish([n, number])
    got = read(make("s").new_sub("topic"), 6)
    for n in range(3):
        assert [each for each in got if each[0] == n] == [[n, 3], [n, 4]]  # type: ignore[index]


def test_history_keeps_the_newest_images(make: Make) -> None:
    node = make("a")
    pictures = [np.full((90, 120, 3), n, np.uint8) for n in range(100)]
    pub = node.new_pub("camera", "image", history=80)
    for picture in pictures:
        pub.publish(picture)
    sub = make("b").new_sub("camera", "image")
    for n in range(20, 100):
        ok, picture = sub.listen(timeout_s=30.0)
        assert ok
        assert np.array_equal(np.asarray(picture), pictures[n])
    assert sub.lost == 0


def test_history_is_bounded_in_bytes_and_keeps_the_newest(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(History.__init__, "__defaults__", (1_000_000,))
    pub = make("a").new_pub("topic", "bytes", history=1000)
    for n in range(10):
        pub.publish(bytes([n]) * 300_000)
    got = read(make("b").new_sub("topic", "bytes"), 3)
    assert [each[0] for each in got] == [7, 8, 9]  # type: ignore[index]
    pub.publish(b"\x0a" * 8_000_000)
    assert [len(each) for each in read(make("c").new_sub("topic", "bytes"), 1)] == [8_000_000]  # type: ignore[arg-type]


def test_history_reaches_sinks_and_keep_latest_subscribers(make: Make) -> None:
    pub = make("a").new_pub("topic", history=10)
    for n in range(20):
        pub.publish(n)
    node = make("b")
    got: list[object] = []
    node.new_sub("topic", sink=lambda messages: got.extend(each.payload for each in messages))
    latest = node.new_sub("topic", keep="latest")
    eventually(lambda: len(got) == 10)
    assert got == list(range(10, 20))
    eventually(lambda: latest.received >= 1)
    last: object = None
    while last != 19:
        _ok, last = latest.listen(timeout_s=30.0)


def test_invalid_history_lengths_are_rejected(make: Make) -> None:
    node = make("a")
    for wrong in (-1, 1001, 2**64, True, 1.5, "3", None, float("nan")):
        with pytest.raises(ValueError, match=r"history must be a whole number from 0 to 1000, not .*"):
            node.new_pub("topic", history=wrong)  # type: ignore[arg-type]
    assert node.new_pub("topic", history=0).count == 0


def test_back_end_without_history_rejects_the_history_option(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make("a")
    monkeypatch.setattr("nep.backends.base.Backend.has_history", False, raising=False)
    object.__setattr__(node._backend, "has_history", False)
    try:
        with pytest.raises(ValueError, match=f"'{node._backend.name}' .*history"):
            node.new_pub("topic", history=1)
    finally:
        object.__setattr__(node._backend, "has_history", True)


def test_original_wire_rejects_history() -> None:
    with nep.node("a") as node:
        direct = node.direct(port=9999)
        with pytest.raises(ValueError, match=r"original wire .*history"):
            node.new_pub("topic", "json", direct, history=2)


def test_killed_and_restarted_publisher_repeats_no_history_to_an_early_subscriber(master: Master) -> None:
    code = """
    import sys, nep
    pub = nep.node("a").new_pub("t", history=3)
    for n in range(5): pub.publish([sys.argv[1], n])
    print("there")
    input()
    """
    with nep.node("b") as node:
        early = node.new_sub("t")
        with running(code, "first") as program:
            assert program.line() == "there"
            assert [early.listen(timeout_s=30.0)[1] for _ in range(5)] == [["first", n] for n in range(5)]
            assert read(node.new_sub("t"), 3) == [["first", n] for n in (2, 3, 4)]
            program.process.kill()
            program.process.wait()
        with running(code, "second") as program:
            assert program.line() == "there"
            assert [early.listen(timeout_s=30.0)[1] for _ in range(5)] == [["second", n] for n in range(5)]


# ---- history


def test_history_evicts_the_oldest_beyond_its_limits() -> None:
    history: History[int] = History(3, 100)
    for n in range(5):
        history.add(n, 10)
    assert (list(history), len(history), history.size_bytes) == ([2, 3, 4], 3, 30)
    history.add(5, 85)
    assert (list(history), history.size_bytes) == ([4, 5], 95)
    history.add(6, 1000)
    assert (list(history), history.size_bytes) == ([6], 1000)
    empty: History[int] = History(0)
    empty.add(1, 1)
    assert not empty
    assert MAX_HISTORY_BYTES == 64 * 2**20


def _remote(history: int) -> RemotePublisher:
    return RemotePublisher(PublisherRecord(5, "t", "json", "json", history=history), "n", "name")


def test_messages_before_the_echo_are_skipped_only_if_the_history_repeats_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [100.0]
    monkeypatch.setattr("nep.backends.bases.loss.time.monotonic", lambda: now[0])
    sources = PublisherTracker()
    assert not sources.is_early(5)
    sources.add_listed(_remote(1))
    assert not sources.is_early(5)
    sources.add_listed(_remote(2))
    assert sources.is_early(5)
    now[0] += EARLY_MESSAGE_WINDOW_S
    assert not sources.is_early(5), "it greets nobody"
    now[0] -= 1.0
    assert sources.is_early(5)
    sources.get(5).has_echoed = True
    assert not sources.is_early(5)


def test_early_messages_wait_for_the_history_and_are_bounded() -> None:
    now = [0.0]
    sources = PublisherTracker()
    early: EarlyMessages[bytes] = EarlyMessages(sources, 3, lambda: now[0])
    assert not early.queue_if_early(Header(1, 1, 7, 0, 5), b"7", 2), "nobody has met it"
    sources.add_listed(_remote(2))
    for seq in (9, 7, 8):
        assert early.queue_if_early(Header(1, 1, seq, 0, 5), b"%d" % seq, 2)
    assert not early.queue_if_early(Header(1, 1, 10, 0, 5), b"10", 2), "there is room for three"
    assert sources.count_message(5, 7, is_alone=True)
    assert early.pop(5) == [b"8", b"9"], "those that the history had are left out"
    assert early.pop(5) == []
    sources.get(5).has_echoed = True
    assert not early.queue_if_early(Header(1, 1, 11, 0, 5), b"11", 2), "it has replied"
    sources.get(5).has_echoed = False
    assert early.queue_if_early(Header(1, 1, 12, 0, 5), b"12", 2)
    now[0] = 20.0
    assert not early.queue_if_early(Header(1, 1, 13, 0, 5), b"13", 2)
