"""Panels that raise: the window lives on, the others show what is new, and the panel comes back."""

from __future__ import annotations

import logging

import pytest
from PySide6.QtWidgets import QApplication

from app.ui.docks import Dock
from app.ui.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


def explode() -> dict[str, object]:
    raise RuntimeError("no such luck")


@pytest.fixture
def topics(qtbot, window: MainWindow, commands: object) -> Dock:
    """The Topics panel of an open window."""
    window.show()
    dock = window.show_layout("developer").docks["topics"]
    qtbot.waitUntil(dock.shown)
    return dock


def test_the_others_go_on_and_it_comes_back_when_it_is_opened_again(window: MainWindow, topics: Dock) -> None:
    bench = window.bench
    assert bench is not None
    topics.panel.explode = True
    other = bench.docks["console"].panel
    before = other.refreshed
    for _ in range(5):
        window.tick()
    assert topics.failed
    assert other.refreshed == before + 5
    assert [r.text for r in window.session.console.records].count("RuntimeError: no such luck") == 0
    assert [r.text for r in window.session.console.records].count("ValueError: no such luck") == 1
    assert QApplication.activeModalWidget() is None
    topics.panel.explode = False
    topics.close()
    bench.open("topics")
    assert not topics.failed
    assert topics.panel.isVisible()
    before = topics.panel.refreshed
    window.tick()
    assert topics.panel.refreshed == before + 1


def test_one_that_fails_again_is_told_again(window: MainWindow, topics: Dock) -> None:
    topics.panel.explode = True
    for _ in range(3):
        window.tick()
        topics.try_again()
    texts = [record.text for record in window.session.console.records]
    assert texts.count("ValueError: no such luck") == 3


def test_one_that_cant_end_or_tell_its_state_does_not_keep_the_window_open(
    window: MainWindow, topics: Dock, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    bench = window.bench
    assert bench is not None
    monkeypatch.setattr(topics.panel, "save_state", explode)
    monkeypatch.setattr(topics.panel, "shut", explode)
    shut: list[bool] = []
    window.on_shut = lambda: shut.append(True)
    with caplog.at_level(logging.ERROR):
        window.close()
    assert shut == [True]
    assert not window.isVisible()
    assert bench.docks["console"].panel.closed
    assert {record.getMessage() for record in caplog.records} == {
        "the panel 'topics' can't tell its state",
        "the panel 'topics' can't end in order",
    }
