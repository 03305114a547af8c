"""Tests that a robot's reply counts only when it arrives on the connection to the publisher that it names."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import pytest

import nep
from nep.masters.master import Master
from nep.messages.codecs import codec_for
from nep.protocol.wire import Header
from tests.nep.programs import eventually

TOPIC = "/Pepper/answer"
TYPE = "robot/answer"


@pytest.fixture
def master() -> Iterator[Master]:
    with Master("127.0.0.1:0", learn_s=0.0) as made:
        yield made


def forge(own: nep.Publisher, named: int, seq: int, payload: object, *, in_parts: bool) -> None:
    """Send a message on one publisher's socket that names another publisher."""
    data = json.dumps(payload).encode()
    head = Header(codec_for(TYPE).number, 0, seq, 1, named, len(data)).pack()
    first = TOPIC.encode() + b"\0"
    socket, lock = own._transport._socket, own._transport._lock  # type: ignore[attr-defined]
    with lock:
        socket.send_multipart([first, head, data] if in_parts else [first + head + data])


@pytest.mark.parametrize("in_parts", [False, True])
@pytest.mark.parametrize("batch", [False, True])
def test_forged_reply_is_rejected_and_replies_of_the_publisher_are_received(
    master: Master, *, in_parts: bool, batch: bool
) -> None:
    heard: list[object] = []

    def take(messages: Sequence[nep.Message]) -> None:
        heard.extend(message.payload for message in messages)

    with (
        nep.node("Pepper", master=master.address) as pepper,
        nep.node("liar", master=master.address) as liar,
        nep.node("studio", master=master.address) as studio,
    ):
        honest = pepper.new_pub(TOPIC, TYPE, batch=batch)
        own = liar.new_pub(TOPIC, TYPE, batch=False)
        subscriber = studio.new_sub(TOPIC, TYPE, sink=take)
        honest.publish({"from": "Pepper", "number": 1})
        eventually(lambda: len(heard) == 1)
        forge(own, honest.id, 5000, {"from": "forged"}, in_parts=in_parts)
        own.publish({"from": "liar"})  # follows the forged message on the same connection
        eventually(lambda: {"from": "liar"} in heard)
        for number in (2, 3):
            honest.publish({"from": "Pepper", "number": number, "long": "x" * 100_000})
        eventually(lambda: len(heard) == 4)
        assert {"from": "forged"} not in heard
        assert subscriber.refused == 1


def test_late_subscriber_receives_the_latched_message(master: Master) -> None:
    heard: list[object] = []
    with (
        nep.node("Pepper", master=master.address) as pepper,
        nep.node("studio", master=master.address) as studio,
    ):
        pepper.new_pub(TOPIC, TYPE, latched=True).publish({"kept": True})
        studio.new_sub(TOPIC, TYPE, sink=lambda messages: heard.extend(each.payload for each in messages))
        eventually(lambda: heard == [{"kept": True}])
