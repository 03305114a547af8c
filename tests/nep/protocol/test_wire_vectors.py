"""Tests of the wire vectors through sockets: the bytes sent and received equal those of the vectors.

Other implementations are written against `tests/data/wire`; `test_wire.py` tests the pure functions
with it. Here a plain ZeroMQ socket stands for the other implementation.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zmq

import nep
from nep.masters.master import Master
from nep.messages.codecs import codec_by_number
from nep.messages.encoded import Encoded
from nep.messages.packing import unpack
from nep.protocol import wire
from nep.protocol.batch import encode_batch
from tests.nep.programs import eventually

DATA = Path(__file__).parents[2] / "data" / "wire"
VECTORS: list[dict[str, Any]] = json.loads((DATA / "messages.json").read_text("utf-8"))
GOOD = [each for each in VECTORS if "means" in each]
BATCHES: list[dict[str, Any]] = json.loads((DATA / "batches.json").read_text("utf-8"))
MALFORMED: list[list[str]] = json.loads((DATA / "malformed.json").read_text("utf-8"))
BAD = [each for each in VECTORS if "error" in each]
MASTER: dict[str, Any] = json.loads((DATA / "master.json").read_text("utf-8"))
LONG_MS = 30_000


def name_of(vector: dict[str, Any]) -> str:
    return str(vector["name"])


def parts_of(vector: dict[str, Any]) -> list[bytes]:
    return [bytes.fromhex(part) for part in vector["parts"]]


def meaning_of(means: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a vector with 64-bit numbers as integers; the files store them as text."""
    return {**means, **{name: int(means[name]) for name in ("seq", "stamp_ns", "publisher")}}


def type_of(vector: dict[str, Any]) -> str:
    codec = codec_by_number(vector["means"]["codec"])
    assert codec is not None
    return codec.name


@pytest.fixture
def their() -> Iterator[Callable[[int], zmq.Socket[bytes]]]:
    """Function that opens plain sockets of a kind; they are closed after the test."""
    with contextlib.ExitStack() as ended:
        context = ended.enter_context(zmq.Context())

        def make(kind: int) -> zmq.Socket[bytes]:
            made = ended.enter_context(context.socket(kind))
            made.linger, made.rcvtimeo = 0, LONG_MS
            return made

        yield make


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("ours") as made:
        yield made


# ---- messages


@pytest.mark.parametrize("vector", GOOD, ids=name_of)
def test_publisher_sends_the_bytes_of_the_vector(
    vector: dict[str, Any],
    master: Master,
    node: nep.Node,
    their: Callable[[int], zmq.Socket[bytes]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said, parts = meaning_of(vector["means"]), parts_of(vector)
    theirs = their(zmq.SUB)
    is_latched = bool(said["flags"] & wire.LATCHED)
    publisher = node.new_pub(said["topic"], type_of(vector), latched=is_latched)
    (known,) = node.graph().topics[said["topic"]].publishers
    sends = publisher._transport
    monkeypatch.setattr(sends, "_id", said["publisher"])
    monkeypatch.setattr(sends, "_count", said["seq"] - 1)
    if len(parts) == 1:  # as right after all messages were acknowledged
        monkeypatch.setattr(sends, "_full_path_at", 2**20)
    monkeypatch.setattr("nep.backends.zeromq.publisher._time_ns", lambda: said["stamp_ns"])
    theirs.subscribe(wire.topic_part(said["topic"]))
    if len(parts) == 1:  # sent only to subscribers that announce support
        theirs.subscribe(wire.hello_part(7, said["topic"], reads_one_part=True))
    theirs.connect(known.endpoints[0])
    eventually(lambda: publisher.subscribers if len(parts) == 1 else sends.has_subscribers)
    if len(parts) == 1:
        assert theirs.recv_multipart()[0] == wire.hello_part(7, said["topic"], reads_one_part=True)
    payload = bytes.fromhex(said["payload"])
    sends.send(Encoded(payload, said["extension"] or None))
    got = theirs.recv_multipart()
    sized = wire.Header(
        said["codec"], said["flags"], said["seq"], said["stamp_ns"], said["publisher"], len(payload)
    ).pack()
    untold = wire.read_header(sized)._replace(size=0).pack()
    whole = [b"".join(parts)] if len(parts) == 1 else parts
    assert [part.replace(sized, untold) if said.get("size") is None else part for part in got] == whole


@pytest.mark.parametrize("vector", GOOD, ids=name_of)
def test_subscriber_decodes_the_vector(
    vector: dict[str, Any], node: nep.Node, their: Callable[[int], zmq.Socket[bytes]]
) -> None:
    said = meaning_of(vector["means"])
    theirs = their(zmq.XPUB)
    port = theirs.bind_to_random_port("tcp://127.0.0.1")
    direct = node.direct(port=port, mode="one2many", wire="native")
    subscriber = node.new_sub(said["topic"], type_of(vector), direct)
    assert theirs.recv() == b"\1" + wire.topic_part(said["topic"])
    theirs.send_multipart(parts_of(vector))
    message = subscriber.receive(LONG_MS / 1000)
    assert message is not None
    assert (message.topic, message.codec) == (said["topic"], type_of(vector))
    assert (message.seq, message.stamp_ns, message.publisher) == (
        said["seq"],
        said["stamp_ns"],
        said["publisher"],
    )
    assert bytes(message.data).hex() == said["payload"]
    assert dict(message.extension) == said["extension"]
    assert message.is_latched == bool(said["flags"] & wire.LATCHED)


@pytest.mark.parametrize("vector", BATCHES, ids=name_of)
def test_subscriber_decodes_a_batch(
    vector: dict[str, Any], node: nep.Node, their: Callable[[int], zmq.Socket[bytes]]
) -> None:
    theirs = their(zmq.XPUB)
    port = theirs.bind_to_random_port("tcp://127.0.0.1")
    direct = node.direct(port=port, mode="one2many", wire="native")
    subscriber = node.new_sub("example", "json", direct)
    assert theirs.recv() == b"\1" + wire.topic_part("example")
    assert theirs.recv().startswith(b"\1\xffhello3/")
    part = bytes.fromhex(vector["part"])
    theirs.send(part)
    if "error" in vector:
        theirs.send_multipart(wire.join("example", wire.Header(1, 0, 1, 1, 9), b"{}"))
        (has_come, _payload) = subscriber.listen(timeout_s=LONG_MS / 1000)
        assert has_come  # the subscriber keeps reading
        assert subscriber.refused == 1
        return
    said = [meaning_of(each) for each in vector["means"]]
    for means in said:
        message = subscriber.receive(LONG_MS / 1000)
        assert message is not None
        assert (message.seq, message.stamp_ns, message.publisher) == (
            means["seq"],
            means["stamp_ns"],
            means["publisher"],
        )
        assert bytes(message.data).hex() == means["payload"]
    payloads = [bytes.fromhex(means["payload"]) for means in said]
    first = said[0]
    stamps = [means["stamp_ns"] for means in said]
    form = wire.encode_form(first["codec"], 0)
    assert encode_batch(b"example\0", form, first["seq"], first["publisher"], stamps, payloads) == part


@pytest.mark.parametrize("vector", BAD, ids=name_of)
def test_subscriber_rejects_an_invalid_message_and_receives_the_next_message(
    vector: dict[str, Any], node: nep.Node, their: Callable[[int], zmq.Socket[bytes]]
) -> None:
    theirs = their(zmq.XPUB)
    port = theirs.bind_to_random_port("tcp://127.0.0.1")
    direct = node.direct(port=port, mode="one2many", wire="native")
    subscriber = node.new_sub("example", "json", direct)
    assert theirs.recv() == b"\1" + wire.topic_part("example")
    # Parts with an invalid topic never pass the subscriber's own filter.
    passes = parts_of(vector)[0].startswith(wire.topic_part("example"))
    theirs.send_multipart(parts_of(vector))
    theirs.send_multipart(parts_of(GOOD[0]))
    message = subscriber.receive(LONG_MS / 1000)
    assert message is not None
    assert bytes(message.data).hex() == GOOD[0]["means"]["payload"]
    assert subscriber.refused == int(passes)


def test_subscriber_rejects_and_counts_malformed_messages(
    node: nep.Node, their: Callable[[int], zmq.Socket[bytes]]
) -> None:
    theirs = their(zmq.XPUB)
    port = theirs.bind_to_random_port("tcp://127.0.0.1")
    direct = node.direct(port=port, mode="one2many", wire="native")
    subscriber = node.new_sub("example", "json", direct)
    assert theirs.recv() == b"\1" + wire.topic_part("example")
    count = 0
    for _code, *vector in MALFORMED:
        parts = [bytes.fromhex(part) for part in vector]
        if parts and parts[0].startswith(wire.topic_part("example")):  # other parts are removed by the filter
            theirs.send_multipart(parts)
            count += 1
    theirs.send_multipart(wire.join("example", wire.Header(1, 0, 1, 1, 9), b"{}"))
    message = subscriber.receive(LONG_MS / 1000)
    assert message is not None
    assert (message.publisher, bytes(message.data)) == (9, b"{}")
    assert (subscriber.refused, subscriber.received, subscriber.lost) == (count, 1, 0)


# ---- the master


@pytest.fixture
def fixed_master() -> Iterator[Master]:
    """Master with the epoch of the vectors."""
    master = Master("127.0.0.1:0", learn_s=0.0)
    master.epoch = int(MASTER["epoch"])
    with master:
        yield master


@pytest.fixture
def asks(
    fixed_master: Master, their: Callable[[int], zmq.Socket[bytes]]
) -> Callable[[str, str], tuple[bytes, zmq.Socket[bytes]]]:
    """Function that sends a request over the named connection, skips pushes and returns reply and socket."""
    connections: dict[str, zmq.Socket[bytes]] = {}

    def ask(who: str, request: str) -> tuple[bytes, zmq.Socket[bytes]]:
        if who not in connections:
            connections[who] = their(zmq.DEALER)
            connections[who].connect(f"tcp://{fixed_master.address}")
        connections[who].send(bytes.fromhex(request))
        while unpack(body := connections[who].recv())["re"] == 0:  # type: ignore[index]
            pass
        return body, connections[who]

    return ask


@pytest.mark.parametrize("vector", MASTER["asked"], ids=name_of)
def test_master_reply_matches_the_vector(
    vector: dict[str, Any], asks: Callable[[str, str], tuple[bytes, zmq.Socket[bytes]]]
) -> None:
    for each in vector["before"]:
        asks(each["from"], each["request"])
    answer, _connection = asks(vector["from"], vector["request"])
    assert answer.hex() == vector["answer"]


@pytest.mark.parametrize("vector", MASTER["pushed"], ids=name_of)
def test_master_push_matches_the_vector(
    vector: dict[str, Any], asks: Callable[[str, str], tuple[bytes, zmq.Socket[bytes]]]
) -> None:
    listening = [
        asks(each["from"], each["request"])[1] for each in vector["before"] if each["from"] == vector["to"]
    ]
    for each in vector["before"]:
        if each["from"] != vector["to"]:
            asks(each["from"], each["request"])
    asks(vector["from"], vector["request"])
    pushes = [bytes.fromhex(vector["push"])]
    while pushes and (body := listening[0].recv()):
        pushes = [each for each in pushes if each != body]


def test_ping_request_matches_the_vector(their: Callable[[int], zmq.Socket[bytes]]) -> None:
    theirs = their(zmq.ROUTER)
    port = theirs.bind_to_random_port("tcp://127.0.0.1")
    found: list[bool] = []
    asks = threading.Thread(target=lambda: found.append(nep.is_running(f"127.0.0.1:{port}")))
    asks.start()
    who, body = theirs.recv_multipart()
    assert body.hex() == MASTER["ping"]["request"]
    theirs.send_multipart([who, bytes.fromhex(MASTER["ping"]["answer"])])
    asks.join(LONG_MS / 1000)
    assert found == [True]
