"""Tests of methods of reading that alternate, in one thread or in several."""

from __future__ import annotations

import random
import threading
from collections.abc import Iterator

import pytest

import nep
from nep.masters.master import Master
from nep.messages.message import Message
from tests.nep.programs import GREETINGS_S, eventually

COUNT = 2000
FIRST = 200


@pytest.fixture
def nodes(master: Master) -> Iterator[tuple[nep.Node, nep.Node]]:
    with nep.node("from", master=master.address) as sender, nep.node("to", master=master.address) as reader:
        yield sender, reader


def burst(publisher: nep.Publisher, *payloads: object) -> None:
    for payload in payloads:
        publisher.publish(payload)


def next_by(way: str, sub: nep.Subscriber) -> int:
    """Return the next payload, read with the given method; -1 if `poll` finds none."""
    if way == "listen":
        found, payload = sub.listen(timeout_s=GREETINGS_S)
        assert found
        return payload  # type: ignore[return-value]
    if way == "poll":
        found, payload = sub.listen()
        return payload if found else -1  # type: ignore[return-value]
    message = next(iter(sub)) if way == "iterate" else sub.receive(GREETINGS_S)
    assert message is not None
    assert message.topic == sub.topic
    assert message.stamp_ns
    assert message.seq == message.payload + 1  # type: ignore[operator]
    assert bytes(message.data) == str(message.payload).encode()
    return message.payload  # type: ignore[return-value]


@pytest.mark.parametrize("seed", range(4))
def test_mixed_read_methods_return_all_messages_in_order(nodes: tuple[nep.Node, nep.Node], seed: int) -> None:
    sender, reader = nodes
    sub, pub = reader.new_sub("t"), sender.new_pub("t")
    sending = threading.Thread(target=burst, args=(pub, *range(COUNT)))
    sending.start()
    dice = random.Random(seed)
    heard: list[int] = []
    while len(heard) < COUNT:
        way = dice.choice(("listen", "listen", "poll", "receive", "iterate"))
        for _ in range(dice.choice((1, 1, 3, 80))):
            payload = next_by(way, sub) if len(heard) < COUNT else -1
            if payload >= 0:
                heard.append(payload)
    sending.join()
    assert heard == list(range(COUNT))
    assert (sub.received, sub.lost) == (COUNT, 0)


def test_callbacks_and_listen_alternate_without_loss(nodes: tuple[nep.Node, nep.Node]) -> None:
    sender, reader = nodes
    heard: list[object] = []

    def hear(payload: object) -> None:
        heard.append(payload)
        if len(heard) in {100, 2 * FIRST}:
            reader.stop_spin()

    sub, pub = reader.new_callback("t", "json", hear), sender.new_pub("t")
    burst(pub, *range(FIRST))
    reader.spin(GREETINGS_S)
    assert heard == list(range(100))
    heard += [sub.receive(GREETINGS_S).payload, sub.listen(timeout_s=GREETINGS_S)[1]]  # type: ignore[union-attr]
    other: list[Message] = []
    reader.new_callback("other", "json", other.append, with_message=True)  # two subscribers from now on
    burst(pub, *range(FIRST, 2 * FIRST))
    reader.spin(GREETINGS_S)
    assert heard == list(range(2 * FIRST))
    assert sub.lost == 0


def test_undecodable_message_is_skipped_and_the_order_is_kept(nodes: tuple[nep.Node, nep.Node]) -> None:
    sender, reader = nodes
    sub, pub = reader.new_sub("t"), sender.new_pub("t")
    for number in range(FIRST):
        pub.publish_bytes(b"{" if number == 150 else str(number).encode())
    heard = [sub.listen(timeout_s=GREETINGS_S)[1] for _ in range(FIRST - 1)]
    assert heard == [each for each in range(FIRST) if each != 150]
    assert sub.received == FIRST
    pub.publish(1)
    eventually(lambda: sub.listen() == (True, 1))


def test_two_threads_share_messages_of_one_subscriber(nodes: tuple[nep.Node, nep.Node]) -> None:
    sender, reader = nodes
    sub, pub = reader.new_sub("t"), sender.new_pub("t")
    heard: list[list[object]] = [[], []]

    def listen(own: list[object], *, whole: bool) -> None:
        while True:
            if whole:
                message = sub.receive(GREETINGS_S)
                payload = None if message is None else message.payload
            else:
                payload = sub.listen(timeout_s=GREETINGS_S)[1]
            if not isinstance(payload, int) or payload < 0:
                return
            own.append(payload)

    threads = [
        threading.Thread(target=listen, args=(own,), kwargs={"whole": bool(n)}) for n, own in enumerate(heard)
    ]
    for each in threads:
        each.start()
    burst(pub, *range(COUNT), -1, -1)
    for each in threads:
        each.join(GREETINGS_S)
    assert sorted(heard[0] + heard[1]) == list(range(COUNT))  # type: ignore[type-var]
    assert (sub.received, sub.lost) == (COUNT + 2, 0)


def test_close_discards_queued_payloads(nodes: tuple[nep.Node, nep.Node]) -> None:
    sender, reader = nodes
    sub, pub = reader.new_sub("t"), sender.new_pub("t")
    burst(pub, *range(FIRST))
    assert sub.listen(timeout_s=GREETINGS_S) == (True, 0)
    sub.close()
    assert not sub._transport.ready
    with pytest.raises(nep.ClosedError):
        sub.listen()
