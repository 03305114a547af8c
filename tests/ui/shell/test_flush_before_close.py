"""Tests of flushing the newest edit before the window closes, also with an editor that hangs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject

from app.ui.shell import projects
from app.ui.shell.main_window import MainWindow
from app.ui.shell.projects import FlushBeforeClose

pytest_plugins = ["tests.ui.shell_fixtures"]
BLOCKS = {"blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "a"}]}}


class Late:
    """Fake editor that flushes only when a test calls the stored callback."""

    def __init__(self) -> None:
        self.done: list[Callable[[], None]] = []

    def flush(self, done: Callable[[], None]) -> None:
        self.done.append(done)


def test_window_closes_immediately_without_an_editor(qapp) -> None:
    closed: list[bool] = []
    assert FlushBeforeClose(QObject(), lambda done: done(), lambda: closed.append(True)).can_close()
    assert closed == []


def test_close_waits_for_a_slow_editor_and_flushes_once(qtbot, qapp, monkeypatch) -> None:
    monkeypatch.setattr(projects, "MAX_FLUSH_MS", 600_000)  # so that only the editor can close it
    editor, closed, parent = Late(), [], QObject()
    waits = FlushBeforeClose(parent, editor.flush, lambda: closed.append(waits.can_close()))
    assert not waits.can_close()
    assert not waits.can_close()
    assert len(editor.done) == 1
    editor.done[0]()
    qtbot.waitUntil(lambda: closed == [True])
    waits._on_flushed()  # the timeout follows and closes nothing twice
    qtbot.wait(1)
    assert closed == [True]


def test_hanging_editor_does_not_block_closing(qtbot, qapp) -> None:
    editor, closed, parent = Late(), [], QObject()
    waits = FlushBeforeClose(parent, editor.flush, lambda: closed.append(True))
    assert not waits.can_close()
    qtbot.waitUntil(lambda: closed == [True], timeout=60_000)
    assert waits.can_close()


def test_window_closes_after_the_editor_has_flushed_the_latest_edit(
    qtbot, window: MainWindow, commands, monkeypatch
) -> None:
    bench = window.show_layout("behaviour")
    editor, shut = Late(), []
    monkeypatch.setattr(bench.docks["behaviour"].panel, "flush", editor.flush)
    window.on_closed = lambda: shut.append(window.session.document.dirty)
    window.show()
    assert not window.close()
    assert (shut, window.isVisible()) == ([], True)
    window.session.document.apply_edit(BLOCKS)
    editor.done[0]()
    qtbot.waitUntil(lambda: shut == [True])
    assert not window.isVisible()


def test_work_that_cannot_be_saved_is_reported_before_closing(
    qtbot, window: MainWindow, commands, home: Path
) -> None:
    """The journal folder is a file, so saving fails as on a full disk."""
    (home / "journal").parent.mkdir(parents=True, exist_ok=True)
    (home / "journal").write_text("no folder")
    shut: list[bool] = []
    window.on_closed = lambda: shut.append(True)
    window.show()
    session = window.session
    session.document.apply_edit(BLOCKS)
    assert not window.close()
    window.tick()
    assert (shut, window.isVisible(), window.current_layout) == ([], True, "behaviour")
    assert "Studio stays open" in window.banner.banner.accessibleName()
    assert window.toast.isVisible()
    (home / "journal").unlink()
    session._next_check_s = 0.0
    window.tick()
    assert not session.alerts.has("leaving"), "there is room again"
    assert window.close()
    assert shut == [True]
    (left,) = left_behind_of(home)
    assert left["workspace"] == BLOCKS


def test_window_closes_at_the_second_attempt_if_work_cannot_be_saved(
    window: MainWindow, commands, home: Path
) -> None:
    (home / "journal").parent.mkdir(parents=True, exist_ok=True)
    (home / "journal").write_text("no folder")
    window.show()
    window.session.document.apply_edit(BLOCKS)
    assert not window.close()
    assert window.close()
    assert not window.isVisible()


def left_behind_of(home: Path) -> list[dict[str, object]]:
    return [json.loads(file.read_bytes()) for file in (home / "journal").glob("*.json")]
