"""Tests of calls with typed requests and replies: both ends validate them; untyped programs use maps."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any, TypedDict

import pytest

import nep
from nep.errors import DecodeError, EncodeError, RequestRefusedError, ServiceError
from nep.masters.master import Master

_names = count()
Make = Callable[[str], nep.Node]


@dataclass
class Point:
    x: float
    y: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.x, float) and self.x < 0:
            raise ValueError("x is below 0")


@dataclass
class Way:
    points: list[Point]
    name: str = ""


@dataclass
class Length:
    metres: float
    notes: list[str] = field(default_factory=list)


class Asked(TypedDict):
    name: str


class Told(TypedDict):
    name: str
    age: int


def length_of(way: object) -> Length:
    assert isinstance(way, Way)
    pairs = zip(way.points, way.points[1:], strict=False)
    return Length(sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairs), [way.name])


@pytest.fixture(params=["memory", "zeromq"])
def make(request: pytest.FixtureRequest, master: Master) -> Iterator[Make]:
    """Function that creates nodes in the same network; the nodes are closed after the test."""
    made: list[nep.Node] = []
    where = f"typed-{next(_names)}" if request.param == "memory" else master.address

    def new(name: str) -> nep.Node:
        made.append(nep.node(name, request.param, master=where))
        return made[-1]

    yield new
    for node in made:
        node.close()


@pytest.fixture
def memory() -> Iterator[nep.Node]:
    with nep.node("typed", "memory", master=f"typed-{next(_names)}") as node:
        yield node


def test_typed_call_sends_and_returns_instances(make: Make) -> None:
    make("server").new_server("/length", length_of, threads=1, request=Way, answer=Length)
    client = make("client").new_client("/length", request=Way, answer=Length, timeout_s=30.0)
    way = Way([Point(0, 0), Point(3, 4)], "home")
    assert client.call(way) == Length(5.0, ["home"])
    assert client.call_async(way).result(30.0) == Length(5.0, ["home"])
    assert asyncio.run(client.acall(way)) == Length(5.0, ["home"])


def test_typed_requests_and_replies_are_exchanged_over_msgpack(make: Make) -> None:
    make("server").new_server("/length", length_of, threads=1, request=Way, answer=Length)
    client = make("client").new_client(
        "/length", msg_type="msgpack", request=Way, answer=Length, timeout_s=30.0
    )
    assert client.call(Way([Point(1), Point(2)])) == Length(1.0, [""])


def test_untyped_programs_exchange_maps_with_typed_programs(memory: nep.Node) -> None:
    memory.new_server("/typed", length_of, threads=1, request=Way, answer=Length)
    memory.new_server("/plain", lambda request: request, threads=1)
    plain = memory.new_client("/typed")
    assert plain.call({"points": [{"x": 0}, {"x": 2, "more": 1}]}) == {"metres": 2.0, "notes": [""]}
    typed = memory.new_client("/plain", request=Way, answer=Way)
    way = Way([Point(1.0, 2.0)], "a")
    assert typed.call(way) == way


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"points": [{"x": "left"}]}, "points[0].x"),
        ({"points": [{"x": -1}]}, "x is below 0"),
        ({}, "points"),
        ([], "Way"),
        (None, "Way"),
        ({"points": 5}, "points"),
    ],
)
def test_mismatched_request_is_rejected_before_the_callback(
    memory: nep.Node, asked: object, said: str
) -> None:
    called: list[object] = []
    server = memory.new_server("/a", called.append, threads=1, request=Way)
    with pytest.raises(RequestRefusedError) as caught:
        memory.new_client("/a").call(asked)
    assert said in str(caught.value)
    assert called == []
    assert server.refused == 1


@pytest.mark.parametrize("given", [{"points": []}, None, 5, Length(1.0), Way([Point("left")])])  # type: ignore[arg-type]
def test_request_that_mismatches_the_declared_type_is_not_sent(memory: nep.Node, given: object) -> None:
    server = memory.new_server("/a", lambda request: request, threads=1)
    client = memory.new_client("/a", request=Way)
    with pytest.raises(EncodeError):
        client.call(given)
    assert server.calls == server.refused == 0


@pytest.mark.parametrize("answer", [None, {"metres": 1.0}, 5, Length("far")])  # type: ignore[arg-type]
def test_reply_that_mismatches_the_declared_type_is_a_service_error(memory: nep.Node, answer: object) -> None:
    server = memory.new_server("/a", lambda _request: answer, threads=1, answer=Length)
    with pytest.raises(ServiceError) as caught:
        memory.new_client("/a").call({})
    assert caught.value.kind == "EncodeError"
    assert server.errors == 1


def test_mismatched_reply_raises_decode_error(memory: nep.Node) -> None:
    memory.new_server("/a", lambda _request: {"metres": "far"}, threads=1)
    client = memory.new_client("/a", answer=Length)
    with pytest.raises(DecodeError, match="metres"):
        client.call({})
    with pytest.raises(DecodeError, match="metres"):
        client.call_async({}).result(30.0)


def test_callback_result_none_without_a_reply_type_is_sent_as_an_empty_map(memory: nep.Node) -> None:
    memory.new_server("/a", lambda _request: None, threads=1, request=Way)
    assert memory.new_client("/a").call({"points": []}) == {}


def test_typed_dict_requests_and_replies_are_maps(memory: nep.Node) -> None:
    def answer(asked: Any) -> Told:
        return {"name": asked["name"], "age": 7}

    memory.new_server("/a", answer, threads=1, request=Asked, answer=Told)
    client = memory.new_client("/a", request=Asked, answer=Told)
    assert client.call({"name": "Pepper"}) == {"name": "Pepper", "age": 7}
    with pytest.raises(EncodeError):
        client.call({"nam": "Pepper"})


def test_send_info_and_listen_info_support_typed_requests_and_replies(memory: nep.Node) -> None:
    server = memory.new_server("/a", request=Way, answer=Length)
    client = memory.new_client("/a", request=Way, answer=Length)
    client.send_info(Way([]))
    assert server.listen_info(30.0) == Way([])
    with pytest.raises(EncodeError):
        server.send_info({"metres": 1.0})
    server.send_info(Length(1.0))
    assert client.listen_info() == Length(1.0)


def test_mismatched_original_style_request_is_rejected_and_the_next_request_is_read(memory: nep.Node) -> None:
    server = memory.new_server("/a", request=Way)
    plain = memory.new_client("/a")
    bad, good = plain.call_async({"points": 5}), plain.call_async({"points": []})
    assert server.listen_info(30.0) == Way([])
    server.send_info({"ok": True})
    assert good.result(30.0) == {"ok": True}
    with pytest.raises(RequestRefusedError):
        bad.result(30.0)


def test_surveys_support_typed_questions_and_replies(memory: nep.Node) -> None:
    memory.new_respondent("/who", lambda asked: {"name": "a", "age": len(asked)}, threads=1, question=Asked)
    memory.new_respondent("/who", lambda _asked: {"name": "b", "age": "old"}, threads=1)
    surveyor = memory.new_surveyor("/who", 30_000, question=Asked, answer=Told)
    assert surveyor.ask({"name": "x"}) == [{"name": "a", "age": 1}]
    assert surveyor.failures == 1
    with pytest.raises(EncodeError):
        surveyor.ask({"age": 5})


@pytest.mark.parametrize("kind", [int, dict, list[int], "Way", 5, Way([])])
def test_unsupported_request_and_reply_types_are_rejected(memory: nep.Node, kind: Any) -> None:
    with pytest.raises(ValueError, match=r"dataclass|neither"):
        memory.new_server("/a", length_of, request=kind)
    with pytest.raises(ValueError, match=r"dataclass|neither"):
        memory.new_client("/a", answer=kind)
    with pytest.raises(ValueError, match=r"dataclass|neither"):
        memory.new_surveyor("/a", question=kind)
    assert not memory.graph().services
