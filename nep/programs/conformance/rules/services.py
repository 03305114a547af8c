"""Rules for services and for topics with wildcards. See docs/services.md for the wire format of services."""

from __future__ import annotations

import json
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import zmq

from nep.i18n import _, lazy
from nep.programs.conformance.adapter import AdapterError
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import new_node
from nep.programs.conformance.ports import bind_again, closed_port
from nep.programs.conformance.rule import rule
from nep.programs.conformance.verdict import broken_rule_error, expect, printable
from nep.protocol.requests import AddPublisher, Leave, PublisherRecord
from nep.protocol.service_wire import NATIVE, SERVICE_TYPE, CallKind, Reply, error_reply, topic_of
from nep.protocol.wire import topic_part

_SECTION = "services.md#calls-and-answers"
_JSON_CODEC, _CALL_TIMEOUT_S = 1, 5.0


@contextmanager
def _socket(bench: Bench, kind: int) -> Iterator[zmq.Socket[bytes]]:
    socket = bench.new_socket(kind)
    try:
        yield socket
    finally:
        socket.close(0)


def _wait_for_replies(
    bench: Bench, socket: zmq.Socket[bytes], call_numbers: set[int]
) -> dict[int | None, Reply]:
    """Wait for the replies to the calls with these numbers, and return all replies received, by number."""
    replies: dict[int | None, Reply] = {}

    def has_all() -> bool:
        while socket.poll(0):
            numbered_reply = NATIVE.read_reply(socket.recv_multipart())
            replies[numbered_reply.number] = numbered_reply.reply
        return call_numbers <= replies.keys()

    bench.require(has_all, "answer")
    return replies


@rule(
    "service-record",
    lazy("A server is registered as a publisher of 'nep.service:NAME' with the type and codec 'service'."),
    "services.md#registration",
    "services",
)
def _service_record(bench: Bench) -> None:
    name = bench.new_topic()
    bench.call("serve", service=name)
    record = bench.latest_record("publisher", topic_of(name))
    expect("publisher.msg_type", record.get("msg_type"), SERVICE_TYPE)
    expect("publisher.codec", record.get("codec"), SERVICE_TYPE)


@rule(
    "service-answer",
    lazy("A server replies to each call with the call's number and codec."),
    _SECTION,
    "services",
)
def _service_reply(bench: Bench) -> None:
    name = bench.new_topic()
    bench.call("serve", service=name)
    with _socket(bench, zmq.DEALER) as socket:
        socket.connect(bench.latest_record("publisher", topic_of(name))["endpoints"][0])
        for number in (7, 2**64 - 1):
            socket.send_multipart(NATIVE.encode_call(number, _JSON_CODEC, _CALL_TIMEOUT_S, b'{"a":1}'))
        for reply in _wait_for_replies(bench, socket, {7, 2**64 - 1}).values():
            expect("kind", int(reply.kind), int(CallKind.REPLY))
            expect("codec", reply.codec, _JSON_CODEC)
            expect("payload", json.loads(bytes(reply.data)), {"a": 1})


@rule(
    "service-malformed",
    lazy("A server ignores malformed calls, rejects calls that it can't decode, and keeps serving."),
    _SECTION,
    "services",
)
def _service_malformed(bench: Bench) -> None:
    name = bench.new_topic()
    bench.call("serve", service=name)
    (header, payload) = NATIVE.encode_call(1, _JSON_CODEC, _CALL_TIMEOUT_S, b"{}")
    with _socket(bench, zmq.DEALER) as socket:
        socket.connect(bench.latest_record("publisher", topic_of(name))["endpoints"][0])
        for parts in (
            [header],
            [header[:15], payload],
            [b"\2" + header[1:], payload],
            [header, payload, b""],
        ):
            socket.send_multipart(parts)
        socket.send_multipart(NATIVE.encode_call(2, _JSON_CODEC, _CALL_TIMEOUT_S, b'{"a":'))
        socket.send_multipart(NATIVE.encode_call(3, _JSON_CODEC, _CALL_TIMEOUT_S, b"[]"))
        replies = _wait_for_replies(bench, socket, {2, 3})
        expect("answers", sorted(each or 0 for each in replies), [2, 3])
        expect("kind", int(replies[2].kind), int(CallKind.REJECTED))


@contextmanager
def _server(bench: Bench, name: str) -> Iterator[zmq.Socket[bytes]]:
    with _socket(bench, zmq.ROUTER) as socket:
        port = socket.bind_to_random_port("tcp://127.0.0.1")
        with _registered_server(bench, name, f"tcp://127.0.0.1:{port}"):
            yield socket


@contextmanager
def _registered_server(bench: Bench, name: str, endpoint: str) -> Iterator[None]:
    node = new_node("tester_server")
    id = secrets.randbits(62) | 1
    record = PublisherRecord(id, topic_of(name), SERVICE_TYPE, SERVICE_TYPE, (endpoint,))
    bench.master.submit(AddPublisher(node, record))
    try:
        yield
    finally:
        bench.master.submit(Leave(node.id))


def _reply_to_call(bench: Bench, socket: zmq.Socket[bytes], number: int, reply: Reply) -> Any:  # noqa: ANN401 - JSON
    """Reply to the adapter's pending call, and return the result of the call in the adapter."""
    bench.require(lambda: bool(socket.poll(0)), "call")
    sender, *parts = socket.recv_multipart()
    call = NATIVE.read_call(parts)
    expect("call.codec", call.codec in {1, 4}, True)
    if call.timeout_s is None or not 0 < call.timeout_s <= 2 * _CALL_TIMEOUT_S:
        raise broken_rule_error(_("the call's timeout is {seen}").format(seen=printable(call.timeout_s)))
    data = reply.data if reply.kind != CallKind.REPLY else call.data
    sent_reply = Reply(reply.kind, data, call.codec if reply.kind == CallKind.REPLY else _JSON_CODEC)
    socket.send_multipart([sender, *NATIVE.encode_reply(call.number, sent_reply)])
    return bench.wait_for_reply(number, "call").get("value")


@rule(
    "service-call",
    lazy("A client calls the server listed by the master and returns its reply."),
    _SECTION,
    "services",
)
def _service_call(bench: Bench) -> None:
    name = bench.new_topic()
    with _server(bench, name) as socket:
        number = bench.adapter.send_request(
            "call", service=name, value={"a": [1, None]}, timeout_s=_CALL_TIMEOUT_S
        )
        value = _reply_to_call(bench, socket, number, Reply(CallKind.REPLY, b""))
        expect("value", value, {"a": [1, None]})


@rule(
    "other-socket-at-server",
    lazy(
        "If a ZeroMQ socket of another program occupies the server's port, a call waits for the "
        "server and is then sent."
    ),
    "a-failed-handshake",
    "services",
)
def _other_socket_at_server(bench: Bench) -> None:
    name = bench.new_topic()
    with closed_port() as endpoint:
        pass
    with _registered_server(bench, name, endpoint):
        number = bench.adapter.send_request("call", service=name, value=1, timeout_s=_CALL_TIMEOUT_S)
        bench.fail_handshake("PUB", endpoint)
        with _socket(bench, zmq.ROUTER) as socket:
            bind_again(socket, endpoint)
            value = _reply_to_call(bench, socket, number, Reply(CallKind.REPLY, b""))
    expect("value", value, 1)


@rule(
    "service-error",
    lazy("A client reports errors and rejected calls as errors, not as replies."),
    _SECTION,
    "services",
)
def _service_error(bench: Bench) -> None:
    name = bench.new_topic()
    with _server(bench, name) as socket:
        for kind, error in ((CallKind.ERROR, "ValueError"), (CallKind.REJECTED, "")):
            number = bench.adapter.send_request("call", service=name, value={}, timeout_s=_CALL_TIMEOUT_S)
            try:
                value = _reply_to_call(
                    bench, socket, number, error_reply(kind, error, "rejected by the tester")
                )
            except AdapterError:
                continue
            raise broken_rule_error(
                _("the client returned {seen} as the reply").format(seen=printable(value))
            )


@rule(
    "pattern",
    lazy("A subscriber with wildcards receives all matching topics and sends a hello for each."),
    "the-master",
    "patterns",
)
def _pattern(bench: Bench) -> None:
    prefix = bench.new_topic()
    sub = bench.new_sub(f"{prefix}/*", pattern=True)
    expect("subscriber.pattern", bench.latest_record("subscriber", f"{prefix}/*").get("pattern"), True)
    publishers = [bench.create_publisher(f"{prefix}/{name}") for name in ("one", "two")]
    for publisher in publishers:
        bench.require(lambda: bool(publisher.hellos), "hello")  # noqa: B023 - called immediately
        if topic_part(publisher.topic) not in [each.prefix for each in publisher.filters]:
            raise broken_rule_error(
                _("the subscriber didn't subscribe to {topic}").format(topic=publisher.topic)
            )
        publisher.send(b'{"a":1}')
    bench.require(lambda: len(bench.events(sub)) >= 2, "message")
    topics = {each.get("topic") for each in bench.events(sub)}
    expect("topics", topics, {publisher.topic for publisher in publishers})
