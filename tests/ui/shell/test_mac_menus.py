"""Tests of the menus on macOS: three commands move to the application menu, all others stay."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from app.ui.shell.bars.app_bar import AppBar
from app.ui.shell.docking.layouts import LAYOUTS
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu

pytest_plugins = ["tests.ui.shell_fixtures"]
Role = QAction.MenuRole


def entries(menu: QMenu) -> Iterator[QAction]:
    for action in menu.actions():
        yield action
        if (inner := action.menu()) is not None:
            assert isinstance(inner, QMenu)
            yield from entries(inner)


def all_entries(window: MainWindow) -> list[QAction]:
    found = []
    for title in window.bar.menus.actions():
        found.append(title)
        menu = title.menu()
        assert isinstance(menu, QMenu)
        menu.aboutToShow.emit()  # lists in the menu are filled when it opens
        menu.aboutToHide.emit()
        found += entries(menu)
    return found


def test_settings_quit_and_about_have_their_macos_application_menu_roles(window: MainWindow) -> None:
    places = {action.objectName(): action.menuRole() for action in all_entries(window)}
    moved = {name: role for name, role in places.items() if role != Role.NoRole}
    assert moved == {
        "settings.open": Role.PreferencesRole,
        "file.quit": Role.QuitRole,
        "help.about": Role.AboutRole,
    }


def test_no_action_uses_the_text_heuristic_menu_role(window: MainWindow) -> None:
    found = all_entries(window)
    assert len(found) > 40
    assert [action.text() for action in found if action.menuRole() == Role.TextHeuristicRole] == []


@pytest.mark.parametrize(
    "words", ["About us", "Quit", "Setup", "Preferences of Ana", "Configuración", "Exit"]
)
def test_menu_entry_named_like_a_system_command_stays_in_its_menu(qtbot, theme: Theme, words: str) -> None:
    place = QWidget()
    qtbot.addWidget(place)
    menu = Menu(theme, place, words)
    assert menu.addAction(words).menuRole() == Role.NoRole
    assert menu.menuAction().menuRole() == Role.NoRole
    kept = QAction(words, place)
    kept.setMenuRole(Role.AboutRole)
    menu.addAction(kept)
    assert kept.menuRole() == Role.AboutRole


@pytest.mark.parametrize(("platform", "native"), [("darwin", True), ("linux", False), ("win32", False)])
def test_native_menu_bar_is_used_on_macos_only(qtbot, theme: Theme, platform: str, native: bool) -> None:
    bar = AppBar(theme, LAYOUTS, platform)
    qtbot.addWidget(bar)
    assert bar.is_menu_bar_native == native
