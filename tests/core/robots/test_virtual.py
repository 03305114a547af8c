"""Tests of which robots count as virtual: those started by this Studio or by this user on this computer."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import psutil
import pytest

from app.core.network.watches import Watches
from app.core.robots import launcher
from app.core.robots.fleet import Fleet
from app.core.robots.launcher import VirtualProcesses
from app.core.robots.motion.permission import MayNotMoveError, MotionPermission
from app.core.session import Session
from app.core.storage.settings import Settings
from app.robots.description.description import Robot, parse, thing_description
from app.robots.identity import Identity
from app.robots.turtle import ROBOT
from nep.masters.master import Master
from nep.nodes.publisher import Publisher
from tests.blocks.fakes import until
from tests.core.waiting import tick_until

HERE = platform.node()
MODULE = "app.robots.turtle"
STRANGER = """
import json, sys
import nep
from app.robots.description.description import thing_description
from app.robots.turtle import ROBOT
with nep.node("stranger") as node:
    publisher = node.new_pub("/Turtle/description", "robot/description", latched=True)
    publisher.publish(thing_description(ROBOT.thing_model, "Turtle"))
    sys.stdin.read()
"""


def waits(*more: str) -> subprocess.Popen[bytes]:
    """Start a process that does nothing until its standard input is closed."""
    command = [sys.executable, "-c", "import sys; sys.stdin.read()", *more]
    return subprocess.Popen(command, stdin=subprocess.PIPE)


@pytest.fixture
def process() -> Iterator[subprocess.Popen[bytes]]:
    made = waits("-m", MODULE)
    yield made
    made.kill()
    made.communicate()


def test_process_started_by_this_studio_is_recognized(process: subprocess.Popen[bytes]) -> None:
    known = VirtualProcesses(lambda: [process.pid])
    assert known.is_started_by_studio(Identity("n", "Turtle", HERE, process.pid))
    assert known.is_started_by_studio(Identity("n", "Turtle", HERE, os.getpid()))


def test_process_that_only_mentions_the_module_is_not_recognized(process: subprocess.Popen[bytes]) -> None:
    assert not VirtualProcesses().is_started_by_studio(Identity("n", "Turtle", HERE, process.pid))


def test_process_on_another_computer_or_unknown_process_is_not_recognized(
    process: subprocess.Popen[bytes],
) -> None:
    known = VirtualProcesses(lambda: [process.pid])
    assert not known.is_started_by_studio(Identity("n", "Turtle", "another-computer", process.pid))
    assert not known.is_started_by_studio(Identity("n", "Turtle", HERE, None))
    assert not known.is_started_by_studio(Identity("n", "Turtle", HERE, 2**31 - 1))
    assert not known.is_started_by_studio(Identity("n", "Turtle", HERE, 1))


def test_virtual_robot_started_by_another_studio_of_this_user_is_recognized(
    master: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = [sys.executable, "-m", "app.robots.turtle", "--name", "Turtle", "--owner-pid", str(os.getpid())]
    made = subprocess.Popen(command, env={**os.environ, "NEP_MASTER": master.address})
    try:
        until(lambda: bool(psutil.Process(made.pid).cmdline()))  # empty until the process has called exec
        assert VirtualProcesses().is_started_by_studio(Identity("n", "Turtle", HERE, made.pid))
        monkeypatch.setattr(launcher, "virtual_models", dict)
        assert not VirtualProcesses().is_started_by_studio(Identity("n", "Turtle", HERE, made.pid))
    finally:
        made.terminate()
        made.wait(60)


def test_process_end_is_detected_only_on_this_computer(
    process: subprocess.Popen[bytes],
) -> None:
    known = VirtualProcesses()
    identity = Identity("n", "Turtle", HERE, process.pid)
    assert not known.has_ended(identity)
    process.kill()
    process.wait(60)
    assert known.has_ended(identity)
    assert not known.has_ended(replace(identity, host="another-computer"))
    assert not known.has_ended(replace(identity, pid=None))


# ---- permission question -------------------------------------------------------------------------------

STRANGE = Identity("1", "rover driver", "lab-2", 7)


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    watches = Watches(lambda _topic: None, lambda _topic: None)
    return Fleet(watches, lambda _what, _job: None, settings=Settings(tmp_path), processes=VirtualProcesses())


def turtle(*, virtual: bool = True) -> Robot:
    return replace(parse(thing_description(ROBOT.thing_model, "Turtle")), virtual=virtual)


def asks(fleet: Fleet) -> bool:
    """Return whether a move needs permission first."""
    try:
        fleet.invoke("Turtle", "move", {"distance": 0.1})
    except MayNotMoveError:
        return True
    return False


def test_foreign_robot_that_claims_to_be_virtual_needs_permission(fleet: Fleet) -> None:
    fleet.connect(turtle(), "/Turtle/description", STRANGE)
    link = fleet.link("Turtle")
    assert link is not None
    assert (link.is_virtual, link.robot.virtual, link.chip_text) == (False, False, "ready")
    assert asks(fleet)


def test_real_robot_that_now_claims_to_be_virtual_needs_permission(fleet: Fleet) -> None:
    mine = Identity("1", "Turtle", HERE, os.getpid())
    fleet.connect(turtle(), "/Turtle/description", mine)
    assert not asks(fleet)
    fleet.connect(turtle(virtual=False), "/Turtle/description", mine)
    assert asks(fleet)
    fleet.connect(turtle(virtual=True), "/Turtle/description", mine)
    assert asks(fleet)


class World:
    """Fake publisher of a robot's world."""

    def __init__(self) -> None:
        self.changes: list[object] = []

    def publish(self, change: object) -> None:
        self.changes.append(change)


def test_world_of_a_foreign_robot_is_not_changed_before_permission(fleet: Fleet) -> None:
    """The topic that a foreign robot names as its world may move something real."""
    fleet.connect(turtle(), "/Turtle/description", STRANGE)
    link, world = fleet.link("Turtle"), World()
    assert link is not None
    link.world_publisher = cast("Publisher", world)
    fleet.change_world("Turtle", {"touch": "head"})
    assert fleet.permission.question is not None
    assert world.changes == []
    fleet.permission.answer(is_allowed=True)
    assert world.changes == [{"touch": "head"}]
    fleet.connect(turtle(), "/Turtle/description", Identity("1", "Turtle", HERE, os.getpid()))
    fleet.change_world("Turtle", {"reset": True})
    assert len(world.changes) == 2


def test_permission_ends_with_the_program_and_permanent_permission_covers_its_restarts(
    fleet: Fleet, tmp_path: Path
) -> None:
    fleet.connect(turtle(virtual=False), "/Turtle/description", STRANGE)
    assert asks(fleet)
    fleet.permission.answer(is_allowed=True)
    assert not asks(fleet)
    fleet.connect(turtle(virtual=False), "/Turtle/description", replace(STRANGE, node_id="2"))  # restarted
    assert asks(fleet)
    fleet.permission.answer(is_allowed=True, is_permanent=True)
    fleet.connect(turtle(virtual=False), "/Turtle/description", replace(STRANGE, node_id="3"))
    assert not asks(fleet)
    for other in (replace(STRANGE, host="evil"), replace(STRANGE, node="evil")):
        fleet.connect(turtle(virtual=False), "/Turtle/description", other)
        assert asks(fleet)
    kept = MotionPermission(Settings(tmp_path), lambda _name: STRANGE)
    assert kept.is_allowed(turtle(virtual=False))
    assert not MotionPermission(Settings(tmp_path)).is_allowed(turtle(virtual=False))


def test_foreign_virtual_robot_on_the_network_needs_permission(session: Session, master: Master) -> None:
    environment = {**os.environ, "NEP_MASTER": master.address}
    made = subprocess.Popen([sys.executable, "-c", STRANGER], stdin=subprocess.PIPE, env=environment)
    try:
        tick_until(session, lambda: session.fleet.link("Turtle"))
        link = session.fleet.link("Turtle")
        assert link is not None
        assert not link.is_virtual
        assert asks(session.fleet)
        assert session.fleet.permission.question is not None
    finally:
        made.communicate()


def test_only_virtual_robots_return_to_start_position_and_only_on_request(fleet: Fleet) -> None:
    fleet.connect(turtle(), "/Turtle/description", Identity("1", "Turtle", HERE, os.getpid()))
    stranger = parse(thing_description(ROBOT.thing_model, "Other"))
    fleet.connect(stranger, "/Other/description", replace(STRANGE, node_id="3"))
    worlds = {"Turtle": World(), "Other": World()}
    for name, world in worlds.items():
        link = fleet.link(name)
        assert link is not None
        link.world_publisher = cast("Publisher", world)
    fleet.return_to_start(["Turtle", "Other", "Nobody"])
    assert worlds["Turtle"].changes == [{"start": ["Turtle"]}]
    assert worlds["Other"].changes == []
    assert fleet.permission.question is None
    fleet.set_resets_at_start(is_enabled=False)
    fleet.return_to_start(["Turtle"])
    assert len(worlds["Turtle"].changes) == 1
    fleet.set_resets_at_start(is_enabled=True)
    fleet.return_to_start(["Turtle"])
    assert len(worlds["Turtle"].changes) == 2
