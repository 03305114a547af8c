"""Tests of the banner, which uses the free area of a bar without covering or moving other controls."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, QRect, Qt
from PySide6.QtGui import QEnterEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QWidget

from app.core.run.view import RunView
from app.intents import OpenDoctor, StopRobots
from app.ui.shell.bars.banner import CLICK_GUARD_S
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import STATUS_REFRESH_TICKS, MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]

SMALL = (960, 600)


class Mouse:
    """Fake mouse position and clock of the banner."""

    def __init__(self, window: MainWindow) -> None:
        self.window, self.now, self.at = window, 100.0, QPoint(0, 0)
        window.banner.mouse_at = lambda: self.at
        window.banner.clock = lambda: self.now

    def over(self, widget: QWidget) -> None:
        self.at = widget.mapToGlobal(widget.rect().center())
        self.window.tick()

    def under_it(self) -> QWidget | None:
        """Return the widget under the mouse, or None."""
        return self.window.childAt(self.window.mapFromGlobal(self.at))


@pytest.fixture
def mouse(qtbot, window: MainWindow, commands: Commands) -> Mouse:
    window.show()
    show(window, "developer")
    assert window.bench is not None
    topics = window.bench.docks["topics"]
    qtbot.waitUntil(topics.is_displayed)
    return Mouse(window)


def show(window: MainWindow, layout: str) -> None:
    if layout == "start":
        window.show_start()
    else:
        window.show_layout(layout)
    settle(window)


def say(window: MainWindow, name: str = "one", severity: str = "error") -> None:
    window.session.alerts.raise_alert(
        name, severity, f"It is {name}.", "Mend it.", button="Mend", intent=StopRobots()
    )
    settle(window)


def settle(window: MainWindow) -> None:
    for _ in range(STATUS_REFRESH_TICKS):  # nested layouts settle after several passes
        window.tick()
        QApplication.processEvents()


def place(window: MainWindow, widget: QWidget) -> QRect:
    return QRect(widget.mapTo(window, QPoint()), widget.size())


def places(window: MainWindow) -> dict[QWidget, QRect]:
    """Return the rectangle of each visible button and of the pages, except for the banner."""
    found = (*window.findChildren(QAbstractButton), window.pages)
    return {
        each: place(window, each)
        for each in found
        if each.isVisible() and not window.banner.isAncestorOf(each)
    }


@pytest.mark.parametrize("layout", ["start", "behaviour", "developer"])
@pytest.mark.parametrize("size", [(1280, 800), (1600, 1000), SMALL])
def test_banner_covers_no_control_and_moves_no_layout(
    window: MainWindow, mouse: Mouse, layout: str, size: tuple[int, int]
) -> None:
    window.resize(*size)
    show(window, layout)
    before = places(window)
    say(window)
    if (layout, size) == ("developer", SMALL):  # no room for a banner: shown in the status bar
        assert "1 alert" in window.status.texts()
        return
    assert window.banner.isVisible()
    assert places(window) == before
    banner = place(window, window.banner)
    assert window.rect().contains(banner)
    pages = {window.pages} if layout == "start" else set()
    assert not [each for each, rect in before.items() if rect.intersects(banner) and each not in pages]
    window.banner.banner.close_button.click()
    settle(window)
    assert not window.banner.isVisible()
    assert places(window) == before, "no strip is left"


def test_banner_is_above_the_heading_of_the_start_page(window: MainWindow, mouse: Mouse) -> None:
    show(window, "start")
    say(window)
    assert place(window, window.banner).bottom() <= place(window, window.start._question).top()


def test_text_next_to_the_banner_is_shortened_except_text_that_requires_action(
    window: MainWindow, mouse: Mouse
) -> None:
    show(window, "behaviour")
    bar = window.run_bar
    wide = bar.sentence.width()
    say(window)
    bar.sentence.show_text("Running", "It waits until a face is seen, which takes a while. " * 2)
    beside = window.banner.x() - bar.sentence.x()
    assert bar.sentence.width() == wide, "only the painting ends before the banner"
    assert beside < bar.sentence.full_width()
    title = "Pepper did not reply. Switch it off by hand."
    bar.show_view(RunView("unanswered", title, "It may still move, so look at it now.", title))
    QApplication.processEvents()
    assert bar.banner_area().x() >= bar.sentence.x() + bar.sentence.full_width()


def test_click_right_after_the_banner_appears_is_ignored(window: MainWindow, mouse: Mouse) -> None:
    mouse.at = window.middle.mapToGlobal(window.tool_bar.banner_area().center())
    say(window)
    assert not window.banner.isAncestorOf(mouse.under_it())  # type: ignore[arg-type]
    mouse.now += CLICK_GUARD_S
    window.tick()
    assert window.banner.isAncestorOf(mouse.under_it())  # type: ignore[arg-type]


def test_banner_is_not_replaced_while_under_the_mouse(window: MainWindow, mouse: Mouse) -> None:
    say(window, "mild", "warn")
    mouse.over(window.banner.banner)
    at = QPointF(20, 20)
    QApplication.sendEvent(window.banner.banner, QEnterEvent(at, at, at))
    say(window, "worse")
    assert window.banner.identity == "mild"
    assert window.banner.banner.more_button.accessibleName() == "and 1 more"
    QApplication.sendEvent(window.banner.banner, QEvent(QEvent.Type.Leave))
    mouse.over(window.tool_bar)
    assert window.banner.identity == "worse"


def test_banner_moves_to_the_bar_of_the_new_layout(window: MainWindow, mouse: Mouse) -> None:
    say(window)
    assert window.tool_bar.geometry().contains(window.banner.geometry())
    show(window, "behaviour")
    assert window.run_bar.geometry().contains(window.banner.geometry())


def test_button_in_a_narrow_banner_keeps_its_accessible_name(window: MainWindow, mouse: Mouse) -> None:
    button_text = "Open the connection doctor"
    window.session.alerts.raise_alert("one", "warn", "It is one.", button=button_text, intent=OpenDoctor())
    settle(window)
    button = window.banner.banner.button
    assert button.accessibleName() == "Open the connection doctor"
    assert "Open the connection doctor" in (button.text(), button.toolTip())


def test_unchanged_banner_is_not_repainted(window: MainWindow, mouse: Mouse) -> None:
    say(window)
    mouse.now += CLICK_GUARD_S
    settle(window)
    changed: list[QEvent.Type] = []

    class Listens(QObject):
        def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
            changed.append(event.type())
            return False

    listens = Listens()
    window.banner.installEventFilter(listens)
    for _ in range(10):
        window.tick()
        QApplication.processEvents()
    window.banner.removeEventFilter(listens)
    assert not {QEvent.Type.Paint, QEvent.Type.ZOrderChange, QEvent.Type.Resize} & set(changed)


def test_alert_for_developers_is_shown_in_the_developer_layout_only(window: MainWindow, mouse: Mouse) -> None:
    window.session.alerts.raise_alert("ports", "warn", "Port 7000 is taken.", for_developers=True)
    settle(window)
    assert window.banner.identity == "ports"
    for layout in ("behaviour", "start"):
        show(window, layout)
        assert window.banner.identity == ""
        assert not any("alert" in words for words in window.status.texts())
    show(window, "developer")
    assert window.banner.identity == "ports"


def test_alert_count_opens_the_alerts_by_mouse_and_keyboard(window: MainWindow, mouse: Mouse) -> None:
    show(window, "behaviour")
    say(window)
    (item,) = [each for each in window.status.items() if each.text == "1 alert"]
    assert item.focusPolicy() & Qt.FocusPolicy.TabFocus
    opened: list[str] = []
    window.open_panel = opened.append  # type: ignore[assignment,method-assign]
    QTest.mouseClick(item, Qt.MouseButton.LeftButton)
    QTest.keyClick(item, Qt.Key.Key_Return)
    assert opened == ["alerts", "alerts"]
    assert window.current_layout == "behaviour"


def test_shift_tab_from_the_banner_reaches_stop_and_the_alert_count(
    qtbot, window: MainWindow, mouse: Mouse
) -> None:
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    say(window)
    window.banner.banner.button.setFocus()
    names: list[str] = []
    while len(names) < 40 and "1 alert" not in names:
        focus = QApplication.focusWidget()
        assert focus is not None
        QTest.keyClick(focus, Qt.Key.Key_Backtab, Qt.KeyboardModifier.ShiftModifier)
        names.append(QApplication.focusWidget().accessibleName())  # type: ignore[union-attr]
    assert "Stop" in names
    assert names[-1] == "1 alert"
