"""Tests of decoding: malformed values are rejected with the name of the field."""

from __future__ import annotations

import msgpack  # type: ignore[import-untyped]
import pytest

from nep.errors import WireError
from nep.protocol import encoding
from nep.protocol.graph_view import Alert, GraphView, TopicInfo
from nep.protocol.requests import GraphReply, NodeRecord, Ping, Renew

TOPIC: dict[str, object] = {"name": "t", "msg_type": "json", "codec": "json"}


def graph_reply(topic: object) -> bytes:
    view = {"epoch": 1, "revision": 2, "topics": {"t": topic}}
    return bytes(msgpack.packb({"is": "seen", "re": 1, "what": {"epoch": 1, "revision": 2, "view": view}}))


def decoded_topic(topic: object) -> TopicInfo:
    call, reply = encoding.decode_reply(graph_reply(topic))
    assert call == 1
    assert isinstance(reply, GraphReply)
    return reply.view.topics["t"]


@pytest.mark.parametrize(("item", "kept"), [(2, 2.0), (2.5, 2.5), (None, None)])
def test_int_is_converted_in_float_fields(item: object, kept: object) -> None:
    read = decoded_topic(TOPIC | {"rate_hz": item})
    assert read.rate_hz == kept
    assert type(read.rate_hz) is type(kept)


def test_unknown_fields_are_ignored() -> None:
    assert decoded_topic(TOPIC | {"mood": {"is": [1, {"x": 2}]}}) == decoded_topic(TOPIC)


@pytest.mark.parametrize(
    ("topic", "code", "reason"),
    [
        ({"name": "t"}, "field-missing", "'GraphReply.view.topics[...].msg_type' is missing"),
        (TOPIC | {"name": 5}, "field-type", "'GraphReply.view.topics[...].name' must be 'str', not 'int'"),
        (TOPIC | {"lost": True}, "field-type", "must be 'int | null', not 'bool'"),
        (TOPIC | {"lost": 1.0}, "field-type", "must be 'int | null', not 'float'"),
        (TOPIC | {"publishers": 5}, "field-type", "'GraphReply.view.topics[...].publishers' must be a list"),
        (TOPIC | {"publishers": [5]}, "field-type", "topics[...].publishers[0]' must be a map, not 'int'"),
        ([], "field-type", "'GraphReply.view.topics[...]' must be a map, not 'array'"),
    ],
)
def test_malformed_field_is_rejected_with_its_name(topic: object, code: str, reason: str) -> None:
    with pytest.raises(WireError) as caught:
        decoded_topic(topic)
    assert caught.value.code == code
    assert reason in caught.value.reason


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (b"", "msgpack"),
        (b"\x80x", "msgpack"),
        (b"\x81\xa2do\xa4pi", "msgpack"),
        (b"\x90", "map"),
        (b"\xc0", "map"),
        (b"\x81\xa4what" + b"\x91" * 50_000 + b"\x90", "msgpack"),
        (b"\x81\xa5other" + b"\x91" * 50_000 + b"\x90", "msgpack"),
        (msgpack.packb({"do": "dance"}), "request"),
        (msgpack.packb({"do": [1]}), "request"),
        (msgpack.packb({"what": {}}), "request"),
    ],
)
def test_malformed_request_is_returned_as_an_error(body: bytes, code: str) -> None:
    call, request = encoding.decode_request(body)
    assert call == 0
    assert isinstance(request, WireError)
    assert request.code == code


@pytest.mark.parametrize("call", [-1, "x", None, 1.5, True, [1]])
def test_invalid_call_number_of_a_request_is_zero(call: object) -> None:
    assert encoding.decode_request(msgpack.packb({"do": "ping", "call": call})) == (0, Ping())


def test_numbers_beyond_64_bits_and_lone_surrogates_are_encoded_as_the_nearest_value() -> None:
    call, request = encoding.decode_request(encoding.encode_request(Renew("n\ud800", 2**70, -(2**70)), 7))
    assert (call, request) == (7, Renew("n?", 2**64 - 1, -(2**63)))
    reply = GraphReply(1, 2, GraphView(1, 2, alerts=(Alert("a", "\ud800"),)))
    assert encoding.decode_reply(encoding.encode_reply(reply)) == (
        0,
        GraphReply(1, 2, GraphView(1, 2, alerts=(Alert("a", "?"),))),
    )


def test_key_of_a_node_is_not_shown() -> None:
    record = NodeRecord("0" * 16, "node", "host", 1, key="secret")
    assert "secret" not in repr(record)
    assert "name='node'" in repr(record)
