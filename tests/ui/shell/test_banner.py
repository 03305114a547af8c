"""A banner never moves what is under the mouse: a click that was aimed at something lands there."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, Qt
from PySide6.QtGui import QCursor, QEnterEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.ui.shell.bars.banner import FRESH_S
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


class Mouse:
    """Where the mouse is, and what time it is."""

    def __init__(self, window: MainWindow) -> None:
        self.window, self.now, self.at = window, 100.0, QPoint(0, 0)
        window.room.mouse_at = lambda: self.at
        window.room.clock = lambda: self.now

    def over(self, widget: QWidget, down: int | None = None) -> None:
        middle = widget.rect().center()
        self.at = widget.mapToGlobal(QPoint(middle.x(), middle.y() if down is None else down))
        self.window.tick()

    def under_it(self) -> QWidget | None:
        """What a press would meet."""
        return self.window.childAt(self.window.mapFromGlobal(self.at))


@pytest.fixture
def mouse(qtbot, window: MainWindow, commands: Commands) -> Mouse:
    window.show()
    window.show_layout("developer")
    qtbot.waitUntil(lambda: window.bench is not None and window.bench.docks["topics"].shown())
    QApplication.processEvents()
    return Mouse(window)


def places(window: MainWindow) -> dict[str, QPoint]:
    assert window.bench is not None
    return {name: dock.mapToGlobal(QPoint()) for name, dock in window.bench.docks.items() if dock.shown()}


def say(window: MainWindow, name: str = "one", severity: str = "error") -> None:
    window.session.alerts.put(name, severity, f"It is {name}.", "Mend it.", button="Mend", action="run.stop")
    settle(window)


def settle(window: MainWindow) -> None:
    for _ in range(5):  # Qt lays out what lies in what was laid out
        window.tick()
        QApplication.processEvents()


def test_pages_stay_while_the_mouse_is_over_them_and_make_room_when_it_has_left(
    qtbot, window: MainWindow, mouse: Mouse
) -> None:
    assert window.bench is not None
    topics = window.bench.docks["topics"].panel
    mouse.over(topics)
    before, under = places(window), mouse.under_it()
    say(window)
    assert window.banner.isVisible()
    assert (places(window), mouse.under_it()) == (before, under)
    assert window.room.height() == 0
    assert window.banner.geometry().top() == window.pages.geometry().top(), "it lies over them"
    for widget in (window.tool_bar, topics):
        mouse.over(widget)
        QApplication.processEvents()
    after = places(window)
    assert after["topics"].y() - before["topics"].y() == window.room.height() > 50, "the mouse was away"
    assert window.banner.geometry().bottom() < window.pages.geometry().top()
    window.session.alerts.resolve("one")
    window.tick()
    QApplication.processEvents()
    assert not window.banner.isVisible()
    assert places(window) == after, "nothing comes under the mouse where the banner was"
    mouse.over(window.tool_bar)
    qtbot.waitUntil(lambda: places(window) == before)


def test_what_is_under_the_real_mouse_stays_where_it_is(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.show()
    window.show_layout("developer")
    qtbot.waitUntil(lambda: window.bench is not None and window.bench.docks["topics"].isVisible())
    assert window.bench is not None
    topics = window.bench.docks["topics"]
    QApplication.processEvents()
    QCursor.setPos(topics.mapToGlobal(topics.rect().center()))
    before = topics.mapToGlobal(QPoint())
    say(window)
    assert window.banner.isVisible()
    assert topics.mapToGlobal(QPoint()) == before


def test_it_comes_below_where_the_mouse_is_at_its_place(window: MainWindow, mouse: Mouse) -> None:
    mouse.over(window.pages, down=20)
    before, under = places(window), mouse.under_it()
    say(window)
    assert (places(window), mouse.under_it()) == (before, under)
    assert window.banner.geometry().bottom() == window.pages.geometry().bottom()
    mouse.over(window.tool_bar)
    QApplication.processEvents()
    assert window.banner.geometry().top() == window.room.y()
    assert window.room.height() == window.banner.height() > 50


def test_it_leaves_the_lower_edge_when_the_mouse_leaves_the_upper_one(
    window: MainWindow, mouse: Mouse
) -> None:
    """What it covers down there, such as the newest line of the Console, is wanted again."""
    mouse.over(window.pages, down=20)
    before = places(window)
    say(window)
    low = window.banner.geometry()
    assert low.bottom() == window.pages.geometry().bottom()
    mouse.over(window.pages, down=window.pages.height() - 20)
    assert window.banner.geometry() == low, "the mouse went straight to it"
    mouse.over(window.pages, down=20)
    assert window.banner.geometry() == low
    mouse.over(window.pages)
    assert window.banner.geometry().top() == window.pages.geometry().top()
    assert places(window) == before
    mouse.over(window.pages, down=20)
    QApplication.processEvents()
    assert window.room.height() == window.banner.height(), "what it covers up there is below it then"


def test_going_to_what_it_covers_makes_room_while_the_mouse_is_on_it(
    window: MainWindow, mouse: Mouse
) -> None:
    assert window.bench is not None
    mouse.over(window.bench.docks["topics"].panel)
    say(window)
    before = window.banner.geometry()
    mouse.over(window.banner.banner)
    QApplication.processEvents()
    assert window.room.height() == before.height()
    assert window.banner.geometry() == before, "the banner itself stays under the mouse"


def test_a_press_just_when_it_came_goes_to_what_was_there(window: MainWindow, mouse: Mouse) -> None:
    assert window.bench is not None
    mouse.over(window.bench.docks["topics"].panel)
    covered = window.pages.mapToGlobal(QPoint(120, 20))
    mouse_was, mouse.at = mouse.at, covered
    under = mouse.under_it()
    mouse.at = mouse_was
    say(window)
    mouse.at = covered  # on its way to a button that was there, and pressed at once
    assert mouse.under_it() is under
    mouse.now += FRESH_S
    window.tick()
    assert mouse.under_it() is not under
    assert window.banner.isAncestorOf(mouse.under_it())  # type: ignore[arg-type]


def test_its_button_does_not_become_another_one_under_the_mouse(window: MainWindow, mouse: Mouse) -> None:
    say(window, "mild", "warn")
    mouse.over(window.banner.banner)
    at = QPointF(20, 20)
    QApplication.sendEvent(window.banner.banner, QEnterEvent(at, at, at))
    say(window, "worse")
    assert window.banner.identity == "mild"
    assert window.banner.banner.more.text() == "and 1 more"
    QApplication.sendEvent(window.banner.banner, QEvent(QEvent.Type.Leave))
    mouse.over(window.tool_bar)
    assert window.banner.identity == "worse"


def test_nothing_moves_while_a_button_is_held(window: MainWindow, mouse: Mouse) -> None:
    mouse.over(window.tool_bar)
    held = window.pages
    before = places(window)
    QTest.mousePress(held, Qt.MouseButton.LeftButton)
    if QApplication.mouseButtons():  # a slider that is drawn, a line between panels
        say(window)
        assert places(window) == before
    QTest.mouseRelease(held, Qt.MouseButton.LeftButton)
    say(window, "again")
    assert window.room.height() > 0


def test_it_keeps_to_the_window_when_that_changes(window: MainWindow, mouse: Mouse) -> None:
    assert window.bench is not None
    mouse.over(window.bench.docks["topics"].panel)
    say(window)
    window.resize(1200, 760)
    QApplication.processEvents()
    window.tick()
    assert window.banner.width() == window.pages.width()
    assert window.banner.geometry().top() == window.pages.geometry().top()
    window.show_layout("behaviour")
    QApplication.processEvents()
    window.tick()
    assert window.banner.geometry().top() >= window.run_bar.geometry().bottom()


def test_a_banner_that_stands_there_is_not_painted_again(window: MainWindow, mouse: Mouse) -> None:
    mouse.over(window.tool_bar)
    say(window)
    mouse.now += FRESH_S
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


def test_longer_words_of_the_same_alert_move_nothing_either(qtbot, window: MainWindow, mouse: Mouse) -> None:
    assert window.bench is not None
    mouse.over(window.tool_bar)
    say(window)
    mouse.over(window.bench.docks["topics"].panel)
    before, low = places(window), window.banner.height()
    window.session.alerts.put("one", "error", "It is one. " * 60, "Mend it.")
    window.tick()
    qtbot.waitUntil(lambda: window.banner.height() > low)
    assert places(window) == before
    mouse.over(window.tool_bar)
    QApplication.processEvents()
    assert window.room.height() == window.banner.height()


def test_on_the_start_page_it_covers_no_words_though_the_mouse_is_over_the_page(
    window: MainWindow, mouse: Mouse
) -> None:
    window.show_start()
    settle(window)
    mouse.over(window.start)
    question = window.start._question
    before = question.mapTo(window, QPoint())
    say(window)
    assert window.banner.isVisible()
    assert question.mapTo(window, QPoint()) == before, "nothing moved"
    assert window.banner.banner.mapTo(window, QPoint(0, window.banner.banner.height())).y() <= before.y()
