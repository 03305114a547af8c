"""Tests of behaviours in tabs: restored tabs, earlier versions and files opened while Studio runs."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, write
from tests.e2e.studio import ROOT, Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
SHOWN = "document.querySelector('.nepTab:not([hidden])')"


def shown(studio: Studio) -> set[str]:
    """Return the ids of the blocks in the visible tab."""
    ids = f"[...{SHOWN}.querySelectorAll('.blocklyBlockCanvas .blocklyDraggable')].map(e => e.dataset.id)"
    return set(studio.page(ids) or [])


def tabs(studio: Studio) -> list[str]:
    found = sorted(studio.all(kind="BehaviourTab"), key=lambda each: each["rect"][0])
    return [str(each["name"]) for each in found]


def start_once_more(studio: Studio, path: Path) -> int:
    """Open a file while Studio runs, as a double click on it does; return the exit code."""
    environ = {
        **os.environ, "NEP_STUDIO_HOME": str(studio.home), "NEP_MASTER": studio.master,
        "QT_QPA_PLATFORM": "offscreen", "NEP_GATEWAY": "0",
    }  # fmt: skip
    command = [sys.executable, "-m", "app", path]
    done = subprocess.run(command, cwd=ROOT, env=environ, timeout=150, check=False)
    return done.returncode


def test_tabs_are_restored_at_the_next_start(start: Callable[..., Studio], tmp_path: Path) -> None:
    files = [write(tmp_path / f"{name}.nepb", started(say(name))) for name in ("One", "Two", "Three")]
    studio = start(str(files[0]), str(files[1]))
    until(lambda: tabs(studio) == ["One", "Two"], "both files are open")
    until(lambda: "say Two" in shown(studio), "the second shows")
    studio.point(".nepTab:not([hidden]) [data-id=started] > .blocklyPath", dy=30)
    studio.screen.key("Delete")
    until(lambda: tabs(studio) == ["One", "Two, not saved"], "its dot says so")
    assert shown(studio) == set()

    studio.screen.key("Tab", ["Ctrl"])
    until(lambda: "say One" in shown(studio), "the next tab shows")
    studio.screen.key("Tab", ["Ctrl", "Shift"])
    until(lambda: shown(studio) == set(), "the tab before shows as it was left")
    studio.screen.key("z", ["Ctrl"])
    until(lambda: "say Two" in shown(studio), "its undo is still there")

    assert start_once_more(studio, files[2]) == 0
    until(lambda: tabs(studio) == ["One", "Two, not saved", "Three"], "a second start opens it here")
    until(lambda: "say Three" in shown(studio), "and shows it")
    studio.screen.key("w", ["Ctrl"])
    until(lambda: tabs(studio) == ["One", "Two, not saved"], "it is closed")
    studio.screen.key("t", ["Ctrl", "Shift"])
    until(lambda: tabs(studio) == ["One", "Two, not saved", "Three"], "it is open again")
    assert studio.quit() == 0

    again = start()  # shows the last behaviours, not the start page
    until(lambda: tabs(again) == ["One", "Two, not saved", "Three"], "the tabs are there again")
    assert not again.all("Restore"), "nothing is asked after an end in order"
    until(lambda: "say Three" in shown(again), "the one that showed")


def test_earlier_version_opens_in_its_own_tab(start: Callable[..., Studio], tmp_path: Path) -> None:
    path = write(tmp_path / "Mine.nepb", started(say("Before")))
    studio = start(str(path))
    until(lambda: "say Before" in shown(studio), "the file is open")
    studio.point(".nepTab:not([hidden]) [data-id=started] > .blocklyPath", dy=30)
    studio.screen.key("Delete")
    until(lambda: tabs(studio) == ["Mine, not saved"], "it is edited")
    studio.screen.key("s", ["Ctrl"])
    studio.says("Saved Mine")
    saved = path.read_bytes()
    studio.choose("File", "Earlier versions")
    studio.says("Earlier versions of Mine")
    studio.screen.key("Return")
    until(lambda: len(tabs(studio)) == 2, "a copy is open in a tab of its own")
    until(lambda: "say Before" in shown(studio), "as it was")
    assert path.read_bytes() == saved
    assert studio.quit() == 0
