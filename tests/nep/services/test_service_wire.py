"""Tests of the wire vectors of services: the bytes sent and received equal those of the vectors."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from nep.backends.zeromq.services.tcp_stream import TcpStream
from nep.errors import WireError
from nep.protocol.service_wire import NATIVE, CallKind, Reply

VECTORS: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[2] / "data" / "wire" / "services.json").read_text("utf-8")
)
GOOD = [each for each in VECTORS if "means" in each]


def name_of(vector: dict[str, Any]) -> str:
    return str(vector["name"])


def parts_of(vector: dict[str, Any]) -> list[bytes]:
    return [bytes.fromhex(part) for part in vector["parts"]]


@pytest.fixture
def stream() -> Iterator[tuple[TcpStream, socket.socket]]:
    """`TcpStream` and the socket at its other end."""
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    theirs.settimeout(30.0)
    with closing(theirs), closing(TcpStream(ours)) as made:
        yield made, theirs


@pytest.mark.parametrize("vector", GOOD, ids=name_of)
def test_calls_and_replies_match_the_vectors(vector: dict[str, Any]) -> None:
    means, parts = vector["means"], parts_of(vector)
    number, payload = int(means["number"]), bytes.fromhex(means["payload"])
    if means["kind"] == CallKind.CALL:
        timeout_s = means["timeout_ms"] / 1000 or None
        assert NATIVE.encode_call(number, means["codec"], timeout_s, payload) == parts
        assert NATIVE.read_call(parts) == (number, means["codec"], timeout_s, payload)
        with pytest.raises(WireError):
            NATIVE.read_reply(parts)
    else:
        reply = Reply(CallKind(means["kind"]), payload, means["codec"])
        assert NATIVE.encode_reply(number, reply) == parts
        assert NATIVE.read_reply(parts) == (number, reply)
        with pytest.raises(WireError):
            NATIVE.read_call(parts)


@pytest.mark.parametrize("vector", [each for each in VECTORS if "error" in each], ids=name_of)
def test_malformed_service_messages_are_rejected_with_their_error_code(
    vector: dict[str, Any], stream: tuple[TcpStream, socket.socket]
) -> None:
    if "parts" in vector:
        for read in (NATIVE.read_call, NATIVE.read_reply):
            with pytest.raises(WireError) as refused:
                read(parts_of(vector))
            assert refused.value.code == vector["error"]
        return
    ours, theirs = stream
    theirs.sendall(bytes.fromhex(vector["tcp"]))
    theirs.shutdown(socket.SHUT_WR)
    while not ours.has_ended:
        ours.read()
        if ours.has_ended:
            break
    with pytest.raises(WireError) as refused:
        ours.next()
    assert refused.value.code == vector["error"]
    assert ours.next() is None


@pytest.mark.parametrize("vector", GOOD, ids=name_of)
def test_plain_tcp_frame_is_the_size_followed_by_the_native_parts(
    vector: dict[str, Any], stream: tuple[TcpStream, socket.socket]
) -> None:
    ours, theirs = stream
    told = bytes.fromhex(vector["tcp"])
    ours.send(parts_of(vector))
    assert theirs.recv(len(told) + 1) == told
    pairs = []
    for byte in (*told, *told):  # byte by byte
        theirs.sendall(bytes([byte]))
        assert ours.read()
        pairs.append(ours.next())
    missing = [None] * (len(told) - 1)
    assert pairs == [*missing, parts_of(vector)] * 2
