"""Test of pasting copied blocks in another tab, whichever widget has the focus after a click."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, write
from tests.e2e.studio import Studio
from tests.e2e.test_tabs import shown, tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def test_copied_blocks_are_pasted_after_a_click_on_another_tab(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    files = [write(tmp_path / f"{name}.nepb", started(say(name))) for name in ("One", "Two")]
    studio = start(str(files[0]), str(files[1]))
    until(lambda: tabs(studio) == ["One", "Two"], "both files are open")
    until(lambda: "say Two" in shown(studio), "the second shows")
    studio.point('.nepTab:not([hidden]) [data-id="say Two"] > .blocklyPath', dx=8, dy=20)
    until(
        lambda: studio.page("document.querySelector('.nepTab:not([hidden]) .blocklySelected')?.dataset.id"),
        "it is chosen",
    )
    studio.screen.key("c", ["Ctrl"])

    studio.click("One", kind="BehaviourTab")
    until(lambda: "say One" in shown(studio), "the first shows")
    before = shown(studio)
    studio.screen.key("v", ["Ctrl"])
    until(lambda: len(shown(studio) - before) >= 1, "the copy is there at once")
    until(lambda: tabs(studio)[0] == "One, not saved", "and is an edit of this tab")
    assert tabs(studio)[1] == "Two"

    studio.screen.key("z", ["Ctrl"])
    until(lambda: shown(studio) == before, "one step of undo takes it back")
    assert studio.quit() == 0
