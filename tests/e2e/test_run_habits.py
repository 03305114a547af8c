"""Tests of Run as in Scratch: a second press restarts, and edits during a run show when they apply."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.e2e.behaviours import forever, say, started, turn, write
from tests.e2e.shared_studio import SharedStudio
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
LATER = "Your changes take effect at the next run"


def programs(studio: Studio) -> list[int]:
    """Return the process ids of the running programs."""
    return [each.pid for each in studio.programs()]


def only_another(studio: Studio, *before: int) -> list[int]:
    """Return the process id of the only running program if it is not in ``before``, else an empty list."""
    found = programs(studio)
    return found if len(found) == 1 and found[0] not in before else []


def lasts(studio: Studio) -> None:
    """Wait until a run has lasted a second; an earlier press would count as a double click."""
    seen: list[int] = []

    def grows() -> bool:
        told = re.search(r"Running, (\d+) s", studio.says("Running, "))
        seen.extend([int(told[1])] if told else [])
        return bool(seen) and seen[-1] > min(seen)  # the seconds restart with another run

    until(grows, lambda: f"it lasts: {seen}")


@pytest.fixture
def turning(shared: SharedStudio, tmp_path: Path) -> Studio:
    """Studio that runs a behaviour which turns the virtual robot in an endless loop."""
    speech = {**say("Round and round"), "x": 420, "y": 56}
    path = write(tmp_path / "Turning.nepb", started(forever(turn(300))), speech)
    studio = shared.open(path)
    studio.click("Run", kind="RunButton")
    until(lambda: "turn" in studio.outlined("running"), "the block glows")
    return studio


def test_f5_and_the_run_button_restart_the_program(turning: Studio) -> None:
    (first,) = programs(turning)
    lasts(turning)
    turning.click("Restart", kind="RunButton")
    (second,) = until(lambda: only_another(turning, first), "another program runs")
    until(lambda: "turn" in turning.outlined("running"), "the block glows again")
    lasts(turning)
    turning.screen.key("F5")
    until(lambda: only_another(turning, first, second), "the key restarts, too")
    turning.screen.key("F12")
    until(lambda: not programs(turning), "the program has ended")
    turning.says("Pepper stopped (")


def test_edit_during_a_run_shows_when_it_applies(turning: Studio) -> None:
    (first,) = programs(turning)
    assert not turning.all(kind="RunStateLabel", name=LATER)
    turning.point("[data-id='text Round and round'] .blocklyInputField", dx=10, dy=10)
    typing = "!!document.activeElement?.classList.contains('blocklyHtmlInput')"
    until(lambda: turning.page(typing), "the text is edited")
    turning.screen.type("Hello")
    turning.screen.key("Return")
    turning.point("[data-id=turn] > .blocklyPath", dx=14, dy=14)
    turning.screen.key("Delete")
    turning.says(LATER)
    turning.click("Undo")
    until(lambda: not turning.look(says=LATER), "undone: nothing to say")
    turning.click("Redo")
    turning.says(LATER)
    turning.click("Restart", kind="RunButton")
    until(lambda: programs(turning) not in ([first], []), "the new program runs")
    until(lambda: not turning.look(says=LATER), "it runs what is seen")
