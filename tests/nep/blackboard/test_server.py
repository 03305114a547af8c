"""Tests of the services of a blackboard for other programs and of its topic of changes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from itertools import count
from typing import Any

import pytest

import nep
from nep.masters.master import Master
from nep.programs.blackboard.server import BlackboardServer
from tests.nep.programs import eventually

_names = count()
Ask = Callable[..., Any]


@pytest.fixture(params=["memory", "zeromq"])
def where(request: pytest.FixtureRequest, master: Master, patient: None) -> tuple[str, str]:
    """Back end and master address."""
    return request.param, f"served-{next(_names)}" if request.param == "memory" else master.address


@pytest.fixture
def other(where: tuple[str, str]) -> Iterator[nep.Node]:
    with nep.node("other", where[0], master=where[1]) as node:
        yield node


@pytest.fixture
def board(where: tuple[str, str]) -> Iterator[nep.Blackboard]:
    """Blackboard that is served by a node spinning in its own thread."""
    with (
        nep.node("blackboard", where[0], master=where[1]) as node,
        nep.Blackboard(node) as board,
        BlackboardServer(node, board),
    ):
        thread = threading.Thread(target=node.spin)
        thread.start()
        yield board
        node.stop_spin()
        thread.join(60.0)


@pytest.fixture
def ask(other: nep.Node, board: nep.Blackboard) -> Ask:
    def call(what: str, **request: object) -> object:
        return other.new_client(f"blackboard/{what}", timeout_s=30.0).call(request)

    return call


def test_services_set_get_and_list_keys(ask: Ask, board: nep.Blackboard) -> None:
    assert ask("set", key="human.1", value={"name": "é", "at": [1, None]}) == {"set": 1}
    assert ask("set", values={"a": 1, r"b\.c": True}, lives_s=1000) == {"set": 2}
    assert board["human.1"] == {"name": "é", "at": [1, None]}
    found = ask("get", key="human")
    assert (found["found"], found["value"]) == (True, {"1": {"name": "é", "at": [1, None]}})
    assert 0 <= found["age_s"] < 60
    assert ask("get", key="no", default=5) == {"found": False, "value": 5, "age_s": None}
    assert ask("get", key="a", max_age_s=0)["found"] is False
    assert ask("keys") == {"keys": ["a", r"b\.c", "human.1.at", "human.1.name"], "more": 0}
    assert ask("keys", pattern="human.*.name") == {"keys": ["human.1.name"], "more": 0}
    all_ = ask("get")
    assert [each["key"] for each in all_["entries"]] == ["a", r"b\.c", "human.1.at", "human.1.name"]
    assert all_["more"] == 0
    (entry,) = ask("get", pattern="a")["entries"]
    assert entry["left_s"] > 900
    assert {name: entry[name] for name in ("value", "age_by", "source", "robot")} == {
        "value": 1,
        "age_by": "arrival",
        "source": "",
        "robot": "",
    }
    assert ask("get", pattern="**", max_age_s=0) == {"entries": [], "more": 0}


def test_invalid_request_is_rejected_with_a_message(ask: Ask, board: nep.Blackboard, other: nep.Node) -> None:
    refusals: dict[str, tuple[str, Mapping[str, object]]] = {
        "'key' and 'value'": ("set", {}),
        "'key' and 'value', or": ("set", {"key": "a"}),
        "or a map 'values'": ("set", {"values": [1]}),
        "'' isn't a valid key": ("set", {"key": "", "value": 1}),
        "lives_s must be .*, not 0": ("set", {"key": "a", "value": 1, "lives_s": 0}),
        "lives_s must be .*, not 'x'": ("set", {"key": "a", "value": 1, "lives_s": "x"}),
        "'5' isn't a valid key": ("get", {"key": 5}),
        "max_age_s must be .*, not -1": ("get", {"key": "a", "max_age_s": -1}),
        "'None' isn't a valid key": ("keys", {"pattern": None}),
    }
    for sentence, (what, request) in refusals.items():
        with pytest.raises(nep.ServiceError, match=sentence):
            ask(what, **request)
    client = other.new_client("blackboard/get", timeout_s=30.0)
    for wrong in (None, 5, [], "a"):
        with pytest.raises(nep.ServiceError, match="a map, such as "):
            client.call(wrong)
    assert len(board) == 0


def test_values_without_json_equivalent_are_converted(ask: Ask, board: nep.Blackboard) -> None:
    board.put("nan", float("nan"))
    board.put("huge", 10**5000)
    board.put("bytes", b"\xff")
    board.put("half", "\ud800")
    board.put("names", {None: {1: 2}})
    board.put("thing", object)
    values = {each["key"]: each["value"] for each in ask("get")["entries"]}
    assert values["nan"] is None
    assert values["bytes"] == r"b'\xff'"
    assert values["half"] == r"'\ud800'"
    assert values["huge"] in {"int", str(None)} or values["huge"].startswith("1000")
    assert values["names"] == {"null": {"1": 2}}
    assert "object" in values["thing"]
    assert ask("get", key="half")["value"] == r"'\ud800'"


def test_reply_is_bounded_in_entries_and_bytes(ask: Ask, board: nep.Blackboard) -> None:
    board.put("x", {str(number): number for number in range(12_000)})
    answer = ask("get")
    assert (len(answer["entries"]), answer["more"]) == (10_000, 2_000)
    assert ask("keys")["more"] == 2_000
    board.remove("x")
    for number in range(6):
        board.put(f"large.{number}", "x" * 8_000_000)
    answer = ask("get", pattern="large.*")
    assert len(answer["entries"]) + answer["more"] == 6
    assert 1 <= len(answer["entries"]) < 6


def test_each_change_of_a_value_is_published_with_its_cause(
    ask: Ask, board: nep.Blackboard, other: nep.Node
) -> None:
    sub = other.new_sub("/blackboard/changes")
    ask("set", key="a", value=1)
    ask("set", key="a", value=1)
    board.put("a", "\ud800")
    board.put("a", 2)
    board.remove("a")
    told = [sub.listen(timeout_s=30.0)[1] for _number in range(4)]
    assert [(each["blackboard"], each["key"], each["cause"], each["value"]) for each in told] == [  # type: ignore[index]
        ("blackboard", "a", "new", 1),
        ("blackboard", "a", "changed", r"'\ud800'"),
        ("blackboard", "a", "changed", 2),
        ("blackboard", "a", "removed", None),
    ]


def test_wildcard_watch_ignores_change_topics_of_blackboards(
    ask: Ask, board: nep.Blackboard, other: nep.Node
) -> None:
    """Otherwise two blackboards that watch everything would forward each other's changes endlessly."""
    second = nep.Blackboard(other)
    with BlackboardServer(other, second, "second"):
        second.watch("/**")
        board.watch("/**")
        board.watch("/blackboard/changes", key="own")
        pub = other.new_pub("/x")
        pub.publish({"v": 1})
        assert second.wait_for("x.v", timeout_s=30.0) == 1
        assert board.wait_for("x.v", timeout_s=30.0) == 1
        pub.publish({"v": 2})
        board.wait_for("x.v", lambda v: v == 2, timeout_s=30.0)
        second.wait_for("x.v", lambda v: v == 2, timeout_s=30.0)
        eventually(lambda: not board._pending)
        other.spin(timeout_s=0.3)
        pub.publish({"v": 3})
        board.wait_for("x.v", lambda v: v == 3, timeout_s=30.0)
        assert board.keys() == ["x.v"]
        assert second.keys() == ["x.v"]
    second.close()
