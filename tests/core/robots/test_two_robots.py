"""Tests of two robots in one behaviour and of the permission before a real robot moves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

import nep
from app.core.robots.motion.permission import MayNotMoveError
from app.core.session import Session
from app.robots import simulated, turtle
from app.robots.driver.driver import Driver
from nep.masters.master import Master
from tests.blocks.samples import block, number, say, started, text, workspace, write
from tests.core.waiting import tick_until

FOUND_S = 60.0


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("robots", master=master.address) as made:
        yield made


def there(session: Session, *names: str) -> None:
    def all_of_them() -> bool:
        links = [session.fleet.link(name) for name in names]
        ready = all(
            link is not None
            and link.is_connected
            and link.publisher is not None
            and link.publisher.subscribers
            for link in links
        )
        return bool(ready and session.stopper is not None and set(names) <= set(session.stopper.robots))

    tick_until(session, all_of_them, FOUND_S)


def turn(angle: float, id: str | None = None) -> dict[str, object]:
    return block("robot_diffdrive_do_turn", id, ROBOT="Turtle", ANGLE=number(angle))


def printed(session: Session) -> list[str]:
    return [record.text for record in session.console.records]


def test_pepper_and_turtle_work_in_one_behaviour(session: Session, node: nep.Node) -> None:
    with Driver(simulated.ROBOT, "Pepper", node), Driver(turtle.ROBOT, "Turtle", node):
        there(session, "Pepper", "Turtle")
        light = block("robot_diffdrive_do_light", ROBOT="Turtle", COLOUR="#ff0000")
        session.document.apply_edit(workspace(started(say("Go"), turn(20), light, write(text("both")))))
        assert not [p for p in session.document.problems() if p.severity == "error"]
        session.runs.run()
        tick_until(session, lambda: "both" in printed(session), FOUND_S)
        assert {"Pepper says “Go”", "Turtle turns 20°"} <= set(printed(session))
        tick_until(session, lambda: session.runs.view().state == "proven")
        assert session.runs.view().result_status == "ok"
        with session.fleet.watch_sensors("Turtle"):
            link = session.fleet.link("Turtle")
            assert link is not None
            tick_until(session, lambda: link.drawing is not None)
            assert link.drawing is not None
            assert (link.drawing["figure"], link.drawing["eyes"]) == ("turtle", "#ff0000")


def test_current_robot_is_the_selected_or_the_first_connected_one(session: Session, node: nep.Node) -> None:
    with Driver(simulated.ROBOT, "Pepper", node):
        there(session, "Pepper")
        with Driver(turtle.ROBOT, "Turtle", node):
            there(session, "Turtle")
            shown = session.fleet.current
            assert shown is not None
            assert shown.name == "Pepper"
            session.fleet.select("Turtle")
            assert session.fleet.current is session.fleet.link("Turtle")
        tick_until(session, lambda: len(session.fleet.connected) == 1, FOUND_S)
        assert session.fleet.current is session.fleet.link("Pepper")  # fallback after a disconnect


REAL = replace(turtle.ROBOT, virtual=False)


def test_real_robot_does_not_move_before_permission(session: Session, node: nep.Node) -> None:
    with Driver(REAL, "Turtle", node) as driver:
        there(session, "Turtle")
        wheels = driver.body.wheels  # type: ignore[attr-defined]
        session.document.apply_edit(workspace(started(turn(180, "x"))))
        moving = session.fleet.permission
        with pytest.raises(MayNotMoveError):
            session.fleet.invoke("Turtle", "move", {"distance": 0.5})
        assert moving.question is not None
        for press in (session.runs.run, session.runs.step, session.runs.run):  # F5, F10, the palette
            press()
            assert session.runs.view().state == "ready"
            assert moving.question.title == "Allow Turtle to move?"
        lit = session.fleet.invoke("Turtle", "light", {})  # an action without motion
        tick_until(session, lambda: lit.state == "succeeded")
        assert wheels.is_still()
        session.runs.stop()  # Stop needs no permission and closes the question
        assert moving.question is None
        tick_until(session, lambda: session.runs.view().state == "proven")
        assert session.runs.view().result_status == "ok"


@pytest.mark.parametrize("topic", ["/Turtle/command", "robot_action"])
def test_behaviour_that_publishes_on_a_robot_topic_needs_permission_and_is_stopped(
    session: Session, node: nep.Node, topic: str
) -> None:
    """The publish block belongs to no robot, but its message can move one."""
    with Driver(REAL, "Turtle", node):
        there(session, "Turtle")
        heard: list[object] = []
        node.new_sub("/Turtle/command", sink=lambda messages: heard.extend(m.payload for m in messages))
        publish = block("messages_publish", "p", TOPIC=topic, VALUE=text("drive"))
        session.document.apply_edit(workspace(started(publish, wait(600))))
        session.runs.run()
        moving = session.fleet.permission
        assert not session.runs.active
        assert moving.question is not None
        assert moving.question.title == "Allow Turtle to move?"
        assert "“move”" in moving.question.message
        session.tick()
        assert "drive" not in heard
        moving.answer(is_allowed=True)
        tick_until(session, lambda: session.runs.running_blocks == ("w",), FOUND_S)
        assert "Turtle" in session.fleet.moved
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "proven")
        assert str(session.runs.view().result).startswith("Turtle stopped (")


def test_robot_that_connects_during_a_run_is_not_moved_by_published_messages(
    session: Session, node: nep.Node
) -> None:
    publish = block("messages_publish", "p", TOPIC="/Turtle/command", VALUE=text("drive"))
    again = block(
        "control_repeat", TIMES=number(10_000), BODY=[publish, block("control_wait", SECONDS=number(0.05))]
    )
    session.document.apply_edit(workspace(started(again)))
    session.runs.run()  # no robot is connected, so no permission is needed
    tick_until(session, lambda: session.runs.running_blocks, FOUND_S)
    with Driver(REAL, "Turtle", node):
        tick_until(session, lambda: session.runs.block_errors, FOUND_S)
        said = session.runs.block_errors["p"]
        assert said.startswith("Can't publish on /Turtle/command: this would move Turtle without permission")
        tick_until(session, lambda: session.runs.view().state != "stopping")


def test_permission_continues_the_requested_run_without_asking_again(
    session: Session, node: nep.Node
) -> None:
    with Driver(REAL, "Turtle", node) as driver:
        there(session, "Turtle")
        wheels = driver.body.wheels  # type: ignore[attr-defined]
        session.document.apply_edit(workspace(started(turn(180, "x"))))
        session.runs.run()
        session.fleet.permission.answer(is_allowed=True)
        tick_until(session, lambda: session.runs.running_blocks == ("x",), FOUND_S)
        tick_until(session, lambda: not wheels.is_still())
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "proven")
        assert wheels.is_still()
        tried = session.fleet.invoke("Turtle", "move", {"distance": -0.1})
        tick_until(session, lambda: tried.state == "succeeded", FOUND_S)


def test_invocation_continues_after_permission(session: Session, node: nep.Node) -> None:
    with Driver(REAL, "Turtle", node):
        there(session, "Turtle")
        with pytest.raises(MayNotMoveError, match="Turtle can't move yet"):
            session.fleet.invoke("Turtle", "move", {"distance": -0.1})
        session.fleet.permission.answer(is_allowed=False)
        link = session.fleet.link("Turtle")
        assert link is not None
        assert not link.invocations
        with pytest.raises(MayNotMoveError):
            session.fleet.invoke("Turtle", "move", {"distance": -0.1})
        session.fleet.permission.answer(is_allowed=True)
        tick_until(session, lambda: link.invocations["move"].state == "succeeded", FOUND_S)


def drive(id: str, *, speed: float = 0, turn: float = 0) -> dict[str, object]:
    return block("robot_diffdrive_do_drive", id, ROBOT="Turtle", SPEED=number(speed), TURN=number(turn))


def wait(seconds: float) -> dict[str, object]:
    return block("control_wait", "w", SECONDS=number(seconds))


def test_pause_halts_a_driving_robot_and_resume_continues_the_drive(session: Session, node: nep.Node) -> None:
    with Driver(turtle.ROBOT, "Turtle", node) as driver:
        there(session, "Turtle")
        wheels = driver.body.wheels  # type: ignore[attr-defined]
        session.document.apply_edit(workspace(started(drive("d", turn=60), wait(30))))
        assert not [p for p in session.document.problems() if p.severity == "error"]
        session.runs.run()
        tick_until(session, lambda: session.runs.running_blocks == ("w",), FOUND_S)
        tick_until(session, lambda: not wheels.is_still())
        session.runs.pause()
        tick_until(session, lambda: session.runs.view().state == "paused" and wheels.is_still())
        session.runs.resume()
        tick_until(session, lambda: not wheels.is_still())
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "proven")
        assert wheels.is_still()


def test_robot_stands_still_after_a_single_step(session: Session, node: nep.Node) -> None:
    with Driver(turtle.ROBOT, "Turtle", node) as driver:
        there(session, "Turtle")
        wheels = driver.body.wheels  # type: ignore[attr-defined]
        session.document.apply_edit(workspace(started(drive("d", turn=60), wait(30))))
        session.runs.step()
        tick_until(session, lambda: session.runs.stopped_blocks == ("d",), FOUND_S)
        session.runs.step()
        tick_until(session, lambda: session.runs.stopped_blocks == ("w",), FOUND_S)
        tick_until(session, wheels.is_still)
        session.runs.resume()
        tick_until(session, lambda: not wheels.is_still())
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "proven")


def test_slow_motion_does_not_lengthen_a_drive(session: Session, node: nep.Node) -> None:
    """The pause before the next block must not extend the drive of half a second."""
    with Driver(turtle.ROBOT, "Turtle", node) as driver:
        there(session, "Turtle")
        wheels = driver.body.wheels  # type: ignore[attr-defined]
        first = wheels.pose()[:2]
        session.document.apply_edit(workspace(started(drive("d", speed=-0.2), wait(0.5), drive("h"))))
        session.runs.set_pace(1.5)
        session.runs.run()
        tick_until(session, lambda: session.runs.running_blocks == ("h",), FOUND_S)
        tick_until(session, wheels.is_still)
        tick_until(session, lambda: not session.runs.active, FOUND_S)
        way = math.dist(first, wheels.pose()[:2])
        # 0.1 m, or more if the computer was busy; driving on during the pauses would give at least 0.4 m
        assert 0.05 < way < 0.35
