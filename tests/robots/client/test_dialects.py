"""Tests of the dialects: commands, replies, who may send them, and who knows a dialect by its name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from app.robots.client import rize
from app.robots.client.dialects import dialect_of, heartbeat, new_id
from app.robots.client.reply import RobotReply
from tests.blocks.samples import robot
from tests.robots.client.views import view

ROOT = Path(__file__).parents[3]
PEPPER, ROSIE = robot(), rize.robot("Rosie")
STUDIO, RIZE = dialect_of(PEPPER), dialect_of(ROSIE)


def test_commands_of_studio_robots() -> None:
    assert STUDIO.invoke(PEPPER, "t1", "me", "say", {"text": "Hi"}) == {
        "id": "t1", "op": "invoke", "from": "me", "action": "say", "input": {"text": "Hi"},
    }  # fmt: skip
    assert STUDIO.cancel("t1", "me", "say") == {"id": "t1", "op": "cancel", "from": "me", "action": "say"}
    stop = {"id": "s1", "op": "stop", "from": "me", "action": "stop", "input": {}}
    assert STUDIO.stop(PEPPER, "s1", "me") == stop
    assert STUDIO.stop(PEPPER, "s1", "me", "key") == {**stop, "ends": "key"}
    assert heartbeat("me").items() >= {"op": "alive", "from": "me"}.items()
    assert new_id("cmd") != new_id("cmd")


def test_commands_of_rize_robots() -> None:
    command = RIZE.invoke(ROSIE, "t1", "me", "say", {"text": "Hi"})
    assert (command["id"], command["robots"], command["node"]) == ("t1", "Rosie", "action")
    assert RIZE.cancel("t1", "me", "say") is None
    assert RIZE.stop(ROSIE, "s1", "me", "key")["node"] == "cancel"


def test_both_dialects_read_replies_as_the_same_value() -> None:
    answer = {"id": "t1", "op": "invoke", "state": "failed", "error": "no voice", "output": 7}
    reply = STUDIO.read(answer)
    assert reply == RobotReply("invoke", "t1", "failed", answer)
    assert (reply.error, dict(reply.output), reply.is_final) == ("no voice", {}, True)
    said = {"id": "t1", "state": "failure", "robots": "Rosie", "primitives": {"primitive": "say"}}
    reply = RIZE.read(said)
    assert reply is not None
    assert (reply.op, reply.id, reply.state, reply.error) == (
        "invoke", "t1", "failed", "Rosie couldn't say",
    )  # fmt: skip
    assert RIZE.read({"id": "t1", "state": "idle"}) is None


@pytest.mark.parametrize("payload", [None, 7, "text", [1], b"x"])
def test_payloads_that_are_not_objects_are_no_replies(payload: object) -> None:
    assert STUDIO.read(payload) is None
    assert RIZE.read(payload) is None


@pytest.mark.parametrize("value", [None, 7, ["succeeded"], {"a": 1}, "dancing"])
def test_invalid_members_of_a_reply_become_empty(value: object) -> None:
    reply = STUDIO.read({"op": value, "id": value, "state": value, "waits_for": value, "feedback": value})
    assert reply is not None
    assert reply.state == ""
    assert reply.op in ("invoke", "", "dancing")
    assert not reply.ends_motion("Pepper")
    assert isinstance(reply.waits_for, tuple)


def test_only_the_announced_program_is_a_studio_robot() -> None:
    graph = view({1: "own", 2: "evil"}, receivers=["own", "evil"], announcers=["own"])
    judged = [STUDIO.is_own(PEPPER, own, node, graph) for own, node in
              [("own", "own"), ("own", "evil"), ("own", None), (None, "own")]]  # fmt: skip
    assert judged == [True, False, None, None]


def test_subscribers_of_its_commands_and_programs_of_the_gateway_are_a_rize_robot() -> None:
    graph = view({1: "evil", 2: "gateway"}, generations={"gateway": "gateway"})
    judged = [RIZE.is_own(ROSIE, None, node, graph) for node in ("evil", "gateway", None)]
    assert judged == [False, True, True]


def test_only_the_client_and_the_driver_ask_for_the_name_of_a_dialect() -> None:
    own = ("app/robots/client/dialects.py", "app/robots/description/", "app/robots/driver/")
    asking = [
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "app").rglob("*.py")
        if not path.relative_to(ROOT).as_posix().startswith(own)
        and re.search(r'\.dialect\s*(==|!=|in\b)|["\']rize["\']', path.read_text(encoding="utf-8"))
    ]
    assert asking == []
