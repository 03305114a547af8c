"""Test of two Studios on one computer with one master and one virtual robot; the first can quit first."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import nep
from app.core.storage.settings import Settings
from tests.e2e.behaviours import forever, started, turn, write
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(240)


def robots(studio: Studio) -> list[int]:
    return [process.pid for process in studio.children("app.robots.", "--owner-pid")]


@pytest.mark.parametrize("same_home", [True, False])
def test_two_studios_share_a_robot_and_the_second_survives_the_first(
    start: Callable[..., Studio], tmp_path: Path, same_home: bool
) -> None:
    first = start(str(write(tmp_path / "Turning.nepb", started(forever(turn(300))))))
    first.choose("Robots", "Use the virtual Pepper")
    first.says("Pepper ready", 40)
    first.spot("[data-id=turn]")
    first.click("Run", kind="RunButton")
    until(lambda: "turn" in first.outlined("running"), "the block glows")

    environment = {} if same_home else {"NEP_STUDIO_HOME": str(tmp_path / "other")}
    second = start("--new-window", **environment)
    second.says("Pepper ready", 40)
    assert len(second.children("nep", "master")) == 1
    second.choose("Robots", "Use the virtual Pepper")
    second.says("Pepper is connected")  # loading the blocks closes open menus
    second.choose("View", "Developer layout")
    second.find("Topics")
    second.screen.key("F12")
    until(lambda: not first.programs(), "the first Studio's program has ended", 10)
    with nep.node("listener", master=first.master) as node:
        states = node.new_sub("/Pepper/state", "json")
        heard = [states.receive(30.0).payload for _ in range(3)]
    assert not any(state["moving"] for state in heard)
    assert len(robots(first)) == 1  # the second Studio uses the running robot

    second.choose("View", "Appearance")
    second.pick("Dark")
    (firsts,) = robots(first)
    first.process.terminate()
    assert first.process.wait(10) == 0
    until(lambda: firsts not in robots(second), "the first one's robot has ended with it")
    # At once: the second Studio may not have noticed the exit and may still show “Pepper ready”.
    second.choose("Robots", "Use the virtual Pepper")
    until(lambda: robots(second), "another robot comes", 40)
    second.says("Pepper ready", 40)
    with nep.node("listener", master=second.master) as node:
        assert node.new_sub("/Pepper/state", "json").receive(20.0).payload["moving"] is False
    assert len(robots(second)) == 1
    assert len(second.children("nep", "master")) == 1
    second.process.terminate()
    assert second.process.wait(10) == 0
    until(lambda: not second.children("nep", "master"), "the master ends with the last Studio", 20)
    homes = [first.home, second.home if same_home else tmp_path / "other"]
    assert Settings(homes[1]).theme == "dark"
    for home in homes:
        assert isinstance(json.loads((home / "settings.json").read_text()), dict)
        assert not (home / "settings.damaged.json").exists()
