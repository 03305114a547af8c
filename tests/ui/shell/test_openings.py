"""Tests that menus, sheets and dialogs leak no objects when they are opened and closed repeatedly."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QObject, QPoint, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QApplication, QLineEdit, QMenu, QPlainTextEdit, QPushButton, QWidget

from app.core.graph.walk import GraphSelection
from app.core.session import Session
from app.core.storage.settings import Settings
from app.intents import StopRobots
from app.robots import simulated
from app.robots.description.description import parse, thing_description
from app.ui.panels.build.behaviour.panel import BehaviourPanel
from app.ui.panels.registry import PanelRegistry
from app.ui.panels.table_panel import TablePanel
from app.ui.panels.watch.graph.panel import GraphPanel
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.docking.dock import Dock
from app.ui.shell.main_window import STATUS_REFRESH_TICKS, MainWindow
from app.ui.theme.theme import Theme
from tests.ui.panels.test_behaviour import Editor
from tests.ui.shell_parts import Answers, free_address

# on the offscreen platform, popups can't grab the keyboard
pytestmark = pytest.mark.qt_log_ignore("does not support grabbing the keyboard", extend=True)
pytest_plugins = ["tests.ui.shell_fixtures"]

TIMES = 4
PANELS = [
    "alarms", "alerts", "behaviour", "camera", "console", "doctor", "graph", "health", "image", "inspector",
    "nodes", "plot", "problems", "publish", "robot", "robots", "sensors", "services", "topics",
]  # fmt: skip
COMMANDS = [
    "file.earlier", "settings.open", "palette.open", "layout.keep", "help.shortcuts", "help.about",
    "network.others", "network.look", "network.web", "help.report",
]  # fmt: skip
REAL_PANELS = {**PanelRegistry()}
REAL_PANELS["behaviour"] = replace(
    REAL_PANELS["behaviour"], make=lambda context: BehaviourPanel(context, Editor)
)
ROBOTS = [parse(thing_description(simulated.ROBOT.thing_model, name)) for name in ("Pepper", "Anna")]


@pytest.fixture
def window(qtbot, theme: Theme, home: Path) -> Iterator[MainWindow]:
    session = Session(
        Settings(home), address=free_address(), journal_folder=home / "journal", start_processes=False
    )
    for robot in ROBOTS:
        session.fleet.connect(robot, f"/{robot.name}/description")
    made = MainWindow(session, theme, REAL_PANELS, dialogs=Answers())
    qtbot.addWidget(made)
    theme.apply()
    theme.set_motion(True)
    made.resize(1440, 900)
    yield made
    made.close()


def settle() -> None:
    QCoreApplication.processEvents()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    QCoreApplication.processEvents()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


def counted(window: QWidget) -> Counter[str]:
    """Return the number of objects per class: children of the window and other top-level widgets."""
    found: Counter[str] = Counter(type(each).__name__ for each in window.findChildren(QObject))
    found.update(type(each).__name__ for each in QApplication.topLevelWidgets() if each is not window)
    return found


def close_what_is_open(window: QWidget) -> None:
    for _ in range(10):
        popup = QApplication.activePopupWidget()
        if popup is None:
            break
        popup.close()
    # Not all children: searching a window's thousands of objects after each click took half of the time.
    for menu in [each for each in QApplication.topLevelWidgets() if isinstance(each, QMenu)]:
        if menu.isVisible():
            menu.close()
    direct = Qt.FindChildOption.FindDirectChildrenOnly
    for overlay in [each for each in window.findChildren(Overlay, options=direct) if each.isVisible()]:
        overlay.dismiss()


def leaked(window: QWidget, open_it: Callable[[], object], times: int = TIMES) -> Counter[str]:
    """Return the numbers of objects that opening and closing leaves in the window, by class."""
    for _ in range(2):  # warm-up: objects created once may remain
        open_it()
        settle()
        close_what_is_open(window)
        settle()
    before = counted(window)
    for _ in range(times):
        open_it()
        close_what_is_open(window)
        settle()
    return counted(window) - before


def leaves_nothing(window: QWidget, open_it: Callable[[], object], times: int = TIMES) -> None:
    assert leaked(window, open_it, times) == Counter()


def opened(window: MainWindow, panel: str) -> Dock:
    bench = window.show_layout("behaviour" if panel == "behaviour" else "developer")
    dock = bench.open(panel)
    assert dock is not None
    QCoreApplication.processEvents()
    window.tick()
    return dock


@pytest.mark.parametrize("panel", PANELS)
def test_reopening_every_menu_of_a_panel_leaks_no_objects(qtbot, window: MainWindow, panel: str) -> None:
    window.show()
    dock = opened(window, panel)
    shown: list[QMenu] = []

    def open_more() -> None:
        dock.title.menu_requested.emit(dock.title.more)
        shown.append(QApplication.activePopupWidget())  # type: ignore[arg-type]

    def open_the_others() -> None:
        for widget in dock.panel.findChildren(QWidget):
            if widget.isVisible() and isinstance(widget, (QLineEdit, QPlainTextEdit)):
                widget.customContextMenuRequested.emit(QPoint(3, 3))
            elif widget.isVisible():
                at = QPoint(3, 3)
                QApplication.sendEvent(
                    widget, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, widget.mapToGlobal(at))
                )
            close_what_is_open(window)

    leaves_nothing(window, open_more)
    assert isinstance(shown[0], QMenu), "more did open"
    leaves_nothing(window, open_the_others, times=2)


def test_reopening_title_menus_and_context_menus_leaks_no_objects(window: MainWindow) -> None:
    window.show()
    for panel in ("image", "robot", "console"):
        leaves_nothing(window, opened(window, panel).panel._show_menu)  # type: ignore[attr-defined]
    for panel, opener in (
        ("image", "_show_actions"),
        ("console", "_show_actions"),
        ("inspector", "_show_menu"),
    ):
        show_menu = getattr(opened(window, panel).panel, opener)
        leaves_nothing(window, lambda show_menu=show_menu: show_menu(QPoint(5, 5)))


def test_reopening_menus_of_rows_columns_and_edges_leaks_no_objects(window: MainWindow) -> None:
    window.show()
    for panel in ("nodes", "topics"):
        table = opened(window, panel).panel
        assert isinstance(table, TablePanel)
        leaves_nothing(window, lambda table=table: table._show_row_menu("/odom", QPoint(5, 5)))
        columns = table.table
        leaves_nothing(window, lambda columns=columns: columns._show_column_menu(QPoint(5, 5)))
    graph = opened(window, "graph").panel
    assert isinstance(graph, GraphPanel)
    leaves_nothing(window, lambda: graph._show_menu(GraphSelection("topic", "/blackboard"), QPoint(5, 5)))


def test_reopening_the_menus_and_submenus_of_the_menu_bar_leaks_no_objects(window: MainWindow) -> None:
    window.show()
    opened(window, "topics")

    def open_all() -> None:
        for action in window.bar.menus.actions():
            menu = action.menu()
            if isinstance(menu, QMenu):
                menu.popup(QPoint(10, 10))
                for entry in menu.actions():
                    inner = entry.menu()
                    if isinstance(inner, QMenu):
                        inner.popup(QPoint(30, 30))
            close_what_is_open(window)
        for button in window.tool_bar.findChildren(QPushButton):
            if button.isVisible() and not button.property("command"):
                button.click()
            close_what_is_open(window)

    leaves_nothing(window, open_all)


def test_reopening_sheets_and_dialogs_of_commands_leaks_no_objects(window: MainWindow) -> None:
    window.show()
    opened(window, "behaviour")
    left = {name: leaked(window, lambda name=name: window.commands.run(name)) for name in COMMANDS}
    assert left == {name: Counter() for name in COMMANDS}


def test_toasts_and_banners_leak_no_objects(window: MainWindow) -> None:
    window.show()
    opened(window, "topics")

    def say() -> None:
        window.toast.show_toast("Done", "Undo", lambda: None)
        window.session.alerts.raise_alert(
            "x", "error", "This is wrong.", "Mend it.", button="Stop", intent=StopRobots()
        )
        for _ in range(STATUS_REFRESH_TICKS):  # until the status bar shows the alerts, too
            window.tick()
        window.session.alerts.resolve("x")
        window.tick()

    leaves_nothing(window, say)


def test_opening_and_closing_layouts_and_panels_leaks_no_objects(qtbot, window: MainWindow) -> None:
    window.show()

    def go_round() -> None:
        for layout in ("behaviour", "developer"):
            bench = window.show_layout(layout)
            for name in ("camera", "console", "health"):
                dock = bench.open(name)
                assert dock is not None
                dock.setFloating(True)
                window.tick()
                dock.setFloating(False)
                dock.close()
        window.show_start()

    leaves_nothing(window, go_round, times=3)
