"""Tests of accessibility: names and roles of focusable widgets, tab order and announcements."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAccessible
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.core.run.view import RunView
from app.ui.shell.bars.run_bar import RunBar
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from tests.ui.fakes import Session as FakeSession
from tests.ui.show_panels import SIZES, shown_panel

pytest_plugins = ["tests.ui.shell_fixtures"]
MEANINGLESS = {QAccessible.Role.NoRole, QAccessible.Role.Whitespace}  # Client: our painted widgets
OVER = (
    "palette.open",
    "help.shortcuts",
    "settings.open",
    "layout.keep",
    "help.about",
    "file.earlier",
    "help.report",
)


def stops(root: QWidget) -> Iterator[QWidget]:
    """Return the widgets that Tab can reach."""
    for widget in [root, *root.findChildren(QWidget)]:
        takes = bool(widget.focusPolicy() & Qt.FocusPolicy.TabFocus)
        if takes and widget.isVisibleTo(root) and widget.isEnabled() and widget.focusProxy() is None:
            yield widget


def unsaid(root: QWidget) -> list[str]:
    """Return descriptions of the focusable widgets without an accessible name or role."""
    faults = []
    for widget in stops(root):
        spoken = QAccessible.queryAccessibleInterface(widget)
        where = widget.mapTo(root, QPoint(0, 0)) if widget is not root else QPoint()
        told = f"{type(widget).__name__} at {where.x()},{where.y()} in {_above(widget)}"
        if spoken is None or not spoken.text(QAccessible.Text.Name).strip():
            faults.append(f"{told} has no name")
        elif spoken.role() in MEANINGLESS:
            faults.append(f"{told} has no role")
    return faults


def _above(widget: QWidget) -> str:
    parent = widget.parentWidget()
    return type(parent).__name__ if parent is not None else ""


@pytest.mark.parametrize("name", [name for name in SIZES if name != "behaviour"])
@pytest.mark.parametrize("full", [True, False], ids=["full", "empty"])
def test_every_control_in_a_panel_has_an_accessible_name(qtbot, theme: Theme, name: str, full: bool) -> None:
    session = FakeSession.full() if full else FakeSession()
    with shown_panel(qtbot, theme, name, session) as (dock, _widget):
        assert list(stops(dock))
        assert unsaid(dock) == []


def test_every_control_in_the_window_has_an_accessible_name(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.theme.set_motion("on")
    window.show()
    window.tick()
    faults = unsaid(window)
    for layout in ("behaviour", "developer"):
        commands.run(f"layout.{layout}")
        window.tick()
        for bar in (window.bar, window.run_bar, window.tool_bar, window.status):
            faults += unsaid(bar)
        for dock in window.benches[layout].docks.values():
            faults += unsaid(dock.title)
    for name in OVER:
        commands.run(name)
        shown = next(each for each in window.findChildren(Overlay) if each.isVisible())
        faults += unsaid(shown)
        shown.dismiss()
    assert faults == []


def reached(window: MainWindow, forward: bool = True) -> list[QWidget]:
    """Return the widgets in tab order, from the focused one until the order repeats."""
    seen: list[QWidget] = []
    for _ in range(200):
        focus = QApplication.focusWidget()
        assert focus is not None
        if focus in seen:
            return seen
        seen.append(focus)
        QTest.keyClick(focus, Qt.Key.Key_Tab if forward else Qt.Key.Key_Backtab)
    raise AssertionError("Tab never comes back")


@pytest.mark.parametrize("layout", ["behaviour", "developer"])
def test_tab_reaches_every_panel_and_the_bars_in_both_directions(
    qtbot, window: MainWindow, commands: Commands, layout: str
) -> None:
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run(f"layout.{layout}")
    window.tick()
    seen = reached(window)
    bench = window.benches[layout]
    for dock in bench.docks.values():
        if dock.is_displayed():
            assert any(dock.isAncestorOf(each) for each in seen), dock.description.name
    bar = window.run_bar if layout == "behaviour" else window.tool_bar
    assert bar.stop in seen
    assert bar.run in seen
    assert window.bar.search in seen
    assert set(reached(window, forward=False)) == set(seen)


def test_f6_visits_panels_in_reading_order(qtbot, window: MainWindow, commands: Commands) -> None:
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("layout.developer")
    qtbot.waitUntil(window.benches["developer"].docks["console"].is_displayed)
    order = []
    for _ in range(4):
        QTest.keyClick(window, Qt.Key.Key_F6)
        dock = window.panel_focus.focused_dock()
        assert dock is not None
        order.append(dock.mapTo(window, QPoint(0, 0)))
    start = order.index(min(order, key=lambda place: (place.x(), place.y())))
    turned = order[start:] + order[:start]
    assert turned == sorted(turned, key=lambda place: (place.x(), place.y()))


# -- announcements --------------------------------------------------------------------------------


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Announcements to a screen reader, which is faked."""
    heard: list[str] = []
    monkeypatch.setattr(QAccessible, "isActive", lambda: True)
    monkeypatch.setattr(QAccessible, "updateAccessibility", lambda event: heard.append(event.message()))
    return heard


def test_alert_is_announced_once(qtbot, window: MainWindow, commands: Commands, said: list[str]) -> None:
    window.show()
    commands.run("layout.behaviour")
    window.session.alerts.raise_alert("camera", "error", "The camera is silent.", "No pictures come.")
    for _ in range(3):
        window.tick()
    assert said == ["The camera is silent. No pictures come."]


def test_alert_with_an_increased_count_is_not_announced_again(
    qtbot, window, commands: Commands, said: list[str]
) -> None:
    alerts = window.session.alerts
    window.show()
    commands.run("layout.behaviour")
    for count in (1, 2, 12):
        alerts.raise_alert("message:/bad", "warn", f"{count} messages can't be decoded.")
        window.tick()
    assert said == ["1 messages can't be decoded."]
    alerts.resolve("message:/bad")
    alerts.raise_alert("silent:/cam", "warn", "The camera has been silent for 4 s.")
    window.tick()
    assert said[1:] == ["The camera has been silent for 4 s."]


def test_stop_result_is_announced_once_and_running_times_are_not(
    qtbot, theme: Theme, said: list[str]
) -> None:
    bar = RunBar(theme)
    qtbot.addWidget(bar)
    bar.show()
    bar.show_view(RunView("running", "Running, 1 s", "", "", can_pause=True))
    bar.show_view(RunView("running", "Running, 2 s", "", "", can_pause=True))
    bar.show_view(RunView("stopping", "Stopping", "", "", result="1 of 2 robots stopped"))
    proven = RunView("proven", "Stopped", "", "", result="all 2 robots stopped (41 ms)", result_status="ok")
    bar.show_view(proven)
    bar.show_view(proven)
    assert said == ["all 2 robots stopped (41 ms)"]


def test_toast_is_announced(qtbot, window: MainWindow, said: list[str]) -> None:
    window.show()
    window.toast.show_toast("Copied robots.Pepper.pose.y")
    assert said == ["Copied robots.Pepper.pose.y"]
