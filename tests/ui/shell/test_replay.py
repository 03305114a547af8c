"""Tests of a recording in the main window: panels show recorded messages while live reception continues."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor, QImage, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.core.recording.replay.replay import Replay
from app.core.session import Session
from app.intents import ShowRecordingFile
from app.ui.intents import OpenRecording
from app.ui.panels.base import Panel, PanelWidget
from app.ui.panels.home import RowHome
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.timeline.layers import counts_image
from nep.messages.message import Message
from nep.recordings.reader import Recording
from tests.nep.recordings.messages import json_message, picture, record
from tests.ui.shell_parts import Answers

pytest_plugins = ["tests.ui.shell_fixtures"]

COUNT = 90
HOME = (RowHome("behaviour", 0, 0, 626),)
BLOCKS = Panel(
    "behaviour", "Behaviour", "blocks", (), lambda context: PanelWidget(context, "Behaviour"), home=HOME
)


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    """Recording of messages on /a, 10 ms apart, where every tenth message is an image."""
    path = tmp_path_factory.mktemp("recordings") / "Tour.mcap"
    messages = [picture(seq) if seq % 10 == 5 else json_message(seq, "/a") for seq in range(COUNT)]
    record(path, [messages[:30], messages[30:60], messages[60:]])
    return path


@pytest.fixture(scope="module")
def whole(path) -> list[tuple[int, Message]]:
    with Recording(path) as recording:
        return [(log_ns, message) for log_ns, message in recording.read()]


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


def opened(qtbot, window: MainWindow, path: Path) -> Replay:
    """Open the recording, wait until it is loaded and return the replay."""
    window.commands.request(OpenRecording(path))
    replay = window.session.replay
    assert replay is not None
    until(qtbot, window, lambda: replay.opened_recording is not None)
    window.tick()
    return replay


def inspected(window: MainWindow):
    return window.bench.docks["inspector"].panel


def go_to(qtbot, window: MainWindow, at_ns: int) -> None:
    replay = window.session.replay
    replay.seek(at_ns)
    until(qtbot, window, lambda: replay.player.position_ns == at_ns)


def live(session: Session, seq: int) -> Message:
    """Post a live message on /a, a topic that the recording has too, and return it."""
    message = json_message(seq, "/a")
    session._mailbox.post("/a", [message])
    return message


def test_inspector_shows_the_message_at_the_playhead_and_then_live_messages(
    qtbot, window, session, path, whole
):
    window.show_layout("developer")
    window.open_topic("/a")
    window.tick()
    before = live(session, 1000)
    window.tick()
    assert inspected(window).inspected.message is before
    opened(qtbot, window, path)
    for place in (70, 12, 41):
        at_ns, _message = whole[place]
        go_to(qtbot, window, at_ns)
        expected = [message for log_ns, message in whole if log_ns <= at_ns and message.topic == "/a"][-1]
        until(qtbot, window, lambda seq=expected.seq: inspected(window).inspected.message.seq == seq)
        assert bytes(inspected(window).inspected.message.data) == bytes(expected.data)
        assert inspected(window).model.value() == expected.payload
        assert inspected(window).live.text == "recorded"
    live(session, 1001)
    window.tick()
    assert inspected(window).inspected.message.seq == expected.seq
    window.commands.run("replay.live")
    window.tick()
    assert session.replay is None
    assert inspected(window).live.text == "live"
    after = live(session, 1002)
    window.tick()
    assert inspected(window).inspected.message is after
    assert "timeline" not in window.bench.open_names()


def test_image_of_a_paused_recording_is_not_stale_and_keeps_its_recorded_age(
    qtbot, window, session, path, whole
):
    window.show_layout("developer")
    replay = opened(qtbot, window, path)
    go_to(qtbot, window, whole[47][0])
    image = window.bench.docks["image"].panel
    image.show_topic("/camera")
    until(qtbot, window, lambda: image.view.picture is not None)
    stream, later = image._stream, time.monotonic() + 60.0
    assert stream.stamp_age_s == pytest.approx((whole[47][0] - image.view.picture.stamp_ns) / 1e9, abs=1e-3)
    replay.images.clock = lambda: later
    assert stream.silent_s > 50.0
    window.tick()
    assert stream.silent_s == 0.0
    assert "Last image" not in image.view.label_text


def test_live_topics_keep_receiving_messages_during_a_replay(qtbot, window, session, path):
    watch = session.live.watch("/a")
    opened(qtbot, window, path)
    said = live(session, 2000)
    window.tick()
    assert session.live.topics["/a"].newest is said
    assert session.shown.topics["/a"].newest is not said
    watch.close()


def test_replay_publishes_and_subscribes_to_no_topic(qtbot, window, session, path, monkeypatch):
    asked = []
    monkeypatch.setattr(session.live.source, "submit", lambda what, job: asked.append(what))
    monkeypatch.setattr(session.live.source, "watch", asked.append)
    replay = opened(qtbot, window, path)
    asked.clear()
    window.open_topic("/a")
    replay.play()
    until(qtbot, window, lambda: replay.player.is_at_end)
    assert asked == []


def test_recording_is_opened_by_menu_and_drop_and_replaces_the_open_recording(
    qtbot, window, session, answers, path, tmp_path
):
    answers.path = path
    window.commands.run("replay.open")
    first = session.replay
    assert first.path == path
    assert answers.asked[0].startswith("recording ")
    other = tmp_path / "other.mcap"
    other.write_bytes(path.read_bytes())
    window.commands.files.open_all([other])
    assert session.replay.path == other
    until(qtbot, window, lambda: session.replay.opened_recording is not None)
    assert [topic.name for topic in session.shown.topics] == ["/a", "/camera"]
    until(qtbot, window, lambda: first.has_ended)


def test_file_that_is_not_a_recording_raises_an_alert_and_can_be_closed(qtbot, window, session, tmp_path):
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"no recording")
    window.commands.request(OpenRecording(broken))
    until(qtbot, window, lambda: session.replay.status.stage == "failed")
    window.tick()
    assert [alert.intent for alert in session.alerts.active] == [ShowRecordingFile(broken)]
    timeline = window.bench.docks["timeline"].panel
    assert timeline.pages.currentIndex() == 0
    window.commands.run("replay.live")
    window.tick()
    assert session.replay is None


def test_tool_bar_and_status_bar_show_whether_live_or_recorded_data_are_shown(qtbot, window, session, path):
    window.show_layout("developer")
    source = window.tools.source
    window.tools.refresh()
    assert (source.text(), source.back.isVisible()) == ("Live network", False)
    opened(qtbot, window, path)
    window.tools.refresh()
    assert source.text() == "Tour.mcap  0:00"
    window._update_status_bar()
    assert window.status.texts()[0].startswith("Tour.mcap, ")
    assert "The live network keeps running" in window.status.texts()
    QTest.mouseClick(source.back, Qt.MouseButton.LeftButton)
    window.tools.refresh()
    assert (source.text(), source.back.isVisible()) == ("Live network", False)


def test_timeline_shortcuts_play_step_bookmark_and_zoom(qtbot, window, session, path, whole):
    replay = opened(qtbot, window, path)
    panel = window.bench.docks["timeline"].panel
    window.tick()
    canvas = panel.canvas

    def press(key: Qt.Key, held: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        QTest.keyClick(canvas, key, held)

    press(Qt.Key.Key_End)
    until(qtbot, window, lambda: replay.player.position_ns == replay.end_ns)
    press(Qt.Key.Key_Home)
    until(qtbot, window, lambda: replay.player.position_ns == replay.start_ns)
    press(Qt.Key.Key_Right)
    until(qtbot, window, lambda: replay.player.position_ns == whole[1][0])
    press(Qt.Key.Key_B)
    assert [mark.at_ns for mark in replay.bookmarks] == [whole[1][0]]
    press(Qt.Key.Key_BracketLeft)
    until(qtbot, window, lambda: replay.player.is_looping)
    assert replay.player.loop == (whole[1][0], replay.end_ns)
    press(Qt.Key.Key_L)
    until(qtbot, window, lambda: not replay.player.is_looping)
    press(Qt.Key.Key_Plus)
    assert not canvas.scale.is_full
    press(Qt.Key.Key_0)
    assert canvas.scale.is_full
    press(Qt.Key.Key_Down)
    assert replay.selected_topic == "/camera"
    press(Qt.Key.Key_Space)
    until(qtbot, window, lambda: replay.player.is_at_end and not replay.player.is_playing)
    replay.remove_bookmark(replay.bookmarks[0])


def test_mouse_seeks_selects_lanes_and_zooms_in_the_timeline(qtbot, window, session, path, whole):
    replay = opened(qtbot, window, path)
    canvas = window.bench.docks["timeline"].panel.canvas
    until(qtbot, window, lambda: replay.densities.newest is not None)
    x = round(canvas.x_of(whole[50][0]))
    QTest.mouseClick(canvas.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(x, 10))
    at_ns = canvas.time_at(x)
    until(qtbot, window, lambda: replay.player.position_ns == at_ns)
    y = round(canvas.geometry_of_lanes().lane_rect(1).center().y())
    QTest.mouseClick(canvas.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(20, y))
    assert replay.selected_topic == "/camera"
    assert replay.player.position_ns == at_ns
    x = canvas.x_of(at_ns)  # the dock may have been resized in between
    place = QPointF(x, 60)
    turned = QWheelEvent(
        place, canvas.viewport().mapToGlobal(place), QPoint(), QPoint(0, 240), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    before = canvas.scale
    QApplication.sendEvent(canvas.viewport(), turned)
    assert canvas.scale.span_ns < before.span_ns
    assert abs(canvas.x_of(at_ns) - x) <= 1.5


def test_timeline_lanes_are_darker_where_the_message_density_is_higher():
    made = counts_image([0, 1, 2, 4], 4, QColor("#ffffff"))
    alphas = [made.pixelColor(x, 0).alphaF() for x in range(4)]
    assert made.format() == QImage.Format.Format_ARGB32_Premultiplied
    assert alphas[0] == 0.0
    assert alphas[1] < alphas[2] < alphas[3] == pytest.approx(0.76, abs=0.01)


def test_plot_shows_data_before_the_playhead_and_restarts_on_return_to_live(
    qtbot, window, session, path, whole
):
    opened(qtbot, window, path)
    window.context.plot("/a", "x")
    plot = window.bench.docks["plot"].panel
    go_to(qtbot, window, whole[40][0])
    wanted = [message.seq for log_ns, message in whole[:41] if message.topic == "/a"]
    until(qtbot, window, lambda: list(plot.shown[0].curve.samples.values) == wanted)
    go_to(qtbot, window, whole[20][0])
    until(qtbot, window, lambda: list(plot.shown[0].curve.samples.values) == [w for w in wanted if w <= 20])
    window.commands.run("replay.live")
    window.tick()
    assert [each.name for each in plot.shown] == ["/a.x"]
    assert len(plot.shown[0].curve.samples) == 0


def test_image_panel_shows_the_image_at_the_playhead(qtbot, window, session, path, whole):
    opened(qtbot, window, path)
    image = window.bench.docks["image"].panel
    go_to(qtbot, window, whole[40][0])
    until(qtbot, window, lambda: image._message() is not None and image._message().seq == 35)
    go_to(qtbot, window, whole[2][0])  # before the first image
    until(qtbot, window, lambda: image._stream.picture is None and image.pages.currentIndex() == 0)


@pytest.mark.parametrize("moved", [False, True])
def test_timeline_keeps_its_height_when_recordings_are_reopened(qtbot, window, session, path, moved):
    window.resize(1440, 900)
    window.show()
    heights = []
    for _ in range(3):
        opened(qtbot, window, path)
        bench = window.bench
        qtbot.waitUntil(lambda bench=bench: not bench._size_timer.isActive())
        QApplication.processEvents()
        if moved and not heights:
            line = QPoint(bench.width() // 2, bench.docks["timeline"].y() - 3)
            assert bench.isSeparator(line)
            QTest.mousePress(bench, Qt.MouseButton.LeftButton, pos=line)
            QTest.mouseMove(bench, line - QPoint(0, 40))
            qtbot.waitUntil(lambda bench=bench: bench.docks["timeline"].height() > 340)
            QTest.mouseRelease(bench, Qt.MouseButton.LeftButton, pos=line - QPoint(0, 40))
        heights.append(bench.docks["timeline"].height())
        window.commands.run("replay.live")
        window.tick()
        QApplication.processEvents()
    assert heights == pytest.approx([364 if moved else 324] * 3, abs=2)


def test_plotted_topic_missing_in_the_recording_is_not_listed_as_a_recorded_topic(
    qtbot, window, session, path
):
    window.show_layout("developer")
    window.context.plot("/ghost", "x")
    replay = opened(qtbot, window, path)
    replay.seek(replay.start_ns + 1)
    until(qtbot, window, lambda: replay.player.position_ns == replay.start_ns + 1)
    for _ in range(5):
        window.tick()
    assert "/ghost" not in session.shown.topics
    assert "/a" in session.shown.topics


def test_reset_panels_ends_the_subscriptions_of_a_plot_and_keeps_its_curves(qtbot, window, session):
    window.show()
    window.show_layout("developer")
    window.context.plot("/ghost", "x")
    assert session.shown.series.topics == ("/ghost",)
    window.commands.run("layout.reset")
    assert session.shown.series.topics == ()
    assert "plot" not in window.bench.open_names()
    window.open_panel("plot")
    assert session.shown.series.topics == ("/ghost",)
