"""Tests of runs, alarms and bookmarks in the timeline: clicks, renaming and deletion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu

from app.core.recording.replay.replay import Replay
from app.core.session import Session
from app.ui.intents import OpenRecording
from app.ui.panels.base import Panel, PanelWidget
from app.ui.panels.home import RowHome
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.timeline.layers import PaintedMark
from app.ui.timeline.view import TimelineView
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import START_NS, STEP_NS, TestClock, json_message, limits
from tests.ui.shell_parts import Answers
from tests.ui.test_accessible import unsaid

pytest_plugins = ["tests.ui.shell_fixtures"]
pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)

COUNT = 100
HOME = (RowHome("behaviour", 0, 0, 626),)
BLOCKS = Panel(
    "behaviour", "Behaviour", "blocks", (), lambda context: PanelWidget(context, "Behaviour"), home=HOME
)


def at(step: int) -> int:
    return START_NS + step * STEP_NS


def run(name: str, since: int, until: int, result: str, words: str = "") -> dict[str, object]:
    return {
        "id": name, "name": name, "since_ns": at(since), "until_ns": at(until), "result": result,
        "words": words,
    }  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    """Recording of one second of /odom with a note, two runs and an alarm for the topic."""
    path = tmp_path_factory.mktemp("recordings") / "Tour.mcap"
    alarm = {
        "id": "a", "name": "/odom has been silent", "since_ns": at(60), "until_ns": at(70),
        "severity": "error", "topic": "/odom",
    }  # fmt: skip
    said = [
        ("runs", run("Greeting", 10, 40, "stopped", "Stop, 41 ms")),
        ("runs", run("Tour guide", 55, 90, "failed", "wave failed")),
        ("alarms", alarm),
    ]
    with RecordingWriter(path, clock=TestClock(), limits=limits(stats_interval_s=1e6)) as writer:
        for number in range(COUNT):
            if number == 5:
                writer.write_entry("notes", {"text": "it fell"})
            writer.post([json_message(number)])
        for role, value in said:
            writer.write_entry(role, value)
    return path


@pytest.fixture
def window(qtbot, theme: Theme, session: Session, answers: Answers) -> Iterator[MainWindow]:
    made = MainWindow(session, theme, {**PanelRegistry(), "behaviour": BLOCKS}, [], dialogs=answers)
    qtbot.addWidget(made)
    theme.apply()
    made.resize(1440, 900)
    made.show()
    yield made
    made.close()


def until(qtbot, window: MainWindow, true: Callable[[], object]) -> None:
    """Tick the window until a condition holds."""

    def tick() -> bool:
        window.tick()
        return bool(true())

    qtbot.waitUntil(tick, timeout=60_000)


class Shown:
    """Recording opened in the main window with its complete timeline."""

    def __init__(self, qtbot, window: MainWindow, path: Path) -> None:
        self.qtbot, self.window = qtbot, window
        window.commands.request(OpenRecording(path))
        replay = window.session.replay
        assert replay is not None
        self.replay: Replay = replay
        self.wait(lambda: replay.densities is not None and replay.densities.spans.alarms)
        assert window.bench is not None
        self.panel = window.bench.docks["timeline"].panel
        self.canvas: TimelineView = self.panel.canvas

    def wait(self, true: Callable[[], object]) -> None:
        until(self.qtbot, self.window, true)

    def place(self, words: str) -> QPoint:
        """Return a clickable position on the mark whose text contains the words."""

        def found() -> list[PaintedMark]:
            self.canvas.grab()
            return [each for each in self.canvas.marks if words in each.mark.tooltip]

        self.wait(lambda: len(found()) == 1)
        (mark,) = found()
        seen = mark.box.toRect().intersected(self.canvas.viewport().rect())
        return QPoint(seen.left() + 4, seen.center().y())

    def press(self, words: str) -> None:
        QTest.mouseClick(self.canvas.viewport(), Qt.MouseButton.LeftButton, pos=self.place(words))

    def names(self) -> list[str]:
        return [mark.name for mark in self.replay.bookmarks if not mark.is_note]

    def type_name(self, name: str) -> None:
        field = self.canvas.field
        assert field is not None
        assert not unsaid(field)
        field.selectAll()
        QTest.keyClicks(field, name)
        QTest.keyClick(field, Qt.Key.Key_Return)
        assert self.canvas.field is None


@pytest.fixture
def shown(qtbot, window, path) -> Iterator[Shown]:
    made = Shown(qtbot, window, path)
    yield made
    for mark in [each for each in made.replay.bookmarks if not each.is_note]:
        made.replay.remove_bookmark(mark)


def test_click_seeks_to_a_run_or_alarm_and_both_are_marked(shown):
    canvas = shown.canvas

    def colours(step: int, middle: float) -> list[str]:
        """Return the colours of the pixel column at a time step, from 10 px above to 10 px below."""
        seen, ratio = canvas.viewport().grab().toImage(), canvas.devicePixelRatioF()
        x = round(canvas.x_of(at(step)) * ratio)
        return [seen.pixelColor(x, round((middle + offset) * ratio)).name() for offset in range(-10, 11)]

    running = canvas._theme.colour("running").name()
    line = float(shown.place("Stop, 41 ms").y())
    assert running not in colours(36, line)
    for words, step in (
        ("Tour guide: wave failed", 55), ("/odom has been silent, 0.1 s", 60), ("Stop, 41 ms", 10),
    ):  # fmt: skip
        shown.press(words)
        shown.wait(lambda step=step: shown.replay.player.position_ns == at(step))
    shown.wait(lambda: running in colours(36, line))
    assert canvas._theme.colour("error").name() in colours(
        65, canvas.geometry_of_lanes().lane_rect(0).center().y()
    )
    for key, step in ((Qt.Key.Key_Right, 55), (Qt.Key.Key_Left, 10)):
        QTest.keyClick(canvas, key, Qt.KeyboardModifier.ControlModifier)
        shown.wait(lambda step=step: shown.replay.player.position_ns == at(step))


def test_bookmarks_are_renamed_and_deleted_with_undo_and_notes_are_kept(shown, window, monkeypatch):
    shown.replay.seek(at(80))
    shown.wait(lambda: shown.replay.player.position_ns == at(80))
    QTest.keyClick(shown.canvas, Qt.Key.Key_F2)
    assert shown.canvas.field is None
    assert "No bookmark at the playhead" in window.toast.text
    QTest.keyClick(shown.canvas, Qt.Key.Key_B)
    QTest.keyClick(shown.canvas, Qt.Key.Key_F2)
    shown.type_name("Aiko comes in")
    assert shown.names() == ["Aiko comes in"]
    QTest.mouseDClick(shown.canvas.viewport(), Qt.MouseButton.LeftButton, pos=shown.place("Aiko comes in"))
    shown.type_name("Aiko")
    assert shown.names() == ["Aiko"]
    QTest.keyClick(shown.canvas, Qt.Key.Key_Delete)
    assert shown.names() == []
    assert "“Aiko”" in window.toast.text
    window.toast.button.click()
    assert shown.names() == ["Aiko"]
    seen: list[list[str]] = []
    monkeypatch.setattr(QMenu, "popup", lambda menu, _at: seen.append([a.text() for a in menu.actions()]))
    place = shown.place("it fell")
    there = shown.canvas.viewport().mapToGlobal(place)
    QApplication.sendEvent(
        shown.canvas.viewport(), QContextMenuEvent(QContextMenuEvent.Reason.Mouse, place, there)
    )
    assert seen == [["Rename", "Delete"]]
    (note,) = [mark for mark in shown.replay.bookmarks if mark.is_note]
    shown.panel.delete_bookmark(note)
    shown.panel.rename_bookmark(note)
    assert shown.canvas.field is None
    assert note in shown.replay.bookmarks
    assert "are part of the file" in window.toast.text
