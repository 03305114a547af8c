"""Write the generated test vectors of the native wire: tests/data/wire.

    python tools/wire_vectors.py          write the files
    python tools/wire_vectors.py --check  exit with 1 if a file is out of date

`filters.json`, `notices.json`, `master.json` and `malformed.json` are generated; `messages.json`,
`batches.json`, `ids.json` and `services.json` are edited manually. See tests/data/wire/README.md for
their format. The error code of a malformed message follows from its generator, independently of the
parser under test.
"""

from __future__ import annotations

import argparse
import json
import struct
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgpack  # type: ignore[import-untyped]

from nep.masters.graph import Graph
from nep.protocol import requests, wire
from nep.protocol.encoding import encode_reply, encode_request

FOLDER = Path(__file__).resolve().parents[1] / "tests" / "data" / "wire"
MALFORMED_COUNT = 1000
EPOCH = 1234605616436508552
KEY = "000102030405060708090a0b0c0d0e0f"
OTHER_KEY = "f0f1f2f3f4f5f6f7f8f9fafbfcfdfeff"
PUBLISHER, SUBSCRIBER = requests.derive_id(KEY, 1), requests.derive_id(KEY, 2)
TOPIC = "example"
STAMP_NS = 1700000000000000000
PAYLOAD = b'{"message":"hello"}'


def as_text(value: Any) -> Any:  # noqa: ANN401 - any plain value
    """Convert every integer in `value`, including keys, to decimal text."""
    if isinstance(value, bool) or value is None or isinstance(value, (str, float)):
        return value
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Mapping):
        return {as_text(key): as_text(item) for key, item in value.items()}
    return [as_text(item) for item in value]


def filters() -> list[dict[str, Any]]:
    """Return valid and malformed filters of subscribers: topics, hellos, and answers to echoes and offers."""
    cases: list[dict[str, Any]] = [
        {"name": "topic", "filter": wire.topic_part(TOPIC).hex(), "means": {"kind": "topic", "topic": TOPIC}},
        {
            "name": "topic beyond ASCII",
            "filter": wire.topic_part("/größe").hex(),
            "means": {"kind": "topic", "topic": "/größe"},
        },
    ]
    levels: tuple[dict[str, bool], ...] = (
        {},
        {"reads_one_part": True},
        {"acknowledges_echoes": True},
        {"reads_batches": True},
    )
    for level, options in enumerate(levels):
        for subscriber, topic in ((SUBSCRIBER, TOPIC), (1, "/a/b"), (2**63 - 1, "/größe")):
            cases.append(
                {
                    "name": f"hello of level {level} for {topic}",
                    "filter": wire.hello_part(subscriber, topic, **options).hex(),
                    "means": {
                        "kind": "hello",
                        "subscriber": str(subscriber),
                        "topic": topic,
                        "level": level,
                    },
                }
            )
    for seq, bound_bytes in ((1, 24 * 2**20), (2**40, 192 * 2**20), (2**64 - 1, 2**64 - 1)):
        read = wire.Acknowledgement(SUBSCRIBER, PUBLISHER, seq, bound_bytes)
        cases.append(
            {
                "name": f"read up to {seq}",
                "filter": wire.acknowledgement_part(read).hex(),
                "means": {"kind": "read", **as_text(read._asdict())},
            }
        )
    for generation in (1, 2**32 - 1):
        shares = wire.OfferAcceptance(SUBSCRIBER, PUBLISHER, generation)
        cases.append(
            {
                "name": f"reads shared memory of generation {generation}",
                "filter": wire.acceptance_part(shares).hex(),
                "means": {"kind": "shares", **as_text(shares._asdict())},
            }
        )
    return [*cases, *malformed_filters()]


def malformed_filters() -> list[dict[str, Any]]:
    """Return malformed filters, which a publisher must ignore."""
    digits = b"%016x" % SUBSCRIBER
    malformed = {
        "hello without a topic": b"\xffhello/" + digits,
        "hello with 15 digits": b"\xffhello/" + digits[1:] + b"/example",
        "hello with 17 digits": b"\xffhello/0" + digits + b"/example",
        "hello with a sign": b"\xffhello/+" + digits[1:] + b"/example",
        "hello with an underscore": b"\xffhello/" + digits[:8] + b"_" + digits[9:] + b"/example",
        "hello of level 4": b"\xffhello4/" + digits + b"/example",
        "hello whose topic is not UTF-8": b"\xffhello/" + digits + b"/\xc3",
        "read with three numbers": b"\xffread/" + b"/".join([digits] * 3),
        "read with five numbers": b"\xffread/" + b"/".join([digits] * 5),
        "read with a letter": b"\xffread/" + b"/".join([digits] * 3) + b"/000000000000000g",
        "shares with two numbers": b"\xffshares/" + b"/".join([digits] * 2),
        "an unknown word": b"\xffbonjour/" + digits + b"/example",
        "ff alone": b"\xff",
    }
    return [{"name": name, "filter": each.hex(), "error": "filter"} for name, each in malformed.items()]


def notices() -> list[dict[str, Any]]:
    """Return the notices that a publisher sends in reply to a hello, and a message sent under a hello."""
    hello = wire.hello_part(SUBSCRIBER, TOPIC, reads_batches=True)
    kinds: list[tuple[str, str, wire.Header, bytes | None]] = [
        ("echo", "echo before the first message", wire.Header(1, 0, 0, STAMP_NS, PUBLISHER), None),
        ("echo", "echo", wire.Header(1, 0, 41, STAMP_NS, PUBLISHER), None),
        ("bye", "bye", wire.Header(1, wire.BYE, 42, STAMP_NS, PUBLISHER), None),
        ("bye", "bye without a message", wire.Header(4, wire.BYE, 0, STAMP_NS, PUBLISHER), None),
        ("offer", "offer", wire.Header(3, wire.OFFER, 42, STAMP_NS, PUBLISHER, 1), None),
        (
            "latched",
            "latched",
            wire.Header(1, wire.LATCHED, 41, STAMP_NS, PUBLISHER, len(PAYLOAD)),
            PAYLOAD,
        ),
        ("alone", "alone", wire.Header(1, 0, 43, STAMP_NS, PUBLISHER, len(PAYLOAD)), PAYLOAD),
    ]
    cases = []
    for kind, name, header, payload in kinds:
        means = {
            "kind": kind,
            "subscriber": str(SUBSCRIBER),
            "topic": TOPIC,
            "codec": header.codec,
            "flags": header.flags,
            "seq": str(header.seq),
            "stamp_ns": str(header.stamp_ns),
            "publisher": str(header.publisher),
            **({"generation": header.size} if kind == "offer" else {}),
            **({} if payload is None else {"payload": payload.hex()}),
        }
        parts = [hello, header.pack(), *([] if payload is None else [payload])]
        cases.append({"name": name, "parts": [each.hex() for each in parts], "means": means})
    return cases


def node(key: str, name: str) -> requests.NodeRecord:
    """Create the record of a node with this key."""
    return requests.NodeRecord(requests.derive_node_id(key), name, "here", 4711, key=key)


TALKER, LISTENER = node(KEY, "talker"), node(OTHER_KEY, "listener")
ODOM = requests.PublisherRecord(PUBLISHER, "/odom", "json", "json", ("tcp://127.0.0.1:40000",), number=1)
LISTENS = requests.SubscriberRecord(requests.derive_id(OTHER_KEY, 1), "/odom", "json", number=1)
ADDS, SUBSCRIBES = requests.AddPublisher(TALKER, ODOM), requests.AddSubscriber(LISTENER, LISTENS)
ALL = requests.PublisherRecord(
    requests.derive_id(KEY, 3), "/map", "json", "json", ("tcp://127.0.0.1:40001",), True, False, 3, 5
)
COUNTS = requests.PublisherCount(PUBLISHER, 12, 2**40, 12, STAMP_NS)
RECEIVED = requests.SubscriberCount(LISTENS.id, 11, 1)
Asked = tuple[str, requests.Request]
"""Request of the native wire, with the name of the connection that sends it ("talker" or "listener")."""

ASKED: tuple[tuple[str, Sequence[Asked], Asked], ...] = (
    ("ping", (), ("talker", requests.Ping())),
    ("a publisher registers", (), ("talker", ADDS)),
    ("a publisher registers twice", (("talker", ADDS),), ("talker", ADDS)),
    ("a publisher with a subscriber registers", (("listener", SUBSCRIBES),), ("talker", ADDS)),
    ("a subscriber registers", (), ("listener", SUBSCRIBES)),
    ("a subscriber with a publisher registers", (("talker", ADDS),), ("listener", SUBSCRIBES)),
    (
        "a publisher unregisters",
        (("talker", ADDS),),
        ("talker", requests.RemovePublisher(TALKER.id, PUBLISHER, 2**53 + 1)),
    ),
    (
        "a subscriber unregisters",
        (("listener", SUBSCRIBES),),
        ("listener", requests.RemoveSubscriber(LISTENER.id, LISTENS.id)),
    ),
    ("a node leaves", (("talker", ADDS),), ("talker", requests.Leave(TALKER.id))),
    (
        "a node joins with its publishers",
        (("listener", SUBSCRIBES),),
        ("talker", requests.Join(TALKER, 77, (ODOM, ALL), ())),
    ),
    (
        "a subscriber's node joins",
        (("talker", ADDS),),
        ("listener", requests.Join(LISTENER, 0, (), (LISTENS,))),
    ),
    (
        "a publisher's node renews",
        (("talker", ADDS),),
        ("talker", requests.Renew(TALKER.id, EPOCH, 3, (COUNTS,), (), 0.25)),
    ),
    (
        "a subscriber's node renews and receives last seqs",
        (
            ("talker", ADDS),
            ("listener", SUBSCRIBES),
            ("talker", requests.Renew(TALKER.id, EPOCH, 3, (COUNTS,))),
        ),
        ("listener", requests.Renew(LISTENER.id, EPOCH, 5, (), (RECEIVED,))),
    ),
    (
        "a renewal with an old revision receives the topic's publishers",
        (("listener", SUBSCRIBES), ("talker", ADDS)),
        ("listener", requests.Renew(LISTENER.id, EPOCH, 3, (), (RECEIVED,))),
    ),
    ("an unknown node renews and has to join", (), ("talker", requests.Renew(TALKER.id, EPOCH, 0))),
    (
        "a node renews with another epoch and has to join",
        (("talker", ADDS),),
        ("talker", requests.Renew(TALKER.id, EPOCH - 1, 3, (COUNTS,))),
    ),
    (
        "a publisher reports subscribers without a hello",
        (("listener", SUBSCRIBES), ("talker", ADDS)),
        ("talker", requests.ReportMissing(TALKER.id, PUBLISHER, (LISTENS.id,))),
    ),
    (
        "an invalid topic",
        (),
        ("talker", requests.AddPublisher(TALKER, requests.PublisherRecord(PUBLISHER, "a b", "json", "json"))),
    ),
    (
        "an id that is not derived from the key",
        (),
        (
            "talker",
            requests.AddPublisher(TALKER, requests.PublisherRecord(7, "/odom", "json", "json", (), number=1)),
        ),
    ),
    (
        "another connection sends a request of the node",
        (("talker", ADDS),),
        ("listener", requests.Leave(TALKER.id)),
    ),
)
PUSHED: tuple[tuple[str, Sequence[Asked], Asked], ...] = (
    ("a publisher registered", (("listener", SUBSCRIBES),), ("talker", ADDS)),
    (
        "a publisher closed",
        (("listener", SUBSCRIBES), ("talker", ADDS)),
        ("talker", requests.RemovePublisher(TALKER.id, PUBLISHER, 2**53 + 1)),
    ),
    (
        "a node left",
        (
            ("listener", SUBSCRIBES),
            ("talker", ADDS),
            ("talker", requests.Renew(TALKER.id, EPOCH, 3, (COUNTS,))),
        ),
        ("talker", requests.Leave(TALKER.id)),
    ),
)


class _Master:
    def __init__(self) -> None:
        self._graph = Graph(EPOCH, 0.0, learn_s=0.0)
        self._calls = {"talker": 0, "listener": 0}

    def ask(self, asked: Asked) -> tuple[bytes, bytes, list[bytes]]:
        sender, request = asked
        self._calls[sender] += 1
        call = self._calls[sender]
        outgoing = self._graph.apply(request, call, 0.0, sender, is_foreign=True)
        reply = next(encode_reply(each.body, call) for each in outgoing if each.call is not None)
        pushes = [encode_reply(each.body) for each in outgoing if each.call is None]
        return encode_request(request, call), reply, pushes


def master() -> dict[str, Any]:
    """Return requests with the master's replies, and the messages that the master pushes."""
    request_cases = []
    for name, before, last in ASKED:
        fake_master = _Master()
        first = [{"from": each[0], "request": fake_master.ask(each)[0].hex()} for each in before]
        request, reply, _pushes = fake_master.ask(last)
        request_cases.append(
            {
                "name": name,
                "before": first,
                "from": last[0],
                "request": request.hex(),
                "means": as_text(msgpack.unpackb(request)),
                "answer": reply.hex(),
                "answer_means": as_text(msgpack.unpackb(reply, strict_map_key=False)),
            }
        )
    pushed = []
    for name, before, last in PUSHED:
        fake_master = _Master()
        first = [{"from": each[0], "request": fake_master.ask(each)[0].hex()} for each in before]
        request, _reply, (push,) = fake_master.ask(last)
        pushed.append(
            {
                "name": name,
                "before": first,
                "from": last[0],
                "request": request.hex(),
                "to": "listener",
                "push": push.hex(),
                "means": as_text(msgpack.unpackb(push, strict_map_key=False)),
            }
        )
    ping = encode_request(requests.Ping(), 1)
    done_reply = encode_reply(requests.DoneReply(1, 0), 1)
    return {
        "epoch": str(EPOCH),
        "asked": request_cases,
        "pushed": pushed,
        "ping": {"request": ping.hex(), "answer": done_reply.hex()},
    }


class _Bytes:
    """Generator of deterministic pseudorandom bytes, the same on every platform."""

    def __init__(self, seed: str) -> None:
        self._seed, self._count = seed, 0

    def bytes(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            self._count += 1
            data += sha256(f"{self._seed}/{self._count}".encode()).digest()
        return data[:size]

    def below(self, limit: int) -> int:
        return int.from_bytes(self.bytes(8), "little") % limit

    def of(self, choices: Sequence[Any]) -> Any:  # noqa: ANN401 - type of the choices
        return choices[self.below(len(choices))]


Parts = list[bytes]
_TOPIC_PART = wire.topic_part(TOPIC)
_EXTENSION = msgpack.packb({"frame_id": "base"})
_INVALID_IN_TOPICS = (
    *(chr(each) for each in (*range(1, 0x21), 0x7F, 0x80, 0x85, 0x9F, 0xA0)),
    *"\u061c\u1680\u2000\u200a\u200b\u200e\u200f\u2028\u2029\u202a\u202e\u202f\u205f\u2060\u2066\u206f\u3000\ufeff\ufff9{",
)
_INVALID_UTF8 = (
    b"\xff",
    b"\xc3",
    b"\xc0\xaf",
    b"\xed\xa0\x80",
    b"\xf5\x80\x80\x80",
    b"\xe2\x82",
    b"\x80",
    b"\xfe",
)


def _header(rng: _Bytes, codec: int = 1, flags: int = 0, size: int = 0, version: int = 1) -> bytes:
    numbers = rng.below(2**40) + 1, STAMP_NS + rng.below(10**9), rng.below(2**62) + 1
    return struct.pack("<BBHIQQQ", version, codec, flags, size, *numbers)


def _part_count(rng: _Bytes) -> Parts:
    header, payload = _header(rng), rng.bytes(rng.below(20))
    return [
        *rng.of(
            (
                [],
                [_TOPIC_PART],
                [_TOPIC_PART + header[: rng.below(32)]],
                [rng.bytes(rng.below(60)).replace(b"\0", b"a")],
                [_TOPIC_PART, header],
                [_TOPIC_PART, header, payload, _EXTENSION],
                [_TOPIC_PART, header, payload, _EXTENSION, payload],
                [_TOPIC_PART, _header(rng, flags=wire.EXTENSION), payload],
                [_TOPIC_PART + _header(rng, flags=wire.EXTENSION) + payload],
                [_TOPIC_PART, header, payload, payload, payload, payload],
            )
        )
    ]


def _topic_end(rng: _Bytes) -> Parts:
    first = rng.of((b"", b"example", b"example\0a", b"\0example", "größe".encode(), b"a" * 201, b"\xff"))
    return [first, _header(rng), rng.bytes(rng.below(20))]


def _topic(rng: _Bytes) -> Parts:
    letter = rng.of(_INVALID_IN_TOPICS).encode()
    name = rng.of((b"%sa", b"a%sb", b"/robot/%s")) % rng.of((letter, letter, letter, rng.of(_INVALID_UTF8)))
    name = rng.of((name, name, name, name, b"", b"x" * 201, "ü".encode() * 101, b"a\0b"))
    tail = _header(rng), rng.bytes(rng.below(20))
    return [name + b"\0", *tail] if rng.below(2) or b"\0" in name else [name + b"\0" + b"".join(tail)]


def _header_size(rng: _Bytes) -> Parts:
    header = _header(rng) + bytes(8)
    size = rng.of((0, 1, 4, 16, 24, 31, 33, 40))
    tail: Parts = rng.of(([], [b"{}"], [b"{}", _EXTENSION], [b""]))
    return [_TOPIC_PART, header[:size], *tail]


def _version(rng: _Bytes) -> Parts:
    number = rng.of((0, 2, 3, 9, 128, 255))
    payload = rng.bytes(rng.below(20))
    header = _header(rng, rng.below(256), rng.below(2**16), rng.below(2**32), version=number)
    return rng.of(([_TOPIC_PART, header, payload], [_TOPIC_PART + header + payload], [_TOPIC_PART, header]))  # type: ignore[no-any-return]


def _payload_size(rng: _Bytes) -> Parts:
    payload = rng.bytes(rng.below(40))
    claimed = rng.of((len(payload) + 1, len(payload) + 32, 2**31, 2**32 - 1, max(1, len(payload) - 1)))
    claimed += claimed == len(payload)
    header = _header(rng, size=claimed)
    extended = _header(rng, flags=wire.EXTENSION, size=claimed)
    return rng.of(  # type: ignore[no-any-return]
        (
            [_TOPIC_PART, header, payload],
            [_TOPIC_PART + header + payload],
            [_TOPIC_PART, extended, payload, _EXTENSION],
        )
    )


def _extension(rng: _Bytes) -> Parts:
    cut = 1 + rng.below(len(_EXTENSION) - 1)
    part = rng.of(
        (
            b"",
            _EXTENSION[:cut],
            _EXTENSION + rng.bytes(1 + rng.below(5)),
            msgpack.packb(rng.of((None, True, 7, "text", [1, 2], 0.5))),
            msgpack.packb({1 + rng.below(100): "a"}),
            b"\xc1",
            b"\x81\xa1a" + b"\x91" * (64 + rng.below(200)) + b"\xc0",
            b"\x81\xa1a\xdd\xff\xff\xff\xff",
            b"\xdf\xff\xff\xff\xff\xa1a\xc0",
            b"\x81\xa1a\xdb\xff\xff\xff\xffabc",
        )
    )
    return [_TOPIC_PART, _header(rng, flags=wire.EXTENSION), rng.bytes(rng.below(20)), part]


def _table(rng: _Bytes, count: int, sizes: Sequence[int]) -> bytes:
    stamps = [STAMP_NS + rng.below(10**9) for _each in sizes]
    return struct.pack(f"<I{len(sizes)}I{len(sizes)}Q", count, *sizes, *stamps)


def _batch(rng: _Bytes, body: bytes, flags: int = wire.BATCH, size: int | None = None) -> Parts:
    header = _header(rng, flags=flags, size=len(body) if size is None else size)
    return [_TOPIC_PART + header + body]


def _whole(rng: _Bytes) -> bytes:
    sizes = [rng.below(12) for _each in range(1 + rng.below(4))]
    return _table(rng, len(sizes), sizes) + rng.bytes(sum(sizes))


def _batch_form(rng: _Bytes) -> Parts:
    body = _whole(rng)
    other = rng.of((wire.LATCHED, wire.BYE, wire.SHARED, wire.OFFER, 64, 2**15))
    (frame,) = _batch(rng, body)
    cut = len(_TOPIC_PART)
    return rng.of(  # type: ignore[no-any-return]
        (
            _batch(rng, body, wire.BATCH | other),
            _batch(rng, body, wire.BATCH | other, size=len(body) + 1),
            [frame[:cut], frame[cut : cut + 32], frame[cut + 32 :]],
            [_TOPIC_PART, _header(rng, flags=wire.BATCH | wire.EXTENSION), body, _EXTENSION],
        )
    )


def _batch_size(rng: _Bytes) -> Parts:
    body = _whole(rng)
    return _batch(rng, body, size=rng.of((0, len(body) - 1, len(body) + 1, 2**32 - 1)))


def _batch_count(rng: _Bytes) -> Parts:
    count = rng.of((0, 257, 258, 1000, 2**31, 2**32 - 1))
    sizes = [rng.below(5) for _each in range(rng.below(4))]
    body = _table(rng, count, sizes) + rng.bytes(sum(sizes))
    return _batch(rng, rng.of((body, body, body, b"", body[: 1 + rng.below(3)])))


def _batch_table(rng: _Bytes) -> Parts:
    sizes = [rng.below(5) for _each in range(1 + rng.below(5))]
    table = _table(rng, len(sizes), sizes)
    return _batch(rng, rng.of((table[: 4 + rng.below(len(table) - 4)], struct.pack("<I", 256))))


def _batch_sizes(rng: _Bytes) -> Parts:
    sizes = [rng.below(9) for _each in range(1 + rng.below(5))]
    payloads = rng.bytes(sum(sizes))
    claimed = list(sizes)
    claimed[rng.below(len(claimed))] += rng.of((1, 7, 2**31, 2**32 - 9))
    short = _table(rng, len(sizes), sizes) + payloads + rng.bytes(1 + rng.below(4))
    return _batch(rng, rng.of((_table(rng, len(claimed), claimed) + payloads, short)))


def _codec(rng: _Bytes) -> Parts:
    number = rng.of((0, 6, 7, 99, 128, 255))
    payload = rng.bytes(rng.below(20))
    header = _header(rng, number, size=rng.of((0, len(payload))))
    batch = struct.pack("<IIQ", 1, len(payload), STAMP_NS) + payload
    return rng.of(  # type: ignore[no-any-return]
        (
            [_TOPIC_PART, header, payload],
            [_TOPIC_PART + header + payload],
            [_TOPIC_PART + _header(rng, number, wire.BATCH, len(batch)) + batch],
        )
    )


KINDS: tuple[tuple[str, Callable[[_Bytes], Parts]], ...] = (
    ("part-count", _part_count),
    ("topic-end", _topic_end),
    ("topic", _topic),
    ("header-size", _header_size),
    ("version", _version),
    ("payload-size", _payload_size),
    ("extension", _extension),
    ("batch-form", _batch_form),
    ("payload-size", _batch_size),
    ("batch-count", _batch_count),
    ("batch-table", _batch_table),
    ("batch-sizes", _batch_sizes),
    ("codec", _codec),
)


def malformed() -> Iterator[list[str]]:
    """Yield the error code and the parts (hexadecimal) of each malformed message, without duplicates."""
    seen: set[tuple[bytes, ...]] = set()
    number = 0
    while len(seen) < MALFORMED_COUNT:
        code, make = KINDS[number % len(KINDS)]
        parts = make(_Bytes(f"nep malformed {number}"))
        number += 1
        if tuple(parts) not in seen:
            seen.add(tuple(parts))
            yield [code, *(each.hex() for each in parts)]


def files() -> dict[str, str]:
    """Return the text of each generated file by its name."""
    contents: dict[str, Any] = {"filters": filters(), "notices": notices(), "master": master()}
    texts = {f"{name}.json": json.dumps(value, indent=1) + "\n" for name, value in contents.items()}
    lines = ",\n".join(json.dumps(each, separators=(",", ":")) for each in malformed())
    return {**texts, "malformed.json": f"[\n{lines}\n]\n"}


def main() -> int:
    """Write the files, or check that they are up to date; return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true")
    is_check = parser.parse_args().check
    stale = 0
    for name, text in files().items():
        path = FOLDER / name
        if is_check:
            stale += not path.is_file() or path.read_text("utf-8") != text
        else:
            path.write_text(text, "utf-8", newline="\n")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
