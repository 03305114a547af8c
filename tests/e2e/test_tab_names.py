"""Test of renaming a tab in place: its file and the window title follow."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, write
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.test_tabs import shown, tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def test_renaming_a_tab_renames_its_file_rejects_an_existing_name_and_can_be_undone(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    old = write(tmp_path / "Greeting.nepb", started(say("One")))
    taken = write(tmp_path / "Quiz.nepb", started(say("Two")))
    content = taken.read_bytes()
    studio = start(str(old))
    until(lambda: tabs(studio) == ["Greeting"], "the file is open")
    until(lambda: "say One" in shown(studio), "its blocks show: the page takes the keyboard when it loads")
    studio.screen.double_click(*middle(studio.still(kind="BehaviourTab")["rect"]))
    field = studio.find(kind="NameField", focus=True)
    assert field["text"] == "Greeting"
    studio.screen.type("Quiz")
    studio.screen.key("Return")
    studio.says("A file named “Quiz” already exists in ")
    assert taken.read_bytes() == content
    studio.screen.key("End")
    studio.screen.type(" for class")
    studio.screen.key("Return")
    studio.says("Renamed Greeting to Quiz for class")
    studio.screen.move(*middle(studio.find("Undo", kind="Button")["rect"]))  # the toast stays while hovered
    until(lambda: tabs(studio) == ["Quiz for class"], "its tab says so")
    assert not old.exists()
    assert (tmp_path / "Quiz for class.nepb").exists()
    studio.click("Undo", kind="Button")
    until(lambda: tabs(studio) == ["Greeting"], "it has its name again")
    until(old.exists, "its file, too")
    assert studio.quit() == 0
