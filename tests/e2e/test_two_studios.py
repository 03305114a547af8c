"""Test of two Studios on one computer with one master and one virtual robot; the first can quit first."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import nep
from app.core.storage.settings import Settings
from tests.e2e.behaviours import forever, started, turn, write
from tests.e2e.studio import END_S, Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def robots(studio: Studio) -> list[int]:
    return [process.pid for process in studio.children("app.robots.", "--owner-pid")]


@pytest.mark.parametrize("same_home", [True, False])
def test_two_studios_share_a_robot_and_the_second_survives_the_first(
    start: Callable[..., Studio], tmp_path: Path, same_home: bool
) -> None:
    first = start(str(write(tmp_path / "Turning.nepb", started(forever(turn(300))))))
    first.use_virtual_pepper("turn")
    first.click("Run", kind="RunButton")
    until(lambda: "turn" in first.outlined("running"), "the block glows")

    environment = {} if same_home else {"NEP_STUDIO_HOME": str(tmp_path / "other")}
    second = start("--new-window", **environment)
    second.says("Pepper ready")
    until(lambda: len(second.children("nep", "master")) == 1, "there is one master")
    second.choose("Robots", "Use the virtual Pepper")
    second.says("Pepper is connected")  # loading the blocks closes open menus
    second.choose("View", "Developer layout")
    second.find("Topics")
    second.screen.key("F12")
    until(lambda: not first.programs(), "the first Studio's program has ended")
    with nep.node("listener", master=first.master) as node:
        states = node.new_sub("/Pepper/state", "json")
        heard = [states.receive(30.0).payload for _ in range(3)]
    assert not any(state["moving"] for state in heard)
    assert len(robots(first)) == 1  # the second Studio uses the running robot

    second.choose("View", "Appearance")
    second.pick("Dark")
    (firsts,) = robots(first)
    first.process.terminate()
    assert first.process.wait(END_S) == 0
    until(lambda: firsts not in robots(second), "the first one's robot has ended with it")
    # At once: the second Studio may not have noticed the exit and may still show “Pepper ready”.
    second.choose("Robots", "Use the virtual Pepper")
    until(lambda: robots(second), "another robot comes")
    second.says("Pepper ready")
    with nep.node("listener", master=second.master) as node:
        assert node.new_sub("/Pepper/state", "json").receive(60.0).payload["moving"] is False
    assert len(robots(second)) == 1
    assert len(second.children("nep", "master")) == 1
    second.process.terminate()
    assert second.process.wait(END_S) == 0
    until(lambda: not second.children("nep", "master"), "the master ends with the last Studio")
    homes = [first.home, second.home if same_home else tmp_path / "other"]
    assert Settings(homes[1]).theme == "dark"
    for home in homes:
        assert isinstance(json.loads((home / "settings.json").read_text()), dict)
        assert not (home / "settings.damaged.json").exists()
