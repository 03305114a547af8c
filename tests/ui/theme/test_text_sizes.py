"""Tests that no text is clipped at sizes from 100 to 200 % and with texts that are a third longer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect
from PySide6.QtWidgets import QWidget

from app import resources
from app.core.run.view import RunView
from app.core.session import Session
from app.intents import ShowAlarms
from app.ui.panels.base import PanelContext
from app.ui.panels.robots.robots import panel as robots
from app.ui.shell.bars.status_bar import StatusBar
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.docking.dock import Dock
from app.ui.shell.main_window import MainWindow
from app.ui.shell.start_page.page import read_examples
from app.ui.theme.theme import Theme
from app.ui.widgets import StatusItem, StopButton
from tests.ui.clipping import clipped, lengthen, sideways
from tests.ui.fakes import Session as FakeSession
from tests.ui.shell_parts import PANELS, Answers
from tests.ui.show_panels import SIZES, shown_panel

pytest_plugins = ["tests.ui.shell_fixtures"]
SETTLE_MS = 20
VIEWS = (
    RunView("ready", "Ready", "Pepper and Turtle are connected", "Ready", can_run=True, can_step=True),
    RunView(
        "running",
        "Running, 14 s",
        "Pepper says “Touch my head.”",
        "Greeting runs, 14 s",
        can_pause=True,
        can_step=True,
        last_stop="all 2 robots stopped (41 ms)",
    ),
    RunView(
        "proven",
        "Stopped after 14 s",
        "It stopped at the dashed block",
        "",
        can_run=True,
        can_step=True,
        result="all 2 robots stopped (41 ms)",
        result_status="ok",
    ),
    RunView(
        "unanswered",
        "Turtle didn't reply",
        "Pepper stopped (38 ms). Switch Turtle off by hand.",
        "Turtle did not reply; switch it off by hand",
        stop_label="Stop again",
        result="1 of 2 robots stopped",
        result_status="error",
        confirm_label="Turtle isn't moving",
    ),
)
OVER = ("palette.open", "help.shortcuts", "settings.open", "layout.keep", "help.about", "file.earlier")


@pytest.fixture(scope="module", autouse=True)
def _text_as_before(qapp) -> Iterator[None]:
    yield
    Theme("light").apply()


def settle(qtbot, root, *, longer: bool) -> None:
    """Wait until the layouts are stable, with longer texts on request."""
    if longer:
        lengthen(root)
    before: list[QRect] = []

    def rests() -> bool:
        qtbot.wait(SETTLE_MS)
        last, before[:] = list(before), [each.geometry() for each in root.findChildren(QWidget)]
        return last == before

    qtbot.waitUntil(rests)


@pytest.mark.parametrize(
    ("full", "percent", "longer"),
    [
        (True, 100, False),
        pytest.param(True, 150, True, marks=pytest.mark.long),
        pytest.param(True, 200, False, marks=pytest.mark.long),
        (True, 200, True),
        pytest.param(False, 150, True, marks=pytest.mark.long),
        (False, 200, True),
    ],
)
def test_panels_clip_no_text(qtbot, theme: Theme, full: bool, percent: int, longer: bool) -> None:
    theme.set_text_percent(percent)
    faults = []
    for name in SIZES:
        if name == "behaviour":
            continue  # a web page; its bar is tested in test_behaviour_tabs
        session = FakeSession.full() if full else FakeSession()
        with shown_panel(qtbot, theme, name, session) as (dock, _widget):
            settle(qtbot, dock, longer=longer)
            faults += [f"{name}: {fault}" for fault in clipped(dock)]
    assert faults == []


@pytest.mark.parametrize("percent", [100, 150, 200])
@pytest.mark.parametrize("width", [384, 640])
def test_action_card_can_be_used_without_horizontal_scrolling_at_every_text_size(
    qtbot, theme: Theme, percent: int, width: int
) -> None:
    theme.set_text_percent(percent)
    session = FakeSession.full()
    panel = robots.PANEL
    widget = panel.make(PanelContext(session, theme, str, str, str, Answers()))  # type: ignore[arg-type]
    dock = Dock(theme, panel, widget, "comfortable")  # type: ignore[arg-type]
    qtbot.addWidget(dock)
    dock.resize(width, 600)
    with qtbot.waitExposed(dock):  # hidden panels aren't updated
        dock.show()
    dock.is_front = True
    qtbot.waitUntil(dock.is_displayed)
    session.tick()
    dock.refresh()
    assert isinstance(widget, robots.RobotsPanel)
    assert widget.cards
    for card in widget.cards.values():
        card.set_collapsed(False)
        card.form.more.setChecked(True)
    settle(qtbot, dock, longer=False)
    assert sideways(dock) == []
    assert clipped(dock) == []
    for card in widget.cards.values():
        assert card.try_button.mapTo(widget, card.try_button.rect().bottomRight()).x() < widget.width()
    widget.dispose()


@pytest.fixture
def whole(qtbot, session: Session, theme: Theme, tmp_path: Path) -> Iterator[tuple[MainWindow, Commands]]:
    """Main window with sample content for everything except the panels, and its commands."""
    file = tmp_path / "Story with emotions.nepb"
    file.write_text("{}", "utf-8")
    session.settings.add_recent(file)
    window = MainWindow(
        session, theme, PANELS, read_examples(resources.folder() / "examples"), dialogs=Answers()
    )
    qtbot.addWidget(window)
    theme.set_motion("on")
    yield window, window.commands
    window.close()


@pytest.mark.parametrize(
    ("size", "percent", "longer"),
    [
        ((1440, 900), 100, False),
        pytest.param((1440, 900), 200, True, marks=pytest.mark.long),
        pytest.param((1100, 700), 150, True, marks=pytest.mark.long),
        pytest.param((1100, 700), 200, False, marks=pytest.mark.long),
        ((1100, 700), 200, True),
        ((1024, 600), 100, False),
        ((1024, 600), 200, False),
    ],
)
def test_window_clips_no_text(
    qtbot,
    whole: tuple[MainWindow, Commands],
    size: tuple[int, int],
    percent: int,
    longer: bool,
) -> None:
    window, commands = whole
    window.theme.set_text_percent(percent)
    window.resize(*size)
    window.show()
    faults: list[str] = []

    def look(what: str, root=window) -> None:
        settle(qtbot, root, longer=longer)
        faults.extend(f"{what}: {fault}" for fault in clipped(root))

    window.tick()
    look("start page")
    alerts = window.session.alerts
    title, detail = "The camera of Pepper has sent nothing for 4 s.", "The behaviour waits for a face."
    alerts.raise_alert(
        "one", "error", title, detail, button="Open the connection doctor", intent=ShowAlarms()
    )
    alerts.raise_alert("two", "error", "Another one.", button="Look", intent=ShowAlarms())
    for layout, bar in (("behaviour", window.run_bar), ("developer", window.tool_bar)):
        commands.run(f"layout.{layout}")
        window.tick()
        window.toast.show_toast("Deleted the layout “Two cameras and a plot”", "Undo", lambda: None)
        for view in VIEWS:
            bar.show_view(view)
            look(f"{layout}, {view.state}")
    assert window.centralWidget().minimumSizeHint().width() <= window.width()
    for name in OVER:
        commands.run(name)
        shown = [each for each in window.findChildren(Overlay) if each.isVisible()]
        assert len(shown) == 1
        look(name, shown[0])
        for stop in window.findChildren(StopButton):
            body = QRect(stop.mapTo(window, QPoint()), stop.size())
            assert not stop.isVisible() or not body.intersects(shown[0].geometry()), f"{name} covers Stop"
        shown[0].dismiss()
    assert faults == []


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_visible_status_items_are_not_clipped_at_any_text_size(qtbot, theme: Theme, percent: int) -> None:
    theme.set_text_percent(percent)
    bar = StatusBar(theme)
    qtbot.addWidget(bar)
    bar.show()
    master = ("circle-check", "Master 127.0.0.1:7780", "ok")
    traffic = ("", "17 nodes, 113 topics, 1269 messages/s", None)
    lost = ("triangle-alert", "1200 lost in 30 s", "warn")
    bar.show_entries(
        (master, ("lock", "This computer only", None), traffic, lost), (("", "Window 13 ms", None),)
    )
    qtbot.wait(SETTLE_MS)
    bar.resize(1100, bar.sizeHint().height())
    qtbot.waitUntil(lambda: bar.width() == 1100 and clipped(bar) == [])
    assert all(item.width() >= 40 for item in bar.findChildren(StatusItem) if item.isVisible())
