"""Tests that a bridge forwards no message that would move a robot without permission, in either direction."""

from __future__ import annotations

import json

import pytest

import nep
from nep.programs.bridges import Bridge
from tests.nep.bridges.joined import configured, nets, route, taken, topic
from tests.nep.cli.conftest import type_in as type_in
from tests.nep.programs import eventually

ORDER = {"op": "invoke", "action": "walk"}


def describe(robot: nep.Node, name: str, command: str) -> nep.Subscriber:
    """Publish a robot description with its own command topic. Return a subscriber of that topic."""
    description = {"title": name, "rb:topics": {"command": command}}
    robot.new_pub(f"/{name}/description", "robot/description", latched=True).publish(description)
    return robot.new_sub(command)


@pytest.mark.parametrize("direction", ["a->b", "b->a"])
def test_bridge_blocks_messages_that_move_a_robot_under_another_topic_name(direction):
    """The robot joins after the bridge has started, so each message is checked."""
    with nets("zeromq", "memory") as (a, b):
        near, far = (a, b) if direction == "a->b" else (b, a)
        names = ("/innocent", "/orders") if direction == "a->b" else ("/orders", "/innocent")
        with Bridge(configured(a, b, topic(*names, direction)), allow_moving=()) as bridge:
            assert bridge.wait_until_ready(30.0)
            assert bridge.denial_reasons(60.0) == ()
            carried = route(bridge, direction[0], "/innocent")
            says, hears = near.node("says").new_pub("/innocent"), far.node("hears").new_sub("/orders")
            eventually(lambda: says.subscribers)
            says.publish("before")
            assert taken(hears, 1) == ["before"]
            told = describe(far.node("rover"), "Rover", "/orders")
            says.publish(ORDER)
            eventually(lambda: carried.counts().failed == 1)
            assert "--allow-moving Rover" in carried.counts().problem
            assert told.received == 0


def test_bridge_forwards_to_an_allowed_robot_and_patterns_match_no_other_robot():
    with nets("memory", "memory") as (a, b):
        rover, fido = b.node("robots"), b.node("others")
        told, other = describe(rover, "Rover", "/r/Rover/go"), describe(fido, "Fido", "/r/Fido/go")
        with Bridge(configured(a, b, topic("/x/**", "/r/**", "a->b")), allow_moving=["Rover"]) as bridge:
            assert bridge.wait_until_ready(30.0)
            says = a.node("says")
            allowed, refused = says.new_pub("/x/Rover/go"), says.new_pub("/x/Fido/go")
            eventually(lambda: allowed.subscribers and refused.subscribers)
            allowed.publish(ORDER)
            refused.publish(ORDER)
            assert taken(told, 1) == [ORDER]
            eventually(lambda: route(bridge, "a", "/x/Fido/go").counts().failed == 1)
            assert other.received == 0


def test_command_rejects_topics_that_move_a_robot_unless_allowed(type_in, tmp_path, monkeypatch):
    monkeypatch.setattr("nep.cli.programs.bridge._ROBOT_DISCOVERY_S", 60.0)
    with nets("nanomsg", "zeromq") as (a, b):

        def bridge(target: str, *words: str, msg_type: str = "json"):
            path = tmp_path / "lab.toml"
            sides = "".join(
                f'[{side}]\nbackend = "{net.backend}"\nmaster = "{net.master}"\n'
                for side, net in (("a", a), ("b", b))
            )
            lines = (
                f'[[topics]]\na = "/innocent"\nb = "{target}"\ndirection = "a->b"\nb_type = "{msg_type}"\n'
            )
            path.write_text(sides + lines, encoding="utf-8")
            done = type_in("bridge", str(path), "-n", "1", "--json", *words)
            return done.returncode, " ".join(done.stderr.replace("│", "").split()), done.stdout

        code, said, _out = bridge("/Rover/command", msg_type="robot/command")
        assert code == 2
        assert "'/Rover/command' moves a robot; make sure that nobody is in the way, then add" in said
        assert "then add --allow-moving /Rover/command" in said
        describe(b.node("rover"), "Rover", "/orders")
        code, said, _out = bridge("/orders")
        assert code == 2
        assert "'/orders' moves Rover; make sure that nobody is in the way, then add" in said
        assert "then add --allow-moving Rover" in said
        assert bridge("robot_action")[0] == 2
        code, _said, out = bridge("/orders", "--allow-moving", "Rover")
        assert (code, json.loads(out.splitlines()[0])["routes"][0]["problem"]) == (0, "")
