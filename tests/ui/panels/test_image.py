from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt
from PySide6.QtGui import QGuiApplication, QWheelEvent
from PySide6.QtTest import QTest

from app.core.messages.picture import Picture
from app.intents import Inspect
from app.ui.intents import ExportRecording, RecordTopic
from app.ui.panels.robots.camera import PANEL as CAMERA
from app.ui.panels.robots.camera import CameraPanel
from app.ui.panels.watch.image.actions import ACTION_SPECS
from app.ui.panels.watch.image.panel import PANEL, ImagePanel
from app.ui.panels.watch.image.snapshot import SnapshotJob
from app.ui.pictures.boxes import boxes_of
from app.ui.pictures.placement import PicturePlacement
from app.ui.pictures.view import PictureView, RateText, pixel_text, rate_text
from app.ui.pictures.zoom import ZoomablePicture
from app.ui.theme.theme import Theme
from nep.messages.message import Message
from tests.nep.recordings.messages import picture as recorded
from tests.nep.recordings.messages import record
from tests.ui.fakes import Clock, Images, ImageStream, Session, on_topic
from tests.ui.panel_case import Window
from tests.ui.sample_data import Topic, pepper, picture

FACE = {"name": "face", "confidence": 0.97, "box": [160, 60, 80, 60]}
FACES = {"count": 1, "width": 320, "height": 240, "items": [FACE]}


@pytest.fixture
def view(qtbot, qapp) -> ZoomablePicture:
    made = ZoomablePicture(Theme("light"))
    qtbot.addWidget(made)
    made.resize(400, 400)
    made.show()
    return made


def made(qtbot, window: Window) -> ImagePanel:
    panel = window.make(PANEL, (400, 300))
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(panel, ImagePanel)
    return panel


def stream_of(shown: Picture, silent_s: float = 0.01) -> ImageStream:
    """Return a stream whose last image was received ``silent_s`` seconds ago."""
    clock = Clock(behind_s=silent_s)
    stream = Images(clock=clock).stream("/c")
    assert shown.message is not None
    stream.came(60.0, 30.0)
    stream._images.offer([on_topic(shown.message, "/c")])
    clock.now += silent_s
    return stream


def test_image_keeps_its_aspect_ratio_on_black(view) -> None:
    view.show_image(stream_of(picture(320, 240)))  # type: ignore[arg-type]
    assert view.area() == QRectF(0, 50, 400, 300)
    image = view.grab().toImage()
    assert image.pixelColor(200, 20).name() == "#000000"
    assert image.pixelColor(390, 380).name() == "#000000"
    assert image.pixelColor(20, 80).name() == "#c4c6be"
    ball = image.pixelColor(round(250 * 1.25), 50 + round(150 * 1.25))
    assert ball.name() == "#d23e3a"  # red stays red: the bytes are blue, green, red


def test_caption_shows_frame_rate_and_image_size(view) -> None:
    view.show_image(stream_of(picture(320, 240)))  # type: ignore[arg-type]
    assert view.label_text.startswith("60 fps (30 shown)  320\u00d7240  ")
    assert view.label_text.endswith(" ms")  # latency
    assert rate_text(None, None) == ""
    assert rate_text(17.2, 15.0) == "15 fps (15 shown)"  # capped: both rates have their own period


def test_fluctuating_frame_rate_is_updated_once_per_second() -> None:
    now, rates = [100.0], SimpleNamespace(displayed_hz=15.4, arriving_hz=15.4)
    words = RateText(lambda: now[0])
    assert words.for_stream(rates) == "15 fps (15 shown)"  # type: ignore[arg-type]
    rates.displayed_hz = rates.arriving_hz = 15.6
    now[0] += 0.9
    assert words.for_stream(rates) == "15 fps (15 shown)"  # type: ignore[arg-type]
    now[0] += 0.2
    assert words.for_stream(rates) == "16 fps (16 shown)"  # type: ignore[arg-type]
    rates.arriving_hz = None
    assert words.for_stream(rates) == ""  # type: ignore[arg-type]


def test_detection_boxes_of_a_frozen_image_are_frozen(view) -> None:
    stream, boxes = stream_of(picture()), boxes_of(FACES)
    view.show_image(stream, boxes)  # type: ignore[arg-type]
    stream.set_frozen(True)
    view.show_image(stream, ())  # type: ignore[arg-type]
    assert view.boxes == boxes
    stream.set_frozen(False)
    view.show_image(stream, ())  # type: ignore[arg-type]
    assert view.boxes == ()


def test_each_image_is_counted_as_shown_once(view) -> None:
    stream = stream_of(picture())
    view.show_image(stream)  # type: ignore[arg-type]
    view.show_image(stream)  # type: ignore[arg-type]
    assert len(stream.painted) == 1
    stream.picture = picture()
    view.show_image(stream)  # type: ignore[arg-type]
    assert len(stream.painted) == 2


def test_stale_image_is_drawn_differently_and_shows_its_age(view) -> None:
    view.show_image(stream_of(picture()))  # type: ignore[arg-type]
    before = view.grab().toImage().pixelColor(20, 80)
    view.show_image(stream_of(view._picture, silent_s=4.2))  # type: ignore[arg-type]
    assert view.label_text == "Last image 4 s ago"
    assert view.grab().toImage().pixelColor(20, 80) != before


@pytest.fixture
def camera_view(qtbot, qapp) -> PictureView:
    view = PictureView(Theme("light"), fills_view=True, has_label=False)
    qtbot.addWidget(view)
    view.resize(400, 160)
    view.show()
    return view


def test_unchanged_image_is_not_repainted(qtbot, camera_view, monkeypatch) -> None:
    stream = stream_of(picture(320, 240))
    camera_view.show_image(stream)
    qtbot.waitExposed(camera_view)
    asked: list[str] = []
    monkeypatch.setattr(camera_view, "update", lambda: asked.append("update"))
    first = stream.picture
    assert first is not None
    stream.picture = replace(first, seq=2)
    camera_view.show_image(stream)
    assert (asked, camera_view.picture) == ([], stream.picture)
    stream.picture = replace(first, seq=3, bgra=first.bgra.copy())
    camera_view.show_image(stream)
    assert asked


@pytest.mark.parametrize("has_label", [True, False])
def test_image_age_is_updated_once_per_second_and_repaints_only_its_text(
    qtbot, monkeypatch, has_label: bool
) -> None:
    clock = Clock()
    view = PictureView(Theme("light"), has_label=has_label, clock=clock)
    qtbot.addWidget(view)
    view.resize(400, 300)
    stream, first = stream_of(picture(320, 240)), picture(320, 240)
    view.show_image(stream)
    asked: list[tuple[int, ...]] = []
    monkeypatch.setattr(view, "update", lambda *where: asked.append(where))

    def takes(age_s: float) -> None:
        stream.picture = replace(first, bgra=view.picture.bgra, stamp_ns=time.time_ns() - round(1e9 * age_s))
        view.show_image(stream)

    for n in range(30):
        clock.now += 0.03
        takes(60.0 + n)
    words = view.label_text
    assert asked == []
    clock.now += 0.2
    takes(600.0)
    assert (words != view.label_text, "10 min" in view.label_text) == (True, True)
    assert len(asked) == has_label
    assert all(where[1] > 200 for where in asked), "not the picture above its words"


def test_camera_image_has_no_black_margins(camera_view) -> None:
    camera_view.show_image(stream_of(picture(320, 240)))  # type: ignore[arg-type]
    assert camera_view.area().left() > 60
    image = camera_view.grab().toImage()
    assert all(image.pixelColor(x, 80).lightness() > 60 for x in (2, 30, 370, 397))


def test_last_image_of_a_lost_camera_is_grey_with_a_message_in_the_middle(camera_view) -> None:
    shown = picture(320, 240)
    camera_view.show_image(stream_of(shown, silent_s=4.2))  # type: ignore[arg-type]
    assert camera_view.label_text.startswith("Last image 4 s ago")
    image = camera_view.grab().toImage()
    found = [image.pixelColor(x, y) for x in range(0, 400, 3) for y in range(0, 160, 3)]
    assert all(max(one.red(), one.green(), one.blue()) - min(one.red(), one.green(), one.blue()) < 3
        for one in found)  # fmt: skip
    assert any(one.lightness() > 240 for one in found)  # the label's text
    assert all(image.pixelColor(x, 150).lightness() < 200 for x in range(8, 200, 4))  # no label below
    camera_view.show_image(stream_of(shown))  # type: ignore[arg-type]
    assert any(one.saturation() > 100 for one in (camera_view.grab().toImage().pixelColor(x, 100)
        for x in range(100, 300)))  # fmt: skip


def test_detection_boxes_are_drawn_at_their_position_with_labels(view) -> None:
    boxes = boxes_of(FACES)
    assert (boxes[0].label, boxes[0].confidence) == ("face", 0.97)
    assert boxes[0].rect == QRectF(0.5, 0.25, 0.25, 0.25)
    view.show_image(stream_of(picture()), boxes)  # type: ignore[arg-type]
    image = view.grab().toImage()
    assert image.pixelColor(250, 125).name() == "#ffc53d"  # top edge of the box
    assert image.pixelColor(203, 110).name() == "#ffc53d"  # label above the box


@pytest.mark.parametrize(
    "broken", [None, [], {"items": [FACE]}, {**FACES, "items": "x"}, {**FACES, "items": [{}, 3]}]
)
def test_invalid_detections_draw_no_box(broken: object) -> None:
    assert boxes_of(broken) == ()


def test_pixel_value_under_the_mouse_is_shown(qtbot, view) -> None:
    view.show_image(stream_of(picture()))  # type: ignore[arg-type]
    QTest.mouseMove(view, QPoint(20, 60))
    qtbot.waitUntil(lambda: "(16, 8)  196 198 190  #C4C6BE" in view.label_text)
    QTest.mouseMove(view, QPoint(20, 20))
    qtbot.waitUntil(lambda: "#" not in view.label_text)


def test_image_panel_shows_the_first_image_topic_and_another_topic_on_request(qtbot, qapp) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    assert panel.subtitle() == "/robot/camera"
    assert panel.topics() == ["/robot/camera", "/robot/depth"]
    panel.show_topic("/robot/depth")
    panel.refresh()
    assert [(one.topic, one.is_closed) for one in window.session.shown.images.streams] == [
        ("/robot/camera", True), ("/robot/depth", False),
    ]  # fmt: skip
    assert panel.view.isVisible()
    panel.dispose()
    assert all(one.is_closed for one in window.session.shown.images.streams)


def test_image_panel_marks_detections_of_the_camera_robot(qtbot, qapp) -> None:
    window = Window(Session.full())
    window.session.put(Topic("/Pepper/camera", "image", "image"))
    panel = made(qtbot, window)
    panel.refresh()
    assert panel.view.boxes == ()
    panel.show_topic("/Pepper/camera")
    panel.refresh()
    assert [box.label for box in panel.view.boxes] == ["face"]
    assert window.session.looked_at == ["Pepper"]
    panel.show_topic("/robot/camera")
    panel.refresh()
    assert window.session.looked_at == []


def test_image_panel_without_images_shows_an_empty_state_with_the_reason(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.shown.images.camera = lambda _topic: None
    panel = made(qtbot, window)
    assert panel.empty.isVisible()
    window.session.put(Topic("/cam", "image", "image"))
    panel.refresh()
    assert panel.empty._text.text() == "The next image on /cam appears here."
    window.session.shown.images.streams[0].error = "'/cam' does not send pictures"
    panel.refresh()
    assert panel.empty._text.text() == "'/cam' does not send pictures."


def test_camera_panel_shows_a_robot_and_keeps_its_last_image_after_disconnection(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.shown.images.camera = lambda _topic: picture(32, 24)
    panel = window.make(CAMERA)
    for widget in (panel, *panel.header_widgets()):
        qtbot.addWidget(widget)
    assert isinstance(panel, CameraPanel)
    assert panel.empty.isVisible()
    link = window.session.join(pepper())
    link.values["faces"] = FACES
    panel.refresh()
    assert panel.subtitle() == "/Pepper/camera"
    assert panel.rate_label.text() == "15 fps (15 shown)"
    assert len(panel.view.boxes) == 1
    link.is_connected = False
    window.session.fleet.revision += 1
    window.session.clock.now += 4.0
    panel.refresh()
    assert panel.view.label_text == "Last image 4 s ago"  # the last image stays, in grey
    assert panel.rate_label.text() == ""
    assert (panel.chip.text, panel.chip.status) == ("silent for 4 s", "error")
    panel.dispose()
    assert window.session.shown.images.streams[0].is_closed
    assert window.session.looked_at == []


# -- zoom, pan, rotate, save --------------------------------------------------------------------------


def wheel(view: ZoomablePicture, at: QPoint, notches: int) -> None:
    event = QWheelEvent(
        QPointF(at), QPointF(view.mapToGlobal(at)), QPoint(), QPoint(0, 120 * notches),
        Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    view.wheelEvent(event)


def under(view: ZoomablePicture, at: QPoint) -> str:
    view.mouse_position = QPointF(at)
    return view._hovered_pixel_text()


def test_wheel_zooms_at_the_mouse_position(view) -> None:
    view.show_image(stream_of(picture()))  # type: ignore[arg-type]
    at = QPoint(313, 237)  # the ball
    before = under(view, at)
    assert before.endswith("210 62 58  #D23E3A")
    wheel(view, at, 9)
    assert view.scale() == pytest.approx(1.25 * 1.25**9)
    assert under(view, at) == before
    assert f"{round(view.scale() * 100)} %" in view.label_text
    assert view.grab().toImage().pixelColor(at).name() == "#d23e3a"


def test_pixels_have_sharp_edges_from_200_per_cent_zoom(view) -> None:
    corner = bytes([255] * 3 + [0] * 45)
    layout = {"shape": [4, 4, 3], "encoding": "bgr8"}
    message = Message("/c", corner, "image", "image", stamp_ns=time.time_ns(), extension=layout)
    view.show_image(stream_of(replace(picture(4, 4), message=message)))  # type: ignore[arg-type]
    image = view.grab().toImage()
    assert {image.pixelColor(x, 20).name() for x in range(0, 200, 3)} == {"#ffffff", "#000000"}
    view.placement.set_zoom(1.9)
    view.update()
    image = view.grab().toImage()
    colours = {image.pixelColor(x, y).name() for x in range(190, 210) for y in range(190, 210)}
    assert len(colours) > 2  # interpolated: there are grey pixels


@pytest.mark.parametrize("turned", [0, 90, 180, 270])
@pytest.mark.parametrize("flipped", [False, True])
def test_pixel_values_and_boxes_follow_rotation_and_flipping(view, turned: int, flipped: bool) -> None:
    view.show_image(stream_of(picture()), boxes_of(FACES))  # type: ignore[arg-type]
    if flipped:
        view.placement.flip(is_horizontal=True)
    view.placement.rotate(turned)
    ball = view.placement.to_view(view.area()).map(QPointF(250.5 / 320, 150.5 / 240))
    assert under(view, ball.toPoint()).endswith("210 62 58  #D23E3A")
    image = view.grab().toImage()
    assert image.pixelColor(ball.toPoint()).name() == "#d23e3a"
    box = view.placement.to_view(view.area()).mapRect(QRectF(0.5, 0.25, 0.25, 0.25))
    assert image.pixelColor(round(box.center().x()), round(box.bottom())).name() == "#ffc53d"


def test_drag_and_arrow_keys_pan_a_zoomed_image(qtbot, view) -> None:
    view.show_image(stream_of(picture()))  # type: ignore[arg-type]
    view.placement.set_zoom(5.0)
    before = under(view, QPoint(100, 100))
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(100, 100))
    QTest.mouseMove(view, QPoint(150, 130))
    qtbot.waitUntil(lambda: under(view, QPoint(150, 130)) == before)
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=QPoint(150, 130))
    QTest.keyClick(view, Qt.Key.Key_Left)
    QTest.keyClick(view, Qt.Key.Key_Down)
    assert under(view, QPoint(190, 90)) == before


def test_double_click_toggles_between_fit_and_actual_size(view) -> None:
    view.show_image(stream_of(picture()))  # type: ignore[arg-type]
    QTest.mouseDClick(view, Qt.MouseButton.LeftButton, pos=QPoint(200, 200))
    assert view.scale() == pytest.approx(1.0)
    QTest.mouseDClick(view, Qt.MouseButton.LeftButton, pos=QPoint(200, 200))
    assert view.placement.zoom is None


def test_image_is_decoded_at_display_size_and_in_full_under_the_mouse(view) -> None:
    stream = stream_of(picture(640, 320))
    view.show_image(stream)  # type: ignore[arg-type]
    assert stream.requested_size == (400, 200)
    view.placement.rotate(90)
    view.show_image(stream)  # type: ignore[arg-type]
    assert stream.requested_size == (400, 200)
    view.placement.set_zoom(3.0)
    view.show_image(stream)  # type: ignore[arg-type]
    assert stream.requested_size == (1920, 960)
    view.placement.set_zoom(None)
    view.mouse_position = QPointF(200, 200)
    view.show_image(stream)  # type: ignore[arg-type]
    assert stream.requested_size is None


def test_sequence_command_records_the_topic_or_exports_the_open_recording(qtbot, qapp, tmp_path) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    (action,) = [each for each in panel.more_actions() if each.text() == "Record a sequence"]
    action.trigger()
    assert window.commands == [RecordTopic(panel._topic)]
    path = tmp_path / "Tour.mcap"
    record(path, [[recorded(seq) for seq in range(3)]])
    window.session.open_recording(path)
    panel.more_actions()
    assert action.text() == "Save the sequence as files"
    action.trigger()
    assert window.commands[1:] == [ExportRecording(path)]
    panel.show_topic("")
    panel.more_actions()
    assert not action.isEnabled()


def test_pixel_value_is_formatted_as_colour_or_number() -> None:
    assert pixel_text(1, 2, (255, 0, 16)) == "(1, 2)  255 0 16  #FF0010"
    assert pixel_text(1, 2, 820) == "(1, 2)  820"
    assert pixel_text(1, 2, 0.125) == "(1, 2)  0.125"
    assert pixel_text(1, 2, float("nan")) == "(1, 2)  nan"
    assert pixel_text(1, 2, None) == "(1, 2)"


def test_zoom_rotation_flip_and_freeze_have_shortcuts_while_the_image_has_focus(qtbot, qapp) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    view, place = panel.view, panel.view.placement
    QTest.keyClicks(view, "++")
    assert view.scale() == pytest.approx(1.25**3, rel=0.01)  # fitted at 125 %
    QTest.keyClick(view, Qt.Key.Key_Minus, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClicks(view, "1")
    assert view.scale() == pytest.approx(1.0)
    QTest.keyClicks(view, "0r")
    assert (place.zoom, place.rotation_deg) == (None, 90)
    QTest.keyClick(view, Qt.Key.Key_R, Qt.KeyboardModifier.ShiftModifier)
    assert place.rotation_deg == 0
    QTest.keyClicks(view, "hv")
    assert (place.is_flipped_horizontally, place.is_flipped_vertically) == (True, True)
    assert panel.actions_of["across"].isChecked()
    QTest.keyClick(view, Qt.Key.Key_Space)
    assert panel.freeze.isChecked()
    assert window.session.shown.images.streams[0].is_frozen
    words = [action.text().partition("\t")[0] for action in panel.more_actions() if action.text()]
    assert words == [*(row.text for row in ACTION_SPECS), "Record a sequence", "Open in the Inspector"]


def test_focused_image_overrides_window_shortcuts_except_f12(qtbot, qapp) -> None:
    panel = made(qtbot, Window(Session.full()))
    for name in ("Ctrl++", "Ctrl+-", "Ctrl+0", "Space"):
        assert name in panel.view.keys
    assert "F12" not in panel.view.keys


def test_frozen_image_is_labelled_and_another_topic_ends_the_freeze(qtbot, qapp) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    panel.freeze.click()
    panel.refresh()
    assert panel.view.label_text.startswith("Frozen ")
    panel.show_topic("/robot/depth")
    assert not panel.freeze.isChecked()


def test_image_is_saved_as_received_and_the_toast_opens_its_folder(qtbot, qapp, tmp_path) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    panel.job = SnapshotJob(panel, lambda: tmp_path / "kept")
    panel.job.saved.connect(panel._on_saved)
    panel.view.placement.rotate(90)
    QTest.keyClicks(panel.view, "s")
    qtbot.waitUntil(lambda: bool(window.toasts))
    (file,) = (tmp_path / "kept").iterdir()
    assert window.toasts == [f"Saved {file.name}"]
    assert window.toast_buttons[0][0] == "Open folder"
    assert file.name.startswith("robot camera 20")
    read = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(read, picture().bgra[:, :, :3])


def test_image_that_cannot_be_saved_raises_an_alert(qtbot, qapp, tmp_path) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    (tmp_path / "file").write_text("in the way")
    panel.job = SnapshotJob(panel, lambda: tmp_path / "file")
    panel.job.failed.connect(panel._on_failed)
    panel.save_image()
    qtbot.waitUntil(lambda: window.session.alerts.has("snapshot"))
    assert window.toasts == []


def test_whole_image_is_copied_and_encoded_in_another_thread(qtbot, qapp, monkeypatch) -> None:
    threads: list[int] = []
    whole = SnapshotJob._run

    def watched(self: SnapshotJob, *args: object) -> None:
        threads.append(threading.get_ident())
        whole(self, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(SnapshotJob, "_run", watched)
    window = Window(Session.full())
    panel = made(qtbot, window)
    QTest.keyClick(panel.view, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: bool(window.toasts))
    assert window.toasts == ["Copied the image, 320×240"]  # noqa: RUF001
    assert QGuiApplication.clipboard().image().size().width() == 320
    assert threads
    assert threading.get_ident() not in threads


def test_zoom_rotation_and_flip_are_restored_with_the_layout(qtbot, qapp) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    QTest.keyClicks(panel.view, "+rh")
    again = made(qtbot, window)
    again.restore_state(panel.save_state())
    assert again.view.placement == panel.view.placement
    assert again.actions_of["across"].isChecked()
    again.restore_state({"topic": 3, "place": "nonsense"})


def test_zoom_rotation_and_flip_are_kept_per_topic(qtbot, qapp) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    QTest.keyClicks(panel.view, "+rh")
    first, place = panel.subtitle(), panel.view.placement
    assert place.zoom is not None
    panel.show_topic("/robot/depth")
    assert panel.view.placement == PicturePlacement()
    assert not panel.actions_of["across"].isChecked()
    panel.show_topic(first)
    assert panel.view.placement is place
    assert panel.actions_of["across"].isChecked()


def test_snapshot_job_reports_in_the_gui_thread_and_not_after_closing(qtbot, qapp, tmp_path) -> None:
    window = Window(Session.full())
    panel = made(qtbot, window)
    told: list[int] = []
    job = SnapshotJob(panel, lambda: tmp_path / "kept")
    job.saved.connect(lambda _path: told.append(threading.get_ident()), Qt.ConnectionType.DirectConnection)
    job.failed.connect(lambda _words: told.append(threading.get_ident()), Qt.ConnectionType.DirectConnection)
    message = panel._message()
    assert message is not None
    job.save(message)
    assert job.is_busy
    qtbot.waitUntil(lambda: bool(told))
    job._start(lambda: Path(str(1 / 0)))  # any exception is reported and the next job can start
    qtbot.waitUntil(lambda: len(told) == 2)
    assert set(told) == {threading.get_ident()}
    assert not job.is_busy
    job.save(message)
    job.wait()
    qapp.processEvents()
    assert len(told) == 2
    assert len(list((tmp_path / "kept").iterdir())) == 2
    assert not job.is_busy
    job.save(message)  # such as after another topic was shown during the save
    qtbot.waitUntil(lambda: len(told) == 3)


def test_topic_without_images_offers_the_inspector(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.put(Topic("/cam", "image", "image"))
    panel = made(qtbot, window)
    window.session.shown.images.streams[0].error = "they are no picture"
    panel.refresh()
    assert panel.empty._title.text() == "Can't show the message as an image"
    next(each for each in panel.empty._buttons).click()
    assert window.commands == [Inspect("/cam")]
    assert panel.fit_button.isHidden()


def test_camera_panel_shows_the_selected_robot(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.shown.images.camera = lambda _topic: picture()
    for name in ("Pepper", "Nao"):
        described = replace(pepper(), name=name)
        sensors = [
            replace(each, topic=f"/{name}/camera") if each.is_image else each for each in described.sensors
        ]
        window.session.join(replace(described, sensors=tuple(sensors)))
    panel = window.make(CAMERA)
    for widget in (panel, *panel.header_widgets()):
        qtbot.addWidget(widget)
    assert panel.subtitle() == "/Pepper/camera"
    window.session.fleet.select("Nao")
    panel.refresh()
    assert panel.subtitle() == "/Nao/camera"
    panel.dispose()


def test_narrow_title_hides_buttons_and_the_menu_has_all_actions(qtbot, qapp) -> None:
    panel = made(qtbot, Window(Session.full()))
    assert not panel.fit_button.isHidden()
    panel.resize(220, 220)
    buttons = (panel.fit_button, panel.save_button, panel.freeze)
    assert [button.isHidden() for button in buttons] == [True, True, False]
    assert len([action for action in panel.more_actions() if action.text()]) == len(ACTION_SPECS) + 2
    empty = made(qtbot, Window(Session()))
    assert (empty.fit_button.isHidden(), empty.freeze.isHidden()) == (True, True)
