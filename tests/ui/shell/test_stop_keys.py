"""Tests that Stop works with any sheet, menu or drag: no widget is modal, and its keys have priority."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu

import app.ui
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.studio_dialogs import StudioDialogs
from app.ui.shell.main_window import MainWindow
from app.ui.widgets.field_drag import FieldDrag
from app.ui.widgets.inputs.combo_box import ComboBox
from tests.syntax import nodes, parse

pytest_plugins = ["tests.ui.shell_fixtures"]
pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)

MODAL = {
    "exec", "exec_", "setModal", "getOpenFileName", "getOpenFileNames", "getSaveFileName",
    "getExistingDirectory", "getOpenFileUrl", "getSaveFileUrl", "getColor", "getFont", "getText", "getItem",
    "getInt", "getDouble", "getMultiLineText", "ApplicationModal", "WindowModal",
}  # fmt: skip
KEYS = [
    (Qt.Key.Key_F12, Qt.KeyboardModifier.NoModifier),
    (Qt.Key.Key_Period, Qt.KeyboardModifier.ControlModifier),
]


@pytest.fixture
def stops(qtbot, window: MainWindow, commands: Commands) -> Iterator[list[str]]:
    """One entry per execution of Stop, in an active window with the Developer layout."""
    done: list[str] = []
    commands.actions["run.stop"].triggered.connect(lambda: done.append("stop"))
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    commands.run("layout.developer")
    qtbot.waitUntil(window.isActiveWindow)
    yield done
    for widget in QApplication.topLevelWidgets():
        if isinstance(widget, (QMenu, QFileDialog)):
            widget.close()


def a_menu(window: MainWindow) -> None:
    menu = window.bar.menus.actions()[3].menu()
    menu.popup(window.mapToGlobal(QPoint(200, 40)))


def a_menu_of_a_panel(window: MainWindow) -> None:
    dock = window.benches["developer"].docks["topics"]
    dock.title.menu_requested.emit(None)


def a_context_menu_of_a_field(window: MainWindow) -> None:
    field = window.benches["developer"].docks["topics"].panel.filter
    place = QPoint(4, 4)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, place, field.mapToGlobal(place))
    QApplication.sendEvent(field, event)


def a_list_of_choices(window: MainWindow) -> None:
    choice = ComboBox(window.theme, [(name, name) for name in ("one", "two")])
    choice.setParent(window)
    choice.show()
    choice.showPopup()


def a_file_dialog(window: MainWindow) -> None:
    window.commands.run("file.open")


def the_sheet_of_files(window: MainWindow) -> None:
    StudioDialogs(window.theme, window, window.session.settings).open_picture("", lambda _path: None)


def a_panel_that_floats(window: MainWindow) -> None:
    dock = window.benches["developer"].docks["topics"]
    dock.setFloating(True)
    dock.activateWindow()
    dock.panel.filter.setFocus()


def a_field_in_which_one_types(window: MainWindow) -> None:
    window.benches["developer"].docks["topics"].panel.filter.setFocus()


def a_command(name: str) -> Callable[[MainWindow], None]:
    def run(window: MainWindow) -> None:
        window.commands.run(name)

    run.__name__ = name
    return run


OPENED = [
    a_menu,
    a_menu_of_a_panel,
    a_context_menu_of_a_field,
    a_list_of_choices,
    a_file_dialog,
    the_sheet_of_files,
    a_panel_that_floats,
    a_field_in_which_one_types,
    *map(
        a_command,
        (
            "palette.open",
            "settings.open",
            "help.shortcuts",
            "help.about",
            "help.report",
            "network.others",
            "network.web",
            "layout.keep",
        ),
    ),
]


@pytest.mark.parametrize("opened", OPENED, ids=lambda each: each.__name__)
@pytest.mark.parametrize("key", KEYS, ids=("F12", "Ctrl+."))
def test_stop_works_with_any_sheet_or_menu_open(
    qtbot, window: MainWindow, stops: list[str], opened: Callable[[MainWindow], None], key: tuple
) -> None:
    opened(window)
    QApplication.processEvents()
    assert QApplication.activeModalWidget() is None
    QTest.keyClick(QGuiApplication.focusWindow(), *key)
    assert stops == ["stop"]


@pytest.fixture
def presses(window: MainWindow, stops: list[str]) -> list[str]:
    """One entry per click on the Stop button of the toolbar."""
    done: list[str] = []
    window.tool_bar.stop.clicked.connect(lambda: done.append("stop"))
    return done


@pytest.mark.parametrize("opened", OPENED[:4], ids=lambda each: each.__name__)
def test_first_click_on_stop_triggers_stop_and_closes_popups(
    window: MainWindow, presses: list[str], opened: Callable[[MainWindow], None]
) -> None:
    opened(window)
    QApplication.processEvents()
    assert QApplication.activePopupWidget() is not None
    stop = window.tool_bar.stop
    place = stop.mapTo(window, stop.rect().center())
    QTest.mousePress(window.windowHandle(), Qt.MouseButton.LeftButton, pos=place)
    assert presses == ["stop"]
    QTest.mouseRelease(window.windowHandle(), Qt.MouseButton.LeftButton, pos=place)
    assert presses == ["stop"]
    assert QApplication.activePopupWidget() is None


def test_click_outside_a_popup_closes_the_popup_without_triggering_stop(
    window: MainWindow, presses: list[str]
) -> None:
    a_menu(window)
    QApplication.processEvents()
    place = window.tool_bar.stop.mapTo(window, QPoint(-20, 4))
    QTest.mouseClick(window.windowHandle(), Qt.MouseButton.LeftButton, pos=place)
    assert not presses
    assert QApplication.activePopupWidget() is None


def test_stop_key_triggers_once_per_press(window: MainWindow, stops: list[str]) -> None:
    handle = QGuiApplication.focusWindow()
    QTest.keyPress(handle, Qt.Key.Key_F12)
    QTest.keyRelease(handle, Qt.Key.Key_F12)
    assert stops == ["stop"]


@pytest.mark.usefixtures("syntax_trees")
def test_user_interface_code_makes_no_modal_calls() -> None:
    found = [
        f"{path.name}: {ast.unparse(node)}"
        for path in Path(app.ui.__file__).parent.rglob("*.py")
        for source in [path.read_text("utf-8")]
        if any(f".{name}" in source for name in MODAL)
        for node in nodes(parse(path), ast.Attribute)
        if node.attr in MODAL
    ]
    # the speaker's loop has its own thread
    assert sorted(found) == ["application.py: application.exec", "speaker.py: worker.loop.exec"]


@pytest.mark.parametrize("key", KEYS, ids=["F12", "Ctrl+."])
def test_stop_works_during_drag_and_drop_of_a_field(window: MainWindow, stops: list[str], key) -> None:
    drag = FieldDrag(window.menuBar() or window, "/odom", "speed")
    QTest.keyClick(window, *key)
    assert stops == ["stop"]
    drag.cancel()
