"""Fuzz targets for requests and messages of the original NEP and for the files of gateway and bridge."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from nep.errors import NepError
from nep.programs.bridges.configuration import configuration_from_arguments
from nep.programs.bridges.toml_file import EXAMPLE, parse_configuration
from nep.programs.gateway.framing import (
    FrameError,
    FrameFormat,
    escape_for_csharp,
    escape_for_javascript,
    has_replaced_nan,
)
from nep.programs.gateway.portmap import PortMap, Registration, TopicLine
from nep.programs.gateway.requests import (
    PORT_B,
    Member,
    Request,
    RequestError,
    encode_broadcast,
    encode_grant,
    encode_rejection,
    parse_request,
)
from tests.fuzz.target import Targets, joined, parts_of, text_of

TARGETS = Targets()
REQUEST = {
    "node": "n",
    "topic": "t",
    "socket": "publisher",
    "mode": "many2many",
    "msg_type": "json",
    "pid": "42",
    "language": "C++",
}


@TARGETS.add(
    seeds=lambda: [json.dumps(REQUEST).encode(), b'{"topic":"\\ud800","node":"n","socket":"client"}'],
    words=(*tuple(f'"{each}":'.encode() for each in REQUEST), b'"many2one"', b'"subscriber"', b'"surveyor"'),
)
def requests_of_originals(data: bytes) -> None:
    for port in (7000, PORT_B):
        try:
            asked = parse_request(data, port)
        except RequestError as error:
            json.loads(encode_rejection(error))
            continue
        assert isinstance(asked, Request)
        assert json.loads(encode_grant(asked, 50_001))["topic"] == asked.topic
        assert asked.framing in {"prefixed", "bare"}
        member = Member(asked.topic, asked.node, 1, asked.socket, asked.mode, asked.msg_type, asked.pid)
        assert asked.topic in json.loads(encode_broadcast([member])[len(b"master ") :])


def frames() -> Iterator[bytes]:
    yield b't {"a":1, "t": "t", "n": NaN, "s": "\\u0074 \\ud800"}'
    yield b'{"t": [1e999, -Infinity, null], "text": "a NaN t"}'
    yield b'"{\\"a\\": 1}"'
    yield b"t /9j/"
    yield b"/9j/"


SHAPES = tuple(
    FrameFormat("t", framing, codec)
    for framing in ("prefixed", "bare")
    for codec in ("json", "string", "image")
)


@TARGETS.add(FrameError, seeds=frames, words=(b"t ", b"NaN", b"Infinity", b'"\\u0074', b"\\", b'"{'))
def frames_of_originals(data: bytes) -> None:
    for shape in SHAPES:
        shape.matches_filter(data)
        try:
            said = shape.decode_frame(data)
        except FrameError:
            continue
        has_replaced_nan(data, said)
        if shape.codec == "json" and not data.endswith(said):
            json.loads(said, parse_constant=refuse_constant)
        assert shape.decode_frame(shape.encode_frame(said)) == said or shape.codec == "json"
        if shape.codec == "json":
            shield(said)


def refuse_constant(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


def shield(data: bytes) -> None:
    """Check that text escaped for JavaScript and C# decodes to the same value."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        value = None
        escape_for_csharp(escape_for_javascript(data, "t"))
    if value is None:
        return
    for shielded in (escape_for_javascript(data, "t"), escape_for_csharp(data)):
        assert repr(json.loads(shielded)) == repr(value)
    assert not {*b" \n\t\r"} & {*escape_for_csharp(data)}


def files() -> Iterator[bytes]:
    line = TopicLine("t", "bare", "json", "many2many")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.json"
        made = PortMap(path, 1.0)
        made.assign(line, 20_000)
        made.add(Registration(line, "n", "publisher", "json", "A", "c++", 42, 5.0))
        made.save()
        yield path.read_bytes()


@TARGETS.add(
    seeds=files,
    words=(
        b'"version":',
        b'"boot":',
        b'"lines":',
        b'"programs":',
        b'"line":',
        b'"port":',
        b'"started":',
        b"1e999",
    ),
    slower=4,
)
def the_gateways_file(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.json"
        path.write_bytes(data)
        known = PortMap(path, 1.0)
        for each in known.registrations:
            assert each.node_id.encode()
            assert known.port_of(each.line) is not None
        known.save()
        again = PortMap(path, 1.0)
        assert again.base_ports == known.base_ports


# ---- bridges


@TARGETS.add(
    NepError,
    seeds=lambda: [EXAMPLE.encode(), b'topics=[{a="/a"}]\n[a]\nbackend="zeromq"\n[b]\nbackend="memory"\n'],
    words=(
        b"[[topics]]",
        b"max_rate_hz=",
        b"direction=",
        b'"a->b"',
        b"[a]",
        b"nan",
        b"inf",
        b"1979-05-27",
        b'a="/*"',
    ),
    slower=2,
)
def files_of_bridges(data: bytes) -> None:
    made = parse_configuration(text_of(data), "bridge.toml", "bridge")
    assert made.topics
    for each in made.topics:
        assert each.origins
        assert 0.0 <= each.max_rate_hz <= 1e6


@TARGETS.add(
    NepError,
    seeds=lambda: [
        joined([b"zeromq:/t", b"memory:/u", b"a->b"]),
        joined([b"ros@h:11311:/*", b"zeromq:", b"both"]),
    ],
    words=(b"zeromq@", b"memory:", b"nanomsg:", b":7780:", b"/**", b"127.0.0.1"),
)
def bridges_of_one_line(data: bytes) -> None:
    a, b, direction = [*map(text_of, parts_of(data)), "", "", ""][:3]
    made = configuration_from_arguments(a, b, name="x", direction=direction or "both")
    assert len(made.topics) == 1
