"""Fuzz targets for the arguments of `nep` and for the display of received values on a terminal."""

from __future__ import annotations

import json

import orjson

from nep.cli.topics import topic_patterns
from nep.cli.topics.publish import parse_payload as payload_of
from nep.cli.values import encode_json, format_payload
from nep.errors import EncodeError, NepError, WrongTypeError
from nep.messages.codecs import CODECS
from nep.messages.fields import MISSING, leaf_paths, parse_path, value_at
from nep.system.arguments import (
    check_at_least,
    check_choice,
    check_optional_time_limit,
    check_period,
    check_range,
    check_time_limit,
    check_type_name,
)
from nep.text import escaped, first_control, shortened, strip_controls
from tests.fuzz.target import SEPARATOR, Targets, joined, parts_of, text_of, value_of

TARGETS = Targets()


@TARGETS.add(
    NepError, EncodeError, seeds=lambda: [b'{"a":[1,2]}', b"hello", b"NaN"], words=(b'{"', b"\\u", b"1e999")
)
def payloads(data: bytes) -> None:
    typed = text_of(data).replace("@", "a")  # @ would read a file
    for msg_type in ("string", "bytes", "json"):
        try:
            made = CODECS[msg_type].encode(payload_of(typed, msg_type))
        except EncodeError:
            continue
        assert isinstance(made.data, bytes)


def fields() -> list[bytes]:
    value = orjson.dumps({"pose": {"x": [1, {"a b": 2}]}})
    return [joined([path, value]) for path in (b"pose.x[1]", b'pose.x[-1]["a b"]', b".", b"[0]")]


@TARGETS.add(
    NepError, seeds=fields, words=(b'["', b'"]', b"[-1]", b".x", SEPARATOR, b"[99999999999999999999]")
)
def field_paths(data: bytes) -> None:
    path, *rest = parts_of(data)
    value = value_of(b"".join(rest))
    for leaf in leaf_paths(value):
        try:
            steps = parse_path(leaf)
        except NepError:
            continue  # for example an empty name
        value_at(value, steps)
    found = value_at(value, parse_path(text_of(path)))
    assert found is MISSING or found is not None or value is not None


@TARGETS.add(
    seeds=lambda: [joined([b"/*/odom", b"/robot/odom"]), joined([b"*a*a*a*a*a*b", b"a" * 200])],
    words=(b"**", b"*?", b"*a*a", SEPARATOR, b"/"),
    slower=2,
)
def patterns_of_topics(data: bytes) -> None:
    pattern, *rest = [text_of(part)[:200] for part in parts_of(data)] or [""]
    topic = rest[0] if rest else ""
    topic_patterns.is_pattern(pattern)
    topic_patterns.matches(pattern, topic)
    assert topic_patterns.matches("**", topic)


@TARGETS.add(
    seeds=lambda: [
        orjson.dumps({"id": 2**63, "a": [1.5, None, {"publisher": 3}]}),
        b"[NaN, 1e999, 12345678901234567890123]",
    ],
    words=(b"NaN", b"\\u009b", b"\\ud800", b'"id":'),
    slower=2,
)
def values_on_a_terminal(data: bytes) -> None:
    value = value_of(data)
    for made in (encode_json(value), encode_json(value, indent=True)):
        json.loads(made)
    for whole in (False, True):
        shown = format_payload(value, in_full=whole)
        shown.encode()
        assert not first_control(shown.replace("\n", ""))


@TARGETS.add(
    seeds=lambda: ["a\x1b[31m\u202eb\n\ufeff".encode()],
    words=("\u202e".encode(), b"\x1b", b"\xc2\x9b", b"\n"),
)
def texts_of_strangers(data: bytes) -> None:
    said = text_of(data)
    for lines in (False, True):
        escaped(said, lines=lines).encode()
        strip_controls(said, lines=lines).encode()
        assert not first_control(escaped(said, lines=lines).replace("\n", "").replace("\t", ""))
    assert not first_control(escaped(said))
    assert len(shortened(said, 10)) < 100


@TARGETS.add(
    WrongTypeError,
    ValueError,
    TypeError,
    seeds=lambda: [b"1", b"1.5", b"null", b'"json"', b"-1", b"1e999"],
    words=(b"NaN", b"true", b"18446744073709551616"),
)
def arguments(data: bytes) -> None:
    value = value_of(data)
    failed = []
    for check in (
        lambda: check_type_name("name", value),
        lambda: check_at_least("count", value, 0),
        lambda: check_range("count", value, 0, 9),
        lambda: 1.5 + (check_optional_time_limit("timeout_s", value) or 0.0),
        lambda: 1.5 + check_period("period_s", value),
        lambda: 1.5 + check_time_limit("rate", value),
        lambda: check_choice("mode", value, ("a", "b")),
    ):
        try:
            check()
        except ValueError as error:
            failed.append(error)
    for error in failed:
        assert str(error)
        assert len(str(error)) < 20_000
