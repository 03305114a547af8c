"""Tests of recording in the main window: shortcuts, toolbar, status bar and recording sheet."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.core.recording.client import RecorderEvent
from app.core.recording.recordings import SessionRecordings
from app.core.recording.topic_choice import RecordingChoice, RingSettings
from app.ui.intents import OpenRecording, RecordTopic
from app.ui.shell.dialogs.record import RecordSheet
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from tests.core.recording.test_client import OrdersOnly, status
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.panels.test_words import said_by
from tests.ui.shell_parts import PANELS, Answers
from tests.ui.test_accessible import unsaid

pytest_plugins = ["tests.ui.shell_fixtures"]
pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)


class Recorder:
    """Fake recorder process that records orders and sends the reports given by a test."""

    def __init__(self, session: Session) -> None:
        self.line, self.session = OrdersOnly(), session
        session.recordings = SessionRecordings(
            session.settings, session.alerts, session.address, print,
            start=self._start, clock=session.clock,
        )  # fmt: skip
        session.update_parts()

    def _start(self, _number: int, _address: str, _post: Callable[[object], object]) -> OrdersOnly:
        return self.line

    def ops(self) -> list[object]:
        return [order["op"] for order in self.line.orders]

    def say(self, event: str, **content: object) -> None:
        self.session.recordings.on_event(RecorderEvent(1, {"event": event, **content}))


@pytest.fixture
def recorder(home: Path) -> Recorder:
    return Recorder(Session.full())


@pytest.fixture
def window(qtbot, theme: Theme, recorder: Recorder) -> MainWindow:
    made = MainWindow(recorder.session, theme, PANELS, [], dialogs=Answers())
    qtbot.addWidget(made)
    theme.apply()
    theme.set_motion("on")
    made.resize(1440, 900)
    made.show()
    made.commands.run("layout.developer")
    yield made
    made.close()


def sheet_of(window: MainWindow) -> RecordSheet:
    (sheet,) = window.findChildren(RecordSheet)
    sheet.show_state()
    return sheet


def shown(window: MainWindow) -> str:
    window.tools.refresh()
    window._update_status_bar()
    return window.tools.record.text()


def test_shortcut_starts_and_stops_recording_and_the_bars_show_the_recording(window, recorder):
    assert window.commands.shortcuts.first_shortcut("recording.toggle") == "Ctrl+R"
    assert window.commands.shortcuts.first_shortcut("recording.keep") == "F9"
    assert shown(window) == "Record"
    wide = window.tools.record.width()
    window.commands.run("recording.toggle")
    recorder.say("recording")
    recorder.session.clock.now += 42.0
    recorder.say("figures", recording=status(size_bytes=168_000_000), ring=None, free_bytes=10**12)
    assert shown(window) == "0:42, 168 MB"
    assert window.tools.record.width() == wide
    assert "Recording 0:42, 168 MB, 2 lost" in window.status.texts()
    assert window.commands.actions.disabled_reason("recording.stop") == ""
    window.commands.run("layout.behaviour")
    window._update_status_bar()
    assert any(words.startswith("Recording 0:42") for words in window.status.texts())
    window.commands.run("recording.toggle")
    recorder.say("ended", status=status(duration_s=42.0, size_bytes=168_000_000))
    assert recorder.ops() == ["record", "stop"]
    assert shown(window) == "Record"
    assert not any(words.startswith("Recording") for words in window.status.texts())
    assert window.commands.actions.disabled_reason("recording.stop") == "Not recording"
    assert ": 0:42, 168 MB" in window.toast.accessibleName()


def test_button_starts_recording_and_opens_the_recording_sheet(window, recorder):
    window.tools.record.click()
    sheet = sheet_of(window)
    assert sheet.isVisible()
    recorder.say("recording")
    sheet.show_state()
    assert sheet.record.text() == "Stop recording"
    assert not sheet.name.isEnabled()
    sheet.bookmark.click()
    sheet.record.click()
    assert recorder.ops() == ["record", "note", "stop"]
    recorder.say("ended", status=status())
    sheet.show_state()
    assert sheet.record.text() == "Record"
    QTest.keyClick(sheet, Qt.Key.Key_Escape)
    assert not sheet.isVisible()


def test_only_selected_topics_are_recorded(window, recorder):
    session = recorder.session
    window.commands.run("recording.sheet")
    sheet = sheet_of(window)
    names = sorted(topic.name for topic in session.shown.topics.existing_topics())
    assert sheet.count.text().startswith(f"{len(names)} of {len(names)}")
    sheet._set_mode("chosen")
    assert session.recordings.choice.topics == tuple(names)
    sheet._toggle_topic("/odom")
    assert sheet.count.text().startswith(f"{len(names) - 1} of {len(names)}")
    place = sheet.model.index_of("/odom").row()
    assert [sheet.model.cell_at(place, column).accessible_text for column in (0,)] == ["excluded"]
    sheet._set_mode("pattern")
    QTest.keyClicks(sheet.patterns.edit, "/** not /odom")
    assert session.recordings.choice.excluded == ("/odom",)
    sheet.note.setText("second try")
    sheet.record.click()
    (order,) = recorder.line.orders
    assert (order["topics"], order["left_out"], order["note"]) == (["/**"], ["/odom"], "second try")


def test_invalid_topic_pattern_is_reported_and_not_recorded(window, recorder):
    window.commands.run("recording.sheet")
    sheet = sheet_of(window)
    sheet._set_mode("pattern")
    sheet.patterns.show_patterns(("/a\x01",), ())
    sheet.patterns.changed.emit()
    assert sheet.pattern_error.isVisible()
    sheet.record.click()
    assert recorder.ops() == []
    sheet.patterns.show_patterns(("/a",), ())
    sheet.patterns.changed.emit()
    assert not sheet.pattern_error.isVisible()


def test_topic_patterns_are_tokens_added_and_removed_by_keyboard(window, recorder):
    window.commands.run("recording.sheet")
    sheet = sheet_of(window)
    sheet._set_mode("pattern")
    field = sheet.patterns

    def tokens() -> list[tuple[str, bool]]:
        return [(each.entry, each.is_excluded) for each in field.tokens]

    QTest.keyClicks(field.edit, "/arm/* *camera*,not /arm/raw")
    assert tokens() == [("/arm/*", False), ("*camera*", False)]
    QTest.keyClick(field.edit, Qt.Key.Key_Return)
    assert tokens() == [("/arm/*", False), ("*camera*", False), ("/arm/raw", True)]
    QTest.keyClicks(field.edit, "/arm/* ")  # already in the list
    assert field.edit.text() == ""
    choice = recorder.session.recordings.choice
    assert (choice.patterns, choice.excluded) == (("/arm/*", "*camera*"), ("/arm/raw",))
    QTest.keyClick(field.edit, Qt.Key.Key_Backspace)
    assert len(tokens()) == 2
    QTest.mouseClick(field.tokens[0], Qt.MouseButton.LeftButton)
    assert tokens() == [("*camera*", False)]
    QTest.keyClick(field.tokens[0], Qt.Key.Key_Delete)
    assert (tokens(), recorder.session.recordings.choice.patterns) == ([], ())
    assert not list(unsaid(field))


def test_recording_stops_at_the_selected_limit_and_its_size_is_estimated(window, recorder):
    window.commands.run("recording.sheet")
    sheet = sheet_of(window)
    assert sheet.limits_hint.text() == "no limit"
    for field, text in ((sheet.limit_minutes, "30"), (sheet.limit_gb, "8")):
        field.setText(text)
        field.editingFinished.emit()
    assert sheet.limits_hint.text() == "whichever comes first"
    choice = recorder.session.recordings.choice
    assert (choice.max_minutes, choice.max_gb) == (30.0, 8.0)
    sheet.limit_minutes.setText("-1")
    sheet.limit_minutes.editingFinished.emit()
    assert sheet.limits_hint.text() == "The minimum is 0.1 min."
    sheet.limit_minutes.setText("30")
    sheet.limit_minutes.editingFinished.emit()
    assert not sheet.expected_size.isVisible()
    sheet.record.click()
    assert (recorder.line.orders[0]["seconds"], recorder.line.orders[0]["size_bytes"]) == (1800.0, 8 * 10**9)
    recorder.say("recording")
    for size in (0, 4_000_000):
        recorder.say("figures", recording=status(size_bytes=size), ring=None, free_bytes=10**12)
        sheet.show_state()
        recorder.session.clock.now += 1.0
    assert sheet.expected_size.isVisible() == (sheet._write_bandwidth_Bps is not None)
    recorder.session.clock.now += 1.0
    recorder.say("figures", recording=status(size_bytes=12_000_000), ring=None, free_bytes=10**12)
    sheet.show_state()
    assert sheet.expected_size.note.text() == "at 30:00"
    recorder.say("ended", status=status(duration_s=1800.0), limit="time")
    assert "at the time limit" in window.toast.text
    sheet.limit_minutes.clear()
    sheet.limit_minutes.editingFinished.emit()
    assert recorder.session.recordings.choice.max_minutes is None


def test_saving_the_last_seconds_offers_to_enable_the_flight_recorder(window, recorder):
    window.commands.run("recording.keep")
    assert recorder.ops() == []
    assert "flight recorder is off" in window.toast.accessibleName()
    window.commands.recording._enable_flight_recorder()
    recorder.say("ring")
    recorder.say("figures", recording=None, ring={"seconds": 41.0, "size_bytes": 10**9}, free_bytes=None)
    window._update_status_bar()
    assert "last 41 s available" in window.status.texts()
    window.commands.run("recording.keep")
    assert recorder.ops() == ["ring", "keep"]
    window.commands.run("recording.sheet")
    sheet = sheet_of(window)
    assert sheet.ring.isChecked()
    assert sheet.ring_text.text() == "41 s buffered, 1.0 GB of 2.0 GB"
    sheet.seconds.setText("30")
    sheet.seconds.editingFinished.emit()
    assert recorder.session.recordings.ring_settings == RingSettings(is_on=True, seconds=30)
    QTest.keyClicks(sheet.ring_topics.edit, "/arm/* not /arm/raw")
    assert recorder.session.recordings.ring_settings.patterns == ("/arm/*",)
    QTest.keyClick(sheet.ring_topics.edit, Qt.Key.Key_Return)
    assert recorder.ops()[-2:] == ["end_ring", "ring"]
    order = recorder.line.orders[-1]
    assert (order["topics"], order["left_out"]) == (["/arm/*"], ["/arm/raw"])
    sheet.ring_topics.show_patterns(("/b\x01",), ())
    sheet.ring_topics.editing_finished.emit()
    assert recorder.session.recordings.ring_settings.patterns == ("/arm/*",)
    assert "isn't a valid topic name" in sheet.ring_text.text()
    sheet.ring.click()
    assert recorder.ops()[-1] == "end_ring"


def test_single_native_topic_is_recorded_and_topics_of_other_networks_are_rejected(window, recorder):
    assert window.commands.request(RecordTopic("/odom"))
    assert recorder.line.orders[0]["topics"] == ["/odom"]
    assert recorder.session.recordings.choice == RecordingChoice()
    assert not window.commands.request(RecordTopic("ros2 /odom"))


def test_missing_recording_file_is_reported_and_not_opened(window, recorder, tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    opened: list[Path] = []
    monkeypatch.setattr(recorder.session, "open_recording", opened.append)
    window.commands.request(OpenRecording(path))
    assert "no longer exists" in window.toast.accessibleName()
    assert opened == []
    path.touch()
    window.commands.request(OpenRecording(path))
    assert opened == [path]


@pytest.mark.parametrize(("size", "percent"), [((1440, 900), 100), ((1024, 600), 200)])
def test_texts_of_the_sheet_are_translated_and_fit(qtbot, pseudo, window, recorder, theme, percent, size):
    window.resize(*size)
    theme.set_text_percent(percent)
    window.commands.run("recording.sheet")
    sheet = sheet_of(window)
    sheet._set_mode("pattern")
    recorder.session.recordings.set_ring_settings(RingSettings(is_on=True))
    recorder.say("ring")
    sheet.show_state()
    topics = [topic.name for topic in recorder.session.shown.topics.existing_topics()]
    assert [text for _where, text in said_by(sheet) if untranslated(text, "GB", *topics)] == []
    qtbot.waitUntil(lambda: clipped(sheet) == [])  # Qt defers layouts
    assert not list(unsaid(sheet))
