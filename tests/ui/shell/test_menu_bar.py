"""Tests of the menu mnemonics, which are underlined while Alt is held."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication

from app.ui.shell.main_window import MainWindow

pytestmark = pytest.mark.qt_log_ignore("does not support grabbing the keyboard", extend=True)
pytest_plugins = ["tests.ui.shell_fixtures"]


def test_holding_alt_underlines_the_mnemonics(qtbot, window: MainWindow) -> None:
    window.show()
    bar = window.bar.menus
    qtbot.waitUntil(bar.isVisible)
    before = bar.grab().toImage()
    for kind, shown in ((QEvent.Type.KeyPress, True), (QEvent.Type.KeyRelease, False)):
        QApplication.sendEvent(window.windowHandle(), QKeyEvent(kind, Qt.Key.Key_Alt, Qt.AltModifier))
        assert bar.shows_mnemonics == shown
        if shown:  # after Alt alone is released, Qt focuses the bar
            assert bar.grab().toImage() != before


def test_active_menu_is_highlighted(qtbot, window: MainWindow) -> None:
    window.show()
    bar = window.bar.menus
    qtbot.waitUntil(bar.isVisible)
    before = bar.grab().toImage()
    bar.setActiveAction(bar.actions()[1])
    menu = bar.actions()[1].menu()
    qtbot.waitUntil(lambda: bar.grab().toImage() != before)
    menu.close()
