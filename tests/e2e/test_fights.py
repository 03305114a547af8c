"""Test of two scripts that compete for a robot: the warning at the block and its fix from Problems."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import Block, block, number, started, turn, write
from tests.e2e.film import Film
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
BOTH = "both move Pepper at the same time"
REPLACED = "was replaced by"


def script(first: Block, name: str, x: int) -> Block:
    return {**started(first), "id": name, "x": x}


def bubbles(studio: Studio) -> list[str]:
    """Return the texts of the warning bubbles of the blocks."""
    return studio.page("[...document.querySelectorAll('.nepBubble-warning')].map(e => e.textContent)") or []


@pytest.mark.parametrize("theme", ["light"])  # test_tries.py uses the dark theme
def test_conflicting_scripts_are_marked_and_fixed_from_problems(
    start: Callable[..., Studio], tmp_path: Path, theme: str
) -> None:
    walk = block("robot_pepper_do_walk", fields={"ROBOT": "Pepper"}, DISTANCE=number(2))
    path = write(tmp_path / "Fight.nepb", script(turn(300), "one", 56), script(walk, "other", 480))
    studio = start(str(path), "--theme", theme)
    film = Film(studio, f"fight-{theme}", tmp_path)
    studio.use_virtual_pepper("one")
    with film.step("Problems say that two scripts fight"):
        studio.says(BOTH)
    with film.step("The loser says so at its block while the winner goes on"):
        studio.click("Run", kind="RunButton")
        until(lambda: bubbles(studio), "the loser's block says it")
        assert any(words in bubbles(studio)[0] for words in ("“walk” was", "“turn” was"))
        until(lambda: studio.outlined("running"), "the winner glows")
    with film.step("It stays when the program has ended"):
        studio.screen.key("F12")
        studio.says("Pepper stopped (")
        assert bubbles(studio)
    with film.step("Run one after the other: one script, no problem, no warning"):
        studio.click("Run one after the other")
        until(lambda: not studio.look(says=BOTH), "the problem is gone")
        until(lambda: not bubbles(studio), "the blocks have changed: the warning goes")
        inside = "document.querySelector('[data-id=one] [data-id=walk]') !== null"
        until(lambda: studio.page(inside), "the second script hangs below the first")
    studio.click("Undo")
    studio.says(BOTH)
