"""Tests of the main window: layouts, keyboard, banner, Stop and the restored state."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QFileDialog,
    QPushButton,
    QTabBar,
    QWidget,
)

from app.blocks.model.project import Project
from app.core.faults import RepeatFilter
from app.core.projects.journal import Journal, unsaved_work
from app.core.run.view import RunState, RunView
from app.core.session import Session
from app.core.storage.settings import Settings
from app.intents import Inspect
from app.robots import simulated
from app.robots.description.description import parse, thing_description
from app.ui.application import Options, last_layout, show_first_page
from app.ui.intents import OpenPanel, SelectTab, ShowBlock
from app.ui.panels.base import PanelContext
from app.ui.shell.commands.commands import Commands
from app.ui.shell.docking.dock_title import DockTitle
from app.ui.shell.main_window import MainWindow, Placeholder
from app.ui.theme.theme import Theme
from app.ui.widgets import Button
from app.ui.widgets.file_dialogs import SystemDialogs
from app.ui.widgets.keyboard import tab_stops
from tests.ui.shell_parts import COMMANDS, PANELS, PlainPanel, free_address

pytest_plugins = ["tests.ui.shell_fixtures"]


def panel(window: MainWindow, layout: str, name: str) -> PlainPanel:
    found = window.benches[layout].docks[name].panel
    assert isinstance(found, PlainPanel)
    return found


def show(qtbot, window: MainWindow) -> None:
    window.show()
    qtbot.waitExposed(window)
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)


def test_window_opens_with_the_start_page(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    assert window.start.isVisible()
    assert not window.run_bar.isVisible()
    assert not window.status.isVisible()
    assert not window.bar.switch.isVisible()
    assert window.bar.stop.isVisible()
    window.tick()
    assert not window.bar.stop.is_filled


def test_home_button_opens_the_start_page_and_back_button_returns(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    assert not window.bar.home.isVisible()
    assert not window.bar.back.isVisible(), "a first start leads back to nothing"
    assert commands.actions.disabled_reason("start_page.leave") == "Nothing is open"
    commands.run("layout.developer")
    QTest.mouseClick(window.bar.home, Qt.MouseButton.LeftButton)
    assert window.start.isVisible()
    QTest.mouseClick(window.bar.back, Qt.MouseButton.LeftButton)
    assert window.current_layout == "developer"
    QTest.keyClick(window, Qt.Key.Key_Home, Qt.KeyboardModifier.AltModifier)
    assert window.start.isVisible()
    qtbot.waitUntil(lambda: window.start.isAncestorOf(QApplication.focusWidget()))
    QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Escape)
    assert window.current_layout == "developer"


def test_click_on_open_work_on_the_start_page_opens_its_tab(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    documents = window.session.documents
    first = documents.current
    first.apply_edit({"blocks": {"languageVersion": 0, "blocks": [{"type": "x", "id": "a"}]}})
    documents.new().apply_edit({"blocks": {"languageVersion": 0, "blocks": [{"type": "x", "id": "b"}]}})
    commands.run("file.start_page")
    rows = window.start.open_work.rows
    assert [row.work.name for row in rows] == [documents.current.name, first.name], "the current one first"
    QTest.mouseClick(rows[1], Qt.MouseButton.LeftButton)
    assert documents.current is first
    assert window.current_layout == "behaviour"


def test_stop_button_is_filled_on_the_start_page_while_a_robot_has_not_stopped(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    fleet = window.session.fleet
    fleet.connect(parse(thing_description(simulated.ROBOT.thing_model, "Pepper")), "/Pepper/description")
    window.tick()
    assert not window.bar.stop.is_filled
    link = fleet.link("Pepper")
    assert link is not None
    link.stop_problem = "Pepper may still move: the brake does not answer"
    window.tick()
    assert window.bar.stop.is_filled
    link.stop_problem = ""
    link.unended_actions = "Pepper may still move: wave is still running"
    window.tick()
    assert window.bar.stop.is_filled
    link.unended_actions = ""
    window.tick()
    assert not window.bar.stop.is_filled


def test_both_layouts_show_their_panels(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    commands.run("layout.behaviour")
    assert set(window.benches["behaviour"].open_names()) == {
        "behaviour",
        "problems",
        "robot",
        "camera",
        "sensors",
    }
    assert (window.run_bar.isVisible(), window.tool_bar.isVisible()) == (True, False)
    commands.run("layout.developer")
    assert set(window.benches["developer"].open_names()) == {
        "topics",
        "inspector",
        "image",
        "console",
        "alerts",
    }
    assert (window.run_bar.isVisible(), window.tool_bar.isVisible()) == (False, True)
    assert window.bar.switch.value == "developer"


def test_docks_of_both_layouts_have_their_default_sizes_and_positions(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    commands.run("layout.behaviour")
    docks = window.benches["behaviour"].docks
    qtbot.waitUntil(lambda: abs(docks["robot"].width() - 384) <= 2)
    qtbot.waitUntil(lambda: abs(docks["problems"].height() - 124) <= 6)
    qtbot.waitUntil(lambda: docks["problems"].width() == docks["behaviour"].width())
    right = {docks[name].x() for name in ("robot", "camera", "sensors")}
    assert len(right) == 1
    assert docks["robot"].x() - docks["behaviour"].geometry().right() - 1 == 8
    commands.run("layout.developer")
    docks = window.benches["developer"].docks
    qtbot.waitUntil(lambda: abs(docks["inspector"].width() - 330) <= 2)
    qtbot.waitUntil(lambda: abs(docks["topics"].width() - 640) <= 4)
    assert docks["inspector"].x() - docks["topics"].geometry().right() - 1 == 6
    assert docks["console"].y() > docks["image"].y()


def test_only_visible_panels_are_refreshed(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    commands.run("layout.behaviour")
    commands.run("layout.developer")
    qtbot.waitUntil(window.benches["developer"].docks["console"].is_displayed)
    hidden = panel(window, "behaviour", "robot").refreshed
    before = panel(window, "developer", "topics").refreshed
    window.tick()
    assert panel(window, "developer", "topics").refreshed == before + 1
    assert panel(window, "behaviour", "robot").refreshed == hidden
    behind = panel(window, "developer", "alerts").refreshed
    window.tick()
    assert panel(window, "developer", "alerts").refreshed == behind
    window.benches["developer"].docks["alerts"].raise_()
    qtbot.waitUntil(window.benches["developer"].docks["alerts"].is_displayed)
    window.tick()
    assert panel(window, "developer", "alerts").refreshed == behind + 1


def test_failed_panel_shows_an_error_and_the_window_keeps_running(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    commands.run("layout.developer")
    topics = panel(window, "developer", "topics")
    topics.explode = True
    window.tick()
    dock = window.benches["developer"].docks["topics"]
    assert dock.has_failed
    assert not topics.isVisible()
    assert window.session.console.records[-1].text == "ValueError: no such luck"
    count = len(window.session.console.records)
    window.tick()
    assert len(window.session.console.records) == count
    topics.explode = False
    again = next(b for b in dock.findChildren(Button) if b.text() == "Try again")
    QTest.mouseClick(again, Qt.MouseButton.LeftButton)
    window.tick()
    assert topics.isVisible()
    assert topics.refreshed > 0


def test_f12_triggers_stop_in_every_layout_and_in_a_floating_dock(
    qtbot, window: MainWindow, commands: Commands, monkeypatch
) -> None:
    stops: list[str] = []
    commands.actions["run.stop"].triggered.connect(lambda: stops.append("stop"))
    show(qtbot, window)
    for layout in ("", "layout.behaviour", "layout.developer"):
        if layout:
            commands.run(layout)
        QTest.keyClick(window, Qt.Key.Key_F12)
    assert len(stops) == 3
    dock = window.benches["developer"].docks["topics"]
    dock.setFloating(True)
    dock.activateWindow()
    QTest.keyClick(panel(window, "developer", "topics").filter, Qt.Key.Key_F12)
    assert len(stops) == 4


def test_esc_in_a_text_field_clears_focus_and_does_not_trigger_stop(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    stops: list[str] = []
    commands.actions["run.stop"].triggered.connect(lambda: stops.append("stop"))
    show(qtbot, window)
    commands.run("layout.developer")
    field = panel(window, "developer", "topics").filter
    field.setFocus()
    QTest.keyClick(field, Qt.Key.Key_Escape)
    assert not field.hasFocus()
    assert stops == []


@pytest.mark.parametrize("held", [Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier])
def test_tab_key_never_focuses_a_panel_behind_another_panel(
    qtbot, window: MainWindow, commands: Commands, held
) -> None:
    show(qtbot, window)
    commands.run("layout.developer")
    bench = window.benches["developer"]
    qtbot.waitUntil(bench.docks["console"].is_displayed)
    behind = [dock for dock in bench.docks.values() if not dock.is_front]
    assert any(list(tab_stops(dock, dock)) for dock in behind), "Qt would go there"
    bench.focus_panel(bench.docks["console"])
    seen = []
    for _ in range(60):
        focus = QApplication.focusWidget()
        QTest.keyClick(focus, Qt.Key.Key_Tab if not held else Qt.Key.Key_Backtab, held)
        seen.append(QApplication.focusWidget())
    assert len(set(map(id, seen))) > 10
    assert not any(isinstance(each, QTabBar) for each in seen)
    assert not any(dock.isAncestorOf(each) for dock in behind for each in seen)


def test_shift_f10_opens_the_menu_of_the_focused_widget(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    commands.run("layout.developer")
    field = panel(window, "developer", "topics").filter
    field.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
    asked: list[QPoint] = []
    field.customContextMenuRequested.connect(asked.append)
    field.setFocus()
    QTest.keyClick(field, Qt.Key.Key_F10, Qt.KeyboardModifier.ShiftModifier)
    assert asked == [field.rect().center()]


def test_f6_and_number_shortcuts_move_between_panels(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    commands.run("layout.developer")
    qtbot.waitUntil(window.benches["developer"].docks["console"].is_displayed)
    seen = []
    for _ in range(4):
        QTest.keyClick(window, Qt.Key.Key_F6)
        dock = window.panel_focus.focused_dock()
        assert dock is not None
        seen.append(dock.description.name)
    assert sorted(seen) == ["console", "image", "inspector", "topics"]
    QTest.keyClick(window, Qt.Key.Key_2, Qt.KeyboardModifier.ControlModifier)
    found = window.panel_focus.focused_dock()
    assert found is not None
    assert found.description.name == window.bench.open_names()[1]
    assert found.title.name.property("role") == "text"


def test_slash_focuses_the_filter_of_the_panel(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    commands.run("layout.developer")
    topics = panel(window, "developer", "topics")
    topics.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    topics.setFocus()
    QTest.keyClick(topics, Qt.Key.Key_Slash)
    assert topics.filter.hasFocus()
    assert topics.filter.text() == ""


def test_panels_are_floated_closed_and_reopened(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    bench = window.show_layout("developer")
    dock = bench.docks["inspector"]
    labels = [action.text() for action in dock.menu().actions()]
    assert labels == ["Float", "Close"]
    dock.menu().actions()[0].trigger()
    assert dock.isFloating()
    assert [action.text() for action in dock.menu().actions()] == ["Dock", "Close"]
    dock.menu().actions()[1].trigger()
    assert "inspector" not in bench.open_names()
    assert commands.request(OpenPanel("inspector"))
    assert "inspector" in bench.open_names()


def test_floating_panels_are_hidden_with_their_layout(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    bench = window.show_layout("developer")
    bench.docks["inspector"].setFloating(True)
    assert bench.docks["inspector"].isVisible()
    commands.run("layout.behaviour")
    assert not bench.docks["inspector"].isVisible()
    commands.run("layout.developer")
    assert bench.docks["inspector"].isVisible()


def test_panels_in_the_same_dock_area_are_tabs_in_the_title_bar(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    bench = window.show_layout("developer")
    qtbot.waitUntil(lambda: bench.docks["console"].title.tabs == ("Console", "Alerts"))
    assert bench.docks["topics"].title.tabs == ()
    second = bench.docks["console"].title._tabs[1]
    QTest.mouseClick(second, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(bench.docks["alerts"].is_displayed)
    assert not bench.docks["console"].is_displayed()


def test_dock_tabs_and_tabs_of_a_panel_are_in_separate_rows(qtbot, window: MainWindow) -> None:
    """In one row, a dock tab could be mistaken for the tab of a file."""

    class Own(PlainPanel):
        def title_widget(self) -> QWidget:
            return own

    own = QWidget()
    own.setMinimumSize(40, 28)
    show(qtbot, window)
    bench = window.show_layout("behaviour")
    plain = bench.docks["behaviour"].panel
    title = DockTitle(window.theme, Own(plain.context, "Behaviour"), "comfortable")
    qtbot.addWidget(title)
    alone = title.sizeHint().height()
    title.resize(300, alone)
    title.show()
    title.set_tabs([("Behaviour", "blocks", True, lambda: None), ("Robots", "bot", False, lambda: None)])
    assert title.sizeHint().height() > alone
    title.resize(300, title.sizeHint().height())
    qtbot.waitUntil(lambda: own.height() >= 28 and title._tabs[0].width() > 20)
    lowest = max(tab.mapTo(title, tab.rect().bottomLeft()).y() for tab in title._tabs)
    assert lowest < own.mapTo(title, QPoint()).y()
    title.set_tabs(())
    assert title.sizeHint().height() == alone


def test_panel_opens_as_a_tab_in_its_default_dock_area(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    bench = window.show_layout("behaviour")
    commands.request(OpenPanel("console"))
    assert bench.docks["console"] in bench.tabifiedDockWidgets(bench.docks["problems"])


def test_narrow_window_tabifies_panels_and_wide_window_separates_panels(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    bench = window.show_layout("behaviour")
    docks = bench.docks
    window.resize(1150, 750)
    qtbot.waitUntil(lambda: docks["camera"] in bench.tabifiedDockWidgets(docks["robot"]))
    window.resize(1440, 900)
    qtbot.waitUntil(lambda: docks["camera"].y() > docks["robot"].y())
    QTest.qWait(50)  # Qt would tab the docks again when control returns to the event loop
    assert bench.tabifiedDockWidgets(docks["robot"]) == []
    assert docks["sensors"].y() > docks["camera"].y()


def test_panel_closed_in_a_narrow_window_stays_closed_in_a_wide_window(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    window.resize(1440, 900)
    bench = window.show_layout("developer")
    window.resize(1150, 750)
    qtbot.waitUntil(lambda: bench.docks["inspector"] in bench.tabifiedDockWidgets(bench.docks["topics"]))
    bench.docks["console"].close()
    bench.open("robots")
    window.resize(1440, 900)
    qtbot.waitUntil(lambda: bench.docks["inspector"].x() > bench.docks["topics"].x())
    assert "console" not in bench.open_names()
    assert "robots" in bench.open_names()


def test_window_state_is_restored_after_restart(qtbot, theme: Theme, session: Session, home: Path) -> None:
    first = MainWindow(session, theme, PANELS, [])
    qtbot.addWidget(first)
    commands = first.commands
    show(qtbot, first)
    bench = first.show_layout("developer")
    bench.docks["alerts"].close()
    bench.docks["inspector"].setFloating(True)
    panel(first, "developer", "topics").filter.setText("cam")
    commands.run("theme.dark")
    commands.run("text.larger")
    first.close()
    again = Session(
        Settings(home), address=free_address(), journal_folder=home / "journal", start_processes=False
    )
    second = MainWindow(again, theme, PANELS, [])
    qtbot.addWidget(second)
    theme.set_mode("light")
    second.state.apply_theme(theme)
    assert (theme.mode, theme.text_percent) == ("dark", 125)
    assert second.state.layout == "developer"
    show(qtbot, second)
    bench = second.show_layout("developer")
    assert bench.docks["inspector"].isFloating()
    assert "alerts" not in bench.open_names()
    assert panel(second, "developer", "topics").state == {"filter": "cam"}
    second.close()


def test_damaged_layouts_fall_back_to_the_default_arrangement(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.session.settings.layouts = {
        "developer": {"open": ["topics", 5], "docks": "%%%", "panels": 3},
    }
    show(qtbot, window)
    assert "inspector" in window.show_layout("developer").open_names()


def test_topic_opens_in_the_matching_panel(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    window.show_layout("behaviour")
    window.open_topic("/odom")
    assert window.current_layout == "developer"
    assert panel(window, "developer", "inspector").topics == ["/odom"]
    assert panel(window, "developer", "image").topics == []


def test_commands_are_run_by_id_and_unknown_ids_fail(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    assert commands.request(Inspect("/faces"))
    assert panel(window, "developer", "inspector").topics == ["/faces"]
    assert commands.request(ShowBlock("b7"))
    assert panel(window, "behaviour", "behaviour").blocks == ["b7"]
    assert commands.run("edit.undo")
    assert panel(window, "behaviour", "behaviour").undone == ["undo"]
    assert commands.request(OpenPanel("topics"))
    assert not commands.request(OpenPanel("nonsense"))
    assert not commands.request(SelectTab("nobody"))


def test_alert_is_shown_in_the_banner_until_resolved_or_dismissed(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    window.show_layout("developer")
    alerts = window.session.alerts
    alerts.raise_alert("one", "warn", "A topic is slow.", "Look at it.")
    alerts.raise_alert(
        "two", "error", "The camera is silent.", "It waits.", button="Look", intent=Inspect("/camera")
    )
    window.tick()
    banner = window.banner.banner
    assert window.banner.isVisible()
    assert "The camera is silent." in banner.accessibleName()
    assert banner.more_button.accessibleName() == "and 1 more"
    QTest.mouseClick(banner.button, Qt.MouseButton.LeftButton)
    assert panel(window, "developer", "inspector").topics == ["/camera"]
    alerts.resolve("two")
    window.tick()
    assert "A topic is slow." in banner.accessibleName()
    QTest.mouseClick(banner.close_button, Qt.MouseButton.LeftButton)
    window.tick()
    assert not window.banner.isVisible()
    assert alerts.is_dismissed("one")


def test_recovery_of_work_after_a_crash_is_offered_without_a_dialog(
    qtbot, window: MainWindow, commands: Commands, home: Path
) -> None:
    for name in ("Story", "Tale", "Song"):
        blocks = {"blocks": {"blocks": [{"type": "events_started"}]}}
        Journal(home / "journal").write(Project.of_blocks(name, blocks), None)
    for file in (home / "journal").glob("*.json"):
        entry = json.loads(file.read_text("utf-8"))
        file.write_text(json.dumps({**entry, "pid": 2**22 + 1}), "utf-8")
    show(qtbot, window)
    commands.behaviours.restore_tabs(unsaved_work(home / "journal"), window.banner.offer)
    assert window.banner.isVisible()
    assert "“Song” and 2 others weren't saved" in window.banner.banner.accessibleName()
    assert QApplication.activeModalWidget() is None
    QTest.mouseClick(window.banner.banner.button, Qt.MouseButton.LeftButton)
    assert {document.name for document in window.session.documents} == {"Story", "Tale", "Song"}
    assert all(document.dirty for document in window.session.documents)
    assert window.current_layout == "behaviour"
    assert not window.banner.isVisible()


def test_tabs_are_restored_without_asking_after_a_clean_exit(
    qtbot, theme: Theme, window: MainWindow, commands: Commands, home: Path
) -> None:
    window.session.tabs.restore([])
    window.session.document.apply_edit({"blocks": {"blocks": [{"type": "events_started"}]}})
    commands.run("file.new")
    window.session.document.apply_edit({"blocks": {"blocks": [{"type": "events_message"}]}})
    window.close()
    for file in (home / "journal").glob("*.json"):
        entry = json.loads(file.read_text("utf-8"))
        file.write_text(json.dumps({**entry, "pid": 2**22 + 1}), "utf-8")
    again = Session(
        Settings(home), address="127.0.0.1:9", journal_folder=home / "journal", start_processes=False
    )
    rest = again.tabs.restore(unsaved_work(home / "journal"))
    assert rest == []
    assert [document.name for document in again.documents] == ["New behaviour", "New behaviour 2"]
    assert all(document.dirty for document in again.documents)
    again.close()


def test_theme_change_applies_immediately(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    window.show_layout("behaviour")
    commands.run("theme.dark")
    image = window.grab().toImage()
    assert image.pixelColor(3, window.height() // 2) == window.theme.colour("window")
    assert commands.actions["theme.dark"].isChecked()


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_large_text_clips_no_button_of_the_run_bar(
    qtbot, window: MainWindow, commands: Commands, percent: int
) -> None:
    show(qtbot, window)
    window.show_layout("behaviour")
    window.theme.set_text_percent(percent)

    def fits() -> None:
        for button in (window.run_bar.run, window.run_bar.pause, window.run_bar.step, window.run_bar.stop):
            hint = button.sizeHint()
            assert button.width() >= hint.width()
            assert button.height() >= hint.height()
        assert window.run_bar.height() >= window.run_bar.sizeHint().height()

    qtbot.waitUntil(fits)


def test_closing_the_window_closes_its_panels_and_stops_its_timer_once(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    done: list[str] = []
    window.on_closed = lambda: done.append("shut")
    show(qtbot, window)
    bench = window.show_layout("developer")
    window.close()
    window.close()
    assert done == ["shut"]
    assert panel(window, "developer", "topics").closed
    assert bench is window.benches["developer"]
    assert not window.timer.isActive()


def test_every_command_has_a_text_and_shortcuts_are_unique() -> None:
    assert len({row.id for row in COMMANDS}) == len(COMMANDS)
    keys = [key for row in COMMANDS for key in row.keys]
    assert len(set(keys)) == len(keys)
    assert all(row.text for row in COMMANDS)
    stop = next(row for row in COMMANDS if row.id == "run.stop")
    assert (stop.text, stop.default_keys()[0]) == ("Stop the program and all robots", "F12")


def test_no_plain_qt_buttons_are_used(qtbot, window: MainWindow, commands: Commands) -> None:
    show(qtbot, window)
    for layout in ("behaviour", "developer"):
        window.show_layout(layout)
    assert [each for each in window.findChildren(QPushButton) if type(each) is QPushButton] == []


def test_all_buttons_of_the_behaviour_layout_have_accessible_names(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    window.show_layout("behaviour")
    window.tick()

    nameless = [
        b
        for b in window.findChildren(QAbstractButton)
        if b.isVisible() and not (b.accessibleName() or b.text())
    ]
    assert nameless == []


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_panel_titles_are_not_clipped_at_any_text_size(
    qtbot, window: MainWindow, commands: Commands, percent: int
) -> None:
    show(qtbot, window)
    bench = window.show_layout("behaviour")
    window.theme.set_text_percent(percent)
    for dock in bench.docks.values():
        qtbot.waitUntil(lambda title=dock.title: title.height() >= title.sizeHint().height())
        name = dock.title.name
        qtbot.waitUntil(lambda name=name: name.isHidden() or name.height() >= name.sizeHint().height())
        assert dock.title.height() >= dock.title.fontMetrics().height()


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_stop_result_is_not_clipped_in_a_narrow_window_at_any_text_size(
    qtbot, window: MainWindow, commands, percent: int
) -> None:
    show(qtbot, window)
    window.show_layout("behaviour")
    window.resize(1100, 700)
    window.theme.set_text_percent(percent)
    bar = window.run_bar
    bar.show_view(
        RunView(
            "proven",
            "Stopped",
            "",
            "Stopped",
            can_run=True,
            result="Pepper stopped (41 ms)",
            result_status="ok",
        )
    )
    qtbot.waitUntil(lambda: bar.result.width() >= bar.result.sizeHint().width())
    assert bar.stop.geometry().right() <= bar.width()
    assert bar.run.width() >= bar.run.sizeHint().width()


def test_session_error_is_logged_once_and_the_window_keeps_running(
    qtbot, window: MainWindow, commands: Commands, monkeypatch, caplog: pytest.LogCaptureFixture
) -> None:
    show(qtbot, window)
    window.show_layout("developer")

    def fail() -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr(window.session, "tick", fail)
    before = panel(window, "developer", "topics").refreshed
    window.tick()
    window.tick()
    assert panel(window, "developer", "topics").refreshed == before + 2
    assert window.banner.banner.accessibleName().endswith("RuntimeError: broken")
    once = RepeatFilter()
    assert sum(once.filter(record) is not None for record in caplog.records) == 1


def test_closing_the_window_during_a_run_stops_the_robots_immediately(
    qtbot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    show(qtbot, window)
    monkeypatch.setattr(window.session.runs, "_run", RunState("running"))
    monkeypatch.setattr(window.session.runs, "stop", lambda: done.append("stop"))
    monkeypatch.setattr(window.session, "close", lambda: done.append("close"))
    window.close()
    assert done == ["stop", "close"]


def test_idle_window_closes_without_sending_stop(
    qtbot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    show(qtbot, window)
    monkeypatch.setattr(window.session.runs, "stop", lambda: done.append("stop"))
    window.close()
    assert done == []


def test_floating_or_closing_a_panel_does_not_move_focus_to_another_panel(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    commands.run("layout.developer")
    bench = window.benches["developer"]
    dock = bench.docks["topics"]
    dock.title.more.setFocus()
    qtbot.waitUntil(dock.title.more.hasFocus)
    floating = next(action for action in dock.menu().actions() if action.text() == "Float")
    floating.trigger()
    qtbot.waitUntil(dock.panel.filter.hasFocus)
    QTest.keyClick(dock, Qt.Key.Key_Escape)
    dock.close()
    QTest.qWait(20)
    focus = QApplication.focusWidget()
    assert focus is None or not any(d.isAncestorOf(focus) for d in bench.docks.values())


def test_system_save_dialog_is_not_modal(qtbot, window: MainWindow, tmp_path: Path) -> None:
    show(qtbot, window)
    asked: list[Path] = []
    SystemDialogs(window).save(str(tmp_path / "Dance.nepb"), asked.append)
    dialog = window.findChild(QFileDialog)
    assert dialog is not None
    qtbot.waitUntil(dialog.isVisible)
    assert not dialog.isModal()
    assert not dialog.testOption(QFileDialog.Option.DontUseNativeDialog)
    assert dialog.defaultSuffix() == "nepb"
    dialog.fileSelected.emit(str(tmp_path / "Dance.nepb"))
    assert asked == [tmp_path / "Dance.nepb"]
    dialog.close()


def test_last_layout_is_empty_for_the_start_page_and_for_a_blank_behaviour(
    window: MainWindow, commands: Commands
) -> None:
    assert last_layout(window) == "", "a first start"
    commands.run("layout.developer")
    assert last_layout(window) == "developer"
    commands.run("layout.behaviour")
    assert last_layout(window) == "", "no behaviour is open"
    window.session.document.apply_edit(
        {"blocks": {"languageVersion": 0, "blocks": [{"type": "x", "id": "a"}]}}
    )
    assert last_layout(window) == "behaviour"
    commands.run("file.start_page")
    assert last_layout(window) == "", "a person went to the start page"


def test_loading_layout_shows_its_bars_first_and_then_its_panels(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    show(qtbot, window)
    window.show_placeholder("behaviour")
    assert window.ring.target is None, "no ring round a page that is only words"
    placeholder = window.findChild(Placeholder)
    assert window.pages.currentWidget() is placeholder
    assert placeholder.accessibleName() == "Loading blocks…"
    assert not window.run_bar.isHidden()
    assert window.start.isHidden()
    commands.run("layout.behaviour")
    assert window.pages.currentWidget() is window.benches["behaviour"]
    assert window.benches["behaviour"].isAncestorOf(QApplication.focusWidget())


@pytest.mark.parametrize("kind", ["good", "bad", "none"])
def test_file_argument_is_opened_and_a_damaged_file_raises_an_alert(
    window: MainWindow, commands: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(window, "start_session", lambda: None)
    path = tmp_path / "Mine.nepb"
    path.write_text('{"format": "nep-behaviour", "version": 1, "workspace": {}}' if kind == "good" else "?")
    steps = show_first_page(window, Options((path,) if kind != "none" else ()))
    for step in steps:
        step()
    assert window.current_layout == ("behaviour" if kind == "good" else "start")
    assert len(list(window.session.alerts.active)) == (1 if kind == "bad" else 0)


def test_startup_shows_the_last_open_layout(
    window: MainWindow, commands: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window, "start_session", lambda: None)
    window.state.save_layout("developer")
    steps = show_first_page(window, Options())
    assert window.findChild(Placeholder).accessibleName() == "Loading panels…"
    for step in steps:
        step()
    assert window.current_layout == "developer"
    assert [step.__name__ for step in show_first_page(window, Options(opens_new_window=True))] == ["<lambda>"]


def test_first_start_offers_the_first_steps_and_the_second_start_does_not(
    window: MainWindow, commands: Commands, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window, "start_session", lambda: None)
    show_first_page(window, Options())
    assert window.start.offers_first_steps
    assert not Settings(home).are_new, "however this start ends"
    commands.run("help.first_steps")
    assert not window.start.offers_first_steps
    window.session.settings.are_new = Settings(home).are_new
    show_first_page(window, Options())
    assert not window.start.offers_first_steps


@pytest.mark.parametrize("instead", ["work of last time", "open work", "a file", "an earlier version"])
def test_first_steps_are_not_offered_with_existing_work_or_settings(
    window: MainWindow, commands: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, instead: str
) -> None:
    monkeypatch.setattr(window, "start_session", lambda: None)
    if instead == "work of last time":
        window.banner.offer("Put back?", "It was not saved.", ("Restore", bool), ("Cancel", bool))
    elif instead == "open work":
        window.session.document.apply_edit({"blocks": {"blocks": [{"type": "events_started"}]}})
    elif instead == "an earlier version":
        window.session.settings.are_new = False
    show_first_page(window, Options((tmp_path / "Mine.nepb",) if instead == "a file" else ()))
    assert not window.start.offers_first_steps


def test_demo_option_starts_the_demo_except_in_self_drive_mode(
    window: MainWindow, commands: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []
    monkeypatch.setattr(window, "start_session", lambda: None)
    monkeypatch.setattr(commands.behaviours, "start_demo", lambda: begun.append("demo"))
    for step in show_first_page(window, Options(starts_demo=True, self_drive=tmp_path)):
        step()
    assert begun == []
    for step in show_first_page(window, Options(starts_demo=True)):
        step()
    assert begun == ["demo"]


def test_preloaded_panels_are_created_once_and_used_by_their_layout(theme: Theme, session: Session) -> None:
    made: list[str] = []
    seen: dict[str, PlainPanel] = {}

    def make(name: str) -> Callable[[PanelContext], PlainPanel]:
        def one(context: PanelContext) -> PlainPanel:
            made.append(name)
            seen[name] = PlainPanel(context, name)
            return seen[name]

        return one

    counted = {name: replace(each, make=make(name)) for name, each in PANELS.items()}
    window = MainWindow(session, theme, counted)
    window.show_layout("behaviour")
    shown = len(made)
    for step in window.preload_steps():
        step()
    ahead = made[shown:]
    assert {"topics", "inspector"} <= set(ahead)
    window.show_layout("developer")
    assert made[shown:] == ahead, "none is made twice"
    docks = window.benches["developer"].docks
    assert docks["topics"].panel is seen["topics"]
    window.close()


def test_preloaded_panels_that_were_never_shown_are_closed_with_the_window(
    theme: Theme, session: Session
) -> None:
    panels: list[PlainPanel] = []

    def make(context: PanelContext) -> PlainPanel:
        panels.append(PlainPanel(context, "any"))
        return panels[-1]

    window = MainWindow(session, theme, {name: replace(each, make=make) for name, each in PANELS.items()})
    steps = window.preload_steps()
    for step in steps[:-1]:
        step()
    assert panels
    window.show()
    window.close()
    steps[-1]()
    assert all(each.closed for each in panels)
    assert window.state.layouts() == {}, "what nobody went to is not kept as if somebody had left it so"
