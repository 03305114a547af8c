"""Tests of payloads that cannot be encoded: counted, logged rarely, with the path of the value.

No sockets are used.
"""

from __future__ import annotations

import logging

import pytest

import nep
from nep.messages.codecs import CODECS
from nep.nodes.publisher import RejectedPayloads, unencodable_path
from nep.system.log_rarely import is_logged


class Told:
    """Reported problems, a counting encoder and a clock that the test advances."""

    def __init__(self) -> None:
        self.problems: list[str] = []
        self.now = 0.0
        self.encoded = 0
        self.takes_s = 0.0

    def encode(self, payload: object) -> nep.Encoded:
        self.encoded += 1
        self.now += self.takes_s
        return CODECS["json"].encode(payload)

    def new(self) -> RejectedPayloads:
        return RejectedPayloads("t", self.encode, self.problems.append, lambda: self.now)


def test_unsubscribed_payloads_are_validated_once_per_second() -> None:
    told = Told()
    unsendable = told.new()
    for _ in range(1000):
        assert unsendable.is_valid(1)
        told.now += 0.01
    assert told.encoded == 10


def test_payloads_with_slow_encoding_are_validated_less_often() -> None:
    told = Told()
    told.takes_s = 0.5
    unsendable = told.new()
    for _ in range(10_000):
        unsendable.is_valid(1)
        told.now += 0.01
    assert told.encoded * 0.5 / told.now < 0.025


def test_unencodable_unsubscribed_payload_is_reported_until_one_can_be_encoded() -> None:
    told = Told()
    unsendable = told.new()
    assert not unsendable.is_valid(object())
    assert unsendable.count == 1
    told.now += 1.0
    assert unsendable.is_valid(1)
    assert told.problems == ["can't encode a 'object' as 'json': 'object' can't be encoded as JSON", ""]


def test_alternating_valid_and_unencodable_payloads_are_logged_at_growing_intervals(
    caplog: pytest.LogCaptureFixture,
) -> None:
    told = Told()
    unsendable = told.new()
    for _ in range(500):
        unsendable.add([object()], nep.EncodeError("json", "list", "because"))
        unsendable.resolve()
    assert unsendable.count == 500
    assert len(caplog.records) == 3
    assert caplog.records[-1].getMessage().startswith("a message on 't' can't be sent (100 so far): ")


def test_alternating_valid_and_undecodable_messages_are_logged_at_growing_intervals(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with nep.node("n", "memory", master="rarely") as node:
        sub, pub = node.new_sub("t"), node.new_pub("t")
        for _ in range(500):
            pub.publish_bytes(b"{")
            pub.publish(1)
            assert sub.listen() == (True, 1)
    assert [record.levelno for record in caplog.records] == [logging.WARNING] * 3


@pytest.mark.parametrize(
    ("payload", "place"),
    [
        (object(), ""),
        ({"a": 1}, ""),
        ({"a": {"b": [1, 2, {"c": object()}]}}, "a.b[2].c"),
        ([[[object()]]], "[0][0][0]"),
        ({"a": list(range(20_000)), "b": object()}, "b"),
        ([*list(range(9998)), object()], "[9998]"),
        ([*list(range(20000)), object()], ""),
        ({object(): 1}, ""),
        ({"a": (1, {2})}, "a[1]"),
    ],
)
def test_path_of_the_unencodable_value_is_found(payload: object, place: str) -> None:
    assert unencodable_path(payload, CODECS["json"].encode) == place


def test_path_of_a_self_referencing_payload_is_bounded() -> None:
    endless: list[object] = []
    endless.append(endless)
    assert unencodable_path(endless, CODECS["json"].encode).startswith("[0][0]")


def test_rejections_are_logged_only_at_powers_of_ten() -> None:
    assert [count for count in range(1001) if is_logged(count)] == [1, 10, 100, 1000]
