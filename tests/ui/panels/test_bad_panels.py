"""Tests of panels that raise exceptions: the window and other panels keep working, and the panel recovers."""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import pytest
from PySide6.QtCore import QSize
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QApplication, QWidget

from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.panels.base import Panel, PanelContext
from app.ui.shell.docking.dock import Dock
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from tests.ui.shell_parts import PANELS, PlainPanel, free_address

pytest_plugins = ["tests.ui.shell_fixtures"]


def explode() -> dict[str, object]:
    raise RuntimeError("no such luck")


@pytest.fixture
def topics(qtbot, window: MainWindow, commands: object) -> Dock:
    """Dock of the Topics panel in an open window."""
    window.show()
    dock = window.show_layout("developer").docks["topics"]
    qtbot.waitUntil(dock.is_displayed)
    return dock


def test_failed_panel_does_not_affect_other_panels_and_works_again_when_reopened(
    window: MainWindow, topics: Dock
) -> None:
    bench = window.bench
    assert bench is not None
    topics.panel.explode = True
    other = bench.docks["console"].panel
    before = other.refreshed
    for _ in range(5):
        window.tick()
    assert topics.has_failed
    assert other.refreshed == before + 5
    assert [r.text for r in window.session.console.records].count("RuntimeError: no such luck") == 0
    assert [r.text for r in window.session.console.records].count("ValueError: no such luck") == 1
    assert QApplication.activeModalWidget() is None
    topics.panel.explode = False
    topics.close()
    bench.open("topics")
    assert not topics.has_failed
    assert topics.panel.isVisible()
    before = topics.panel.refreshed
    window.tick()
    assert topics.panel.refreshed == before + 1


def test_repeated_panel_failure_is_logged_each_time(window: MainWindow, topics: Dock) -> None:
    topics.panel.explode = True
    for _ in range(3):
        window.tick()
        topics.retry()
    texts = [record.text for record in window.session.console.records]
    assert texts.count("ValueError: no such luck") == 3


def test_panel_that_fails_to_close_or_save_state_does_not_block_closing_the_window(
    window: MainWindow, topics: Dock, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    bench = window.bench
    assert bench is not None
    monkeypatch.setattr(topics.panel, "save_state", explode)
    monkeypatch.setattr(topics.panel, "dispose", explode)
    shut: list[bool] = []
    window.on_closed = lambda: shut.append(True)
    with caplog.at_level(logging.ERROR):
        window.close()
    assert shut == [True]
    assert not window.isVisible()
    assert bench.docks["console"].panel.closed
    assert {record.getMessage() for record in caplog.records} == {
        "saving the state of panel 'topics' failed",
        "closing panel 'topics' failed",
    }


class Bad(PlainPanel):
    """Panel that raises the exceptions set in `raises`, by method name."""

    raises: ClassVar[dict[str, BaseException]] = {}

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Bad")
        self._maybe("make")

    def _maybe(self, what: str) -> None:
        if what in self.raises:
            raise self.raises[what]

    def header_widgets(self) -> Sequence[QWidget]:
        self._maybe("header_widgets")
        return super().header_widgets()

    def more_actions(self) -> Sequence[QAction]:
        self._maybe("more_actions")
        return ()

    def refresh(self) -> None:
        self._maybe("refresh")
        super().refresh()

    def sizeHint(self) -> QSize:
        self._maybe("sizeHint")
        return super().sizeHint()

    def save_state(self) -> dict[str, object]:
        self._maybe("save_state")
        return {"kept": "yes"}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self._maybe("restore_state")
        super().restore_state(state)


@pytest.fixture
def bad(monkeypatch: pytest.MonkeyPatch) -> dict[str, BaseException]:
    """Exceptions that the panel "bad" raises, by method name; empty at first."""
    raises: dict[str, BaseException] = {}
    monkeypatch.setattr(Bad, "raises", raises)
    return raises


def with_bad(qtbot, theme: Theme, home: Path) -> MainWindow:
    """Main window with the shipped panels and the panel "bad"."""
    session = Session(
        Settings(home), address=free_address(), journal_folder=home / "journal", start_processes=False
    )
    panels = {**PANELS, "bad": Panel("bad", "Bad", "bot", (), Bad)}
    window = MainWindow(session, theme, panels, [])
    qtbot.addWidget(window)
    window.resize(1440, 900)
    window.show()
    return window


def seen(qtbot, window: MainWindow, name: str = "bad") -> Dock:
    """Open a panel, wait until it is displayed, refresh it and return its dock."""
    bench = window.show_layout("developer")
    dock = bench.open(name)
    assert dock is not None
    qtbot.waitUntil(dock.is_displayed)
    window.tick()
    return dock


def told(window: MainWindow) -> list[str]:
    return [record.text for record in window.session.console.records]


@pytest.mark.parametrize("where", ["make", "header_widgets"])
def test_panel_that_cannot_be_created_shows_the_error_until_a_retry_succeeds(
    qtbot, theme: Theme, home: Path, bad: dict[str, BaseException], where: str
) -> None:
    window = with_bad(qtbot, theme, home)
    bad[where] = RuntimeError("no such luck")
    dock = seen(qtbot, window)
    for _ in range(3):
        window.tick()
    assert dock.has_failed
    assert told(window).count("RuntimeError: no such luck") == 1
    dock.retry()
    window.tick()
    assert dock.has_failed
    assert told(window).count("RuntimeError: no such luck") == 2
    bad.clear()
    dock.retry()
    window.tick()
    window.tick()
    assert not dock.has_failed
    assert isinstance(dock.panel, Bad)
    qtbot.waitUntil(dock.panel.isVisible)
    assert dock.panel.refreshed == 1
    window.close()


@pytest.mark.parametrize("where", ["make", "restore_state"])
def test_panel_that_fails_at_startup_does_not_lose_the_layout(
    qtbot, theme: Theme, home: Path, bad: dict[str, BaseException], where: str
) -> None:
    first = with_bad(qtbot, theme, home)
    seen(qtbot, first)
    assert first.bench is not None
    first.bench.docks["console"].close()
    first.bench.docks["topics"].setFloating(True)
    opened = set(first.bench.open_names())
    first.close()
    bad[where] = ValueError("no such luck")
    again = with_bad(qtbot, theme, home)
    bench = again.show_layout("developer")
    assert set(bench.open_names()) == opened
    assert bench.docks["topics"].isFloating()
    assert bench.docks["inspector"].panel.state == {"filter": ""}
    again.close()
    bad.clear()
    last = with_bad(qtbot, theme, home)
    dock = seen(qtbot, last)
    assert isinstance(dock.panel, Bad)
    assert dock.panel.state == {"kept": "yes"}, "what it had is kept also while it couldn't be made"
    last.close()


def test_panel_created_by_a_later_retry_restores_its_saved_state(
    qtbot, theme: Theme, home: Path, bad: dict[str, BaseException]
) -> None:
    first = with_bad(qtbot, theme, home)
    seen(qtbot, first)
    first.close()
    bad["make"] = ValueError("no such luck")
    again = with_bad(qtbot, theme, home)
    dock = seen(qtbot, again)
    bad.clear()
    dock.retry()
    again.tick()
    assert isinstance(dock.panel, Bad)
    assert dock.panel.state == {"kept": "yes"}
    again.close()


def test_panel_with_state_that_json_cannot_encode_does_not_prevent_saving_the_layout(
    qtbot, theme: Theme, home: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    window = with_bad(qtbot, theme, home)
    seen(qtbot, window)
    monkeypatch.setattr(Bad, "save_state", lambda _panel: {"when": object()})
    with caplog.at_level(logging.ERROR):
        window.close()
    assert [record.getMessage() for record in caplog.records] == ["saving the state of panel 'bad' failed"]
    layouts: dict[str, dict[str, object]] = Settings(home).layouts
    assert "bad" in layouts["developer"]["open"]


def test_panel_that_fails_to_list_its_actions_can_be_closed(
    qtbot, theme: Theme, home: Path, bad: dict[str, BaseException]
) -> None:
    window = with_bad(qtbot, theme, home)
    dock = seen(qtbot, window)
    bad["more_actions"] = RuntimeError("no such luck")
    menu = dock.menu()
    assert [action.text() for action in menu.actions()] == ["Float", "Close"]
    menu.deleteLater()
    window.close()


@pytest.mark.parametrize("where", ["make", "refresh", "sizeHint"])
def test_panel_that_calls_exit_does_not_end_the_window(
    qtbot,
    theme: Theme,
    home: Path,
    bad: dict[str, BaseException],
    where: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heard: list[str] = []
    monkeypatch.setattr(sys, "excepthook", lambda _kind, error, _trace: heard.append(repr(error)))
    window = with_bad(qtbot, theme, home)
    bad[where] = SystemExit("so long")
    dock = seen(qtbot, window)
    if where == "sizeHint":
        dock.panel.updateGeometry()
        assert dock.panel.sizeHint() == QSize()
        assert set(heard) == {"SystemExit('so long')"}
    else:
        assert dock.has_failed
        assert told(window).count("SystemExit: so long") == 1
    other = seen(qtbot, window, "console").panel
    assert other.refreshed
    window.close()
