"""Tests of the first steps for beginners with the mouse: the card checks each step and shows the result."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
CANVAS = ".blocklySvg > .blocklyWorkspace > .blocklyBlockCanvas"


def take(studio: Studio, category: str, kind: str, x: float, y: float) -> None:
    """Drag the first block of this type out of its category by its left edge to (x, y)."""
    studio.open_category(category)
    studio.drag(f".blocklyFlyout .blocklyDraggable.{kind}", x, y)


def hang_below(studio: Studio, category: str, kind: str, above: str) -> None:
    left, top, _, high = studio.spot(f"{CANVAS} .{above} > .blocklyPath")
    take(studio, category, kind, left + 14, top + high + 20)


def step(studio: Studio, words: str) -> None:
    studio.find(f"{words}: the next step")


def test_first_steps_lead_to_a_robot_that_speaks_turns_and_stops(studio: Studio) -> None:
    studio.says("First steps (five minutes)")  # offered at the very first start
    studio.click("First steps")
    step(studio, "Use the virtual robot")
    studio.click("Use the virtual robot", kind="Button")
    step(studio, "Drag “when started” onto the page")
    studio.click("Show me")
    until(lambda: studio.page("document.querySelector('.nepRing:not([hidden])') !== null"), "the ring")
    view = studio.find(kind="QWebEngineView")["rect"]
    take(studio, "Events", "events_started", view[0] + 480, view[1] + 120)
    step(studio, "Place “say” below it")
    hang_below(studio, "Speech", "robot_pepper_do_say", "events_started")
    step(studio, "Press Run and listen")
    studio.click("Show me")

    def is_around_run() -> bool:
        ring = studio.find(kind="HintRing")["rect"]
        run = studio.find("Run", kind="RunButton")["rect"]
        return ring[0] <= run[0] and ring[0] + ring[2] >= run[0] + run[2]

    until(is_around_run, "the ring is round Run")
    studio.click("Run", kind="RunButton")
    until(lambda: not studio.all(kind="HintRing"), "the ring goes with the press")
    step(studio, "Place “turn” below “say”")
    hang_below(studio, "Movement", "robot_pepper_do_turn", "robot_pepper_do_say")
    step(studio, "Press Run, then Stop while the robot turns")
    studio.says("Finished")

    def is_stopped_in_time() -> bool:
        """Run, and press Stop; on a busy computer the robot may have come to its end before."""
        studio.click("Run", kind="RunButton")
        until(lambda: studio.outlined("running"), "a block runs")
        studio.screen.key("F12")
        studio.says("Pepper stopped (")
        studio.find("Run", kind="RunButton", enabled=True)
        return bool(studio.all("First steps done"))

    until(is_stopped_in_time, "the first steps are done")
    studio.says("6 of 6")


def test_first_steps_are_not_offered_again_after_kill_9(start: Callable[..., Studio]) -> None:
    first = start()
    first.says("First steps (five minutes)")
    first.kill()
    second = start()
    second.says("Learn in five minutes")
    assert not second.all("Cancel", kind="Button")
