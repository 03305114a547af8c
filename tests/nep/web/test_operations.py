"""Tests of parsing operations of pages: within limits, or rejected with a message."""

from __future__ import annotations

import json
import random

import pytest

from nep.programs.web.limits import MAX_FRAGMENTED_OPERATIONS, MAX_MESSAGE_BYTES, MIN_FRAGMENT_SIZE
from nep.programs.web.messages import operations as op
from nep.programs.web.messages.fragments import FragmentBuffer, split_text
from tests import hostile

EXAMPLES = (
    {"op": "advertise", "id": "a", "topic": "/t", "type": "std_msgs/String", "latch": True, "queue_size": 9},
    {"op": "unadvertise", "id": "a", "topic": "/t"},
    {"op": "publish", "id": 7, "topic": "/t", "msg": {"data": [1, {"x": None}]}},
    {
        "op": "subscribe", "id": "s", "topic": "/t", "type": "a/B", "throttle_rate": 100, "queue_length": 3,
        "fragment_size": 500, "compression": "cbor",
    },
    {"op": "unsubscribe", "topic": "/t"},
    {"op": "call_service", "id": "c", "service": "/s", "args": {"a": 1}, "timeout": 2.5},
    {"op": "advertise_service", "service": "/s", "type": "a/B"},
    {"op": "unadvertise_service", "service": "/s"},
    {"op": "service_response", "id": "c", "service": "/s", "values": {"a": 1}, "result": True},
    {"op": "fragment", "id": "f", "data": "x", "num": 0, "total": 2},
    {"op": "png", "data": "x"},
    {"op": "set_level", "level": "info"},
    {"op": "status", "level": "warning", "msg": "oh"},
    {"op": "auth", "mac": "m", "client": "c", "dest": "d", "rand": "r", "t": 1, "level": "l", "end": 2},
)  # fmt: skip


def parsed(**fields: object) -> op.Operation:
    return op.parse(json.dumps(fields).encode())


def refusal(data: bytes) -> str | None:
    """Return the error message of a rejected operation, or None if it is accepted."""
    try:
        op.parse(data)
    except op.OperationError as error:
        return str(error)
    return None


def test_operations_are_parsed_to_typed_values() -> None:
    kinds = [type(op.parse(json.dumps(each).encode())).__name__ for each in EXAMPLES]
    assert len(set(kinds)) == len(EXAMPLES)
    assert op.parse(json.dumps(EXAMPLES[3]).encode()) == op.Subscribe("s", "/t", "a/B", 0.1, 3, 500, "cbor")
    assert parsed(op="publish", topic="/t") == op.Publish(None, "/t", {})
    assert parsed(op="call_service", service="/s#9", args=[]) == op.CallService("9", "/s", {})


@pytest.mark.parametrize("fields", EXAMPLES, ids=lambda each: each["op"])
def test_hostile_operation_is_parsed_or_rejected_with_a_message(fields: dict[str, object]) -> None:
    for payload in hostile.payloads(fields):
        said = refusal(payload)
        assert said is None or (said and said.isprintable() and len(said) < 1_000)


def test_mutated_operations_raise_only_operation_errors() -> None:
    chance = random.Random(27)
    texts = [json.dumps(each).encode() for each in EXAMPLES]
    for _number in range(4_000):
        text = bytearray(chance.choice(texts))
        for _edit in range(chance.randint(1, 4)):
            at = chance.randrange(len(text))
            text[at : at + chance.randint(0, 3)] = chance.choice(
                (b"", b'"', b"}", b"[", b"null", b"-1e999", bytes([chance.randrange(256)]), b"\\ud800")
            )
        refusal(bytes(text))


def test_operation_beyond_limits_or_on_internal_topics_is_rejected() -> None:
    for data in (
        b'"' + b"x" * MAX_MESSAGE_BYTES + b'"',
        b"[" * 1_000 + b"]" * 1_000,
        b"[" + b"[]," * 1_100_000 + b"0]",
    ):
        with pytest.raises(op.OperationError):
            op.parse(data)
    with pytest.raises(op.OperationError) as raised:
        parsed(op="subscribe", id="s", topic="/t", compression="zip")
    assert raised.value.id == "s"
    for wrong in (
        {"op": "advertise", "topic": "/t", "type": "a\x1b[31m/B"},
        {"op": "advertise", "topic": "/nep/log", "type": "nep/Json"},
        {"op": "publish", "topic": "/nep/log", "msg": {}},
        {"op": "advertise_service", "service": "/nep/parameters/0", "type": ""},
    ):
        with pytest.raises(op.OperationError):
            parsed(**wrong)
    small = parsed(op="subscribe", topic="/t", fragment_size=1)
    assert isinstance(small, op.Subscribe)
    assert small.fragment_size == MIN_FRAGMENT_SIZE


# ---- fragments


def part(id_: str, data: str, number: int, total: int) -> op.Fragment:
    return op.Fragment(id_, data, number, total)


def test_fragments_received_out_of_order_or_twice_are_joined() -> None:
    pieces = split_text("abcdefgh", 3)
    buffer = FragmentBuffer()
    order = (2, 0, 0, 1)
    assert [buffer.add(part("f", pieces[n], n, 3)) for n in order] == [None, None, None, "abcdefgh"]
    assert len(buffer) == 0


def test_number_and_size_of_incomplete_operations_are_bounded() -> None:
    buffer = FragmentBuffer()
    for number in range(3 * MAX_FRAGMENTED_OPERATIONS):
        buffer.add(part(f"f{number}", "x", 0, 2))
    assert len(buffer) == MAX_FRAGMENTED_OPERATIONS
    half = "x" * (MAX_MESSAGE_BYTES // 2)
    buffer.add(part("big", half, 0, 3))
    buffer.add(part("big", half, 1, 3))
    with pytest.raises(op.OperationError):
        buffer.add(part("big", "x", 2, 3))
    assert buffer.add(part("next", "a", 0, 2)) is None
    assert buffer.add(part("next", "b", 1, 2)) == "ab"
    with pytest.raises(op.OperationError):
        buffer.add(op.Fragment(None, "x", 0, 2))
    buffer.add(part("t", "x", 0, 2))
    with pytest.raises(op.OperationError):
        buffer.add(part("t", "x", 0, 3))
