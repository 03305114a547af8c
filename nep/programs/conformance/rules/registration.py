"""Rules for the records and requests that a client sends to the master."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from nep.i18n import _, lazy
from nep.messages.codecs import codec_for
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.rule import rule
from nep.programs.conformance.verdict import broken_rule_error, expect, printable
from nep.protocol.requests import MAX_COUNT, derive_id, derive_node_id

_NODE_ID = re.compile(r"[0-9a-f]{16}")
_ENDPOINT = re.compile(r"tcp://(.+):(\d+)")
_ORIGINAL_PORTS = frozenset({7000, 7777, 7780, 12345, 50000, *range(9000, 10000)})


def _text(label: str, record: Mapping[str, Any], name: str) -> str:
    value = record.get(name)
    if not isinstance(value, str):
        raise broken_rule_error(
            _("{what} is {seen}, expected {wanted}").format(
                what=f"{label}.{name}", seen=printable(value), wanted="text"
            )
        )
    return value


def _integer(label: str, value: object, min_value: int, max_value: int) -> int:
    if type(value) is not int or not min_value <= value <= max_value:
        raise broken_rule_error(
            _("{what} is {seen}, expected an integer from {least} to {most}").format(
                what=label, seen=printable(value), least=min_value, most=max_value
            )
        )
    return value


@rule(
    "node-record",
    lazy("The record of a node contains its id, name, host, process, language and generation."),
    "node",
)
def _node_record(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_sub(topic)
    bench.latest_record("subscriber", topic)
    node = bench.requests("subscriber+")[-1].fields.get("node")
    if not isinstance(node, dict):
        expect("node", node, {})
        return
    if not _NODE_ID.fullmatch(_text("node", node, "id")):
        raise broken_rule_error(
            _("node.id is {seen}, expected 16 lowercase hexadecimal digits").format(
                seen=printable(node["id"])
            )
        )
    expect("node.name", node.get("name"), bench.node_name)
    _text("node", node, "host")
    if node.get("pid") is not None:
        _integer("node.pid", node["pid"], 0, 2**32 - 1)
    expect("node.language", node.get("language", "Python"), bench.features.get("language"))
    expect("node.generation", node.get("generation", "native"), "native")


@rule(
    "node-key",
    lazy("Ids are SHA-256 hashes of the node's key and a number."),
    "node-identity",
    "keys",
)
def _node_key(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_pub(topic)
    record = bench.latest_record("publisher", topic)
    node = bench.requests("publisher+")[-1].fields["node"]
    key = _text("node", node, "key")
    expect("node.id", node.get("id"), derive_node_id(key))
    number = _integer("publisher.number", record.get("number"), 1, MAX_COUNT)
    expect("publisher.id", record.get("id"), derive_id(key, number))
    bench.new_sub(topic)
    subscriber = bench.latest_record("subscriber", topic)
    other = _integer("subscriber.number", subscriber.get("number"), 1, MAX_COUNT)
    expect("subscriber.id", subscriber.get("id"), derive_id(key, other))
    if other == number:
        raise broken_rule_error(
            _("publisher and subscriber have the same number {number}").format(number=number)
        )


@rule(
    "publisher-record",
    lazy("The record of a publisher contains its id, topic, type, the codec's name and an endpoint."),
    "publisher",
)
def _publisher_record(bench: Bench) -> None:
    for msg_type in ("json", "string", "bytes", "msgpack"):
        topic = bench.new_topic()
        bench.new_pub(topic, msg_type)
        record = bench.latest_record("publisher", topic)
        _integer("publisher.id", record.get("id"), 1, MAX_COUNT)
        expect("publisher.msg_type", record.get("msg_type"), msg_type)
        expect("publisher.codec", record.get("codec"), codec_for(msg_type).name)
        endpoints = record.get("endpoints")
        if not isinstance(endpoints, list) or not endpoints:
            expect("publisher.endpoints", endpoints, ["tcp://HOST:PORT"])
        expect("publisher.latched", record.get("latched", False), False)


@rule(
    "publisher-port",
    lazy("A publisher doesn't use the ports of the original NEP."),
    "connections",
)
def _publisher_port(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_pub(topic)
    for endpoint in bench.latest_record("publisher", topic).get("endpoints", ()):
        match = _ENDPOINT.fullmatch(str(endpoint))
        if match is not None and int(match.group(2)) in _ORIGINAL_PORTS:
            raise broken_rule_error(
                _("the publisher's endpoint is {endpoint}").format(endpoint=printable(endpoint))
            )


@rule(
    "subscriber-record",
    lazy("The record of a subscriber contains its id, topic and type."),
    "subscriber",
)
def _subscriber_record(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_sub(topic, "string")
    record = bench.latest_record("subscriber", topic)
    _integer("subscriber.id", record.get("id"), 1, MAX_COUNT)
    expect("subscriber.msg_type", record.get("msg_type"), "string")
    expect("subscriber.pattern", record.get("pattern", False), False)


@rule(
    "request-form",
    lazy("A request is a single-part message: a map with 'do', 'call' and 'what'. Call numbers are unique."),
    "the-master",
)
def _request_form(bench: Bench) -> None:
    bench.new_pub(bench.new_topic())
    bench.new_sub(bench.new_topic())
    bench.close_sub(bench.new_sub(bench.new_topic()))
    calls: dict[tuple[str, int], object] = {}
    for request in bench.master.received:
        if request.problem:
            raise broken_rule_error(_("a request is malformed: {problem}").format(problem=request.problem))
        if calls.setdefault((request.sender, request.call), (request.do, request.fields)) != (
            request.do,
            request.fields,
        ):
            raise broken_rule_error(_("two requests have the call number {call}").format(call=request.call))
