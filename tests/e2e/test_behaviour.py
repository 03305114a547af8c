"""Tests of behaviours by mouse: pause, step, errors at a block, Python code, examples, lost robots."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

import nep
from tests.e2e.behaviours import block, forever, number, say, started, turn, write
from tests.e2e.shared_studio import SharedStudio
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


@pytest.fixture
def with_robot(shared: SharedStudio, tmp_path: Path) -> Callable[[dict], Studio]:
    """Function that opens a script in Studio with the virtual robot."""
    return lambda script: shared.open(write(tmp_path / "Mine.nepb", script))


def test_runtime_error_is_shown_as_a_sentence_on_its_block(with_robot: Callable[[dict], Studio]) -> None:
    walk = block("robot_pepper_do_walk", fields={"ROBOT": "Pepper"}, DISTANCE=number(2))
    studio = with_robot(started(walk))
    studio.click("Run", kind="RunButton")
    until(lambda: studio.outlined("error") == ["walk"], "the block has its error")
    words = "something is in the way"
    until(lambda: words in str(studio.page("document.body.textContent")), "it says why")
    studio.says("because of an error")


def test_behaviour_can_be_paused_stepped_and_resumed(with_robot: Callable[[dict], Studio]) -> None:
    studio = with_robot(started(forever(say("One", say("Two")))))
    studio.click("Run", kind="RunButton")
    studio.says("Pepper says “")
    studio.click("Pause")
    studio.says("Paused at “")
    (first,) = until(lambda: studio.outlined("stopped"), "the next block is outlined")
    studio.click("Step")
    until(lambda: studio.outlined("stopped") not in ([], [first]), "another block is next")
    studio.click("Resume")
    until(lambda: studio.outlined("running"), "it runs")
    studio.screen.key("F12")
    studio.says("Pepper stopped (")


def test_generated_python_can_be_viewed_and_copied(with_robot: Callable[[dict], Studio]) -> None:
    studio = with_robot(started(say("Good morning")))
    studio.click("Python")
    studio.says("Good morning")
    compile(studio.find(kind="ProgramView")["text"], "program", "exec")
    studio.click("Copy")
    studio.says("Copied the program")
    studio.click("Blocks")
    studio.spot("[data-id=started]")


def test_example_from_the_start_page_runs_to_completion(shared: SharedStudio) -> None:
    studio = shared.studio
    studio.choose("File", "Start page")
    card = studio.find(kind="ExampleCard")
    studio.screen.click(card["rect"][0] + 60, card["rect"][1] + 60)
    studio.says("Greeting")
    until(studio.blocks, "its blocks are there")
    studio.click("Run", kind="RunButton")
    studio.says("Finished after", 60)
    studio.says("Pepper stopped (")


def test_crashed_robot_is_reported_and_runs_its_blocks_again_after_a_restart(
    with_robot: Callable[[dict], Studio],
) -> None:
    studio = with_robot(started(forever(turn(30))))
    (robot,) = studio.children("app.robots.simulated")
    robot.kill()
    studio.says("The virtual robot Pepper stopped unexpectedly.")
    until(lambda: "not connected" in str(studio.page("document.body.textContent")), "the toolbox says so")
    studio.says("Pepper isn't connected, so ")
    studio.click("Start a virtual Pepper")
    studio.says("Pepper ready")
    studio.open_category("Movement")
    studio.screen.key("Escape")
    studio.click("Run", kind="RunButton")
    until(lambda: "turn" in studio.outlined("running"), "its blocks run again")
    with nep.node("listener", master=studio.master) as node:
        states = node.new_sub("/Pepper/state", "json")
        until(lambda: states.receive(30.0).payload["moving"], "it moves")
    studio.screen.key("F12")
    studio.says("Pepper stopped (")


def test_killed_editor_page_is_restored_with_its_blocks(with_robot: Callable[[dict], Studio]) -> None:
    studio = with_robot(started(say("Good morning")))
    before = set(studio.blocks())
    page = studio.find(kind="QWebEngineView")["pid"]
    psutil.Process(page).kill()
    until(lambda: studio.find(kind="QWebEngineView")["pid"] not in (0, page), "there is another page")
    until(lambda: set(studio.blocks()) == before, "every block is back")
