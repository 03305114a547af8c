from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QRectF
from PySide6.QtTest import QTest

from app.ui.panels.camera import PANEL as CAMERA
from app.ui.panels.camera import CameraPanel
from app.ui.panels.image import PANEL, ImagePanel
from app.ui.picture_view import PictureView, boxes_of, rate_sentence
from app.ui.theme import Theme
from tests.ui.fakes import ImageStream, Picture, RobotLink, Session, Topic, pepper, picture
from tests.ui.panel_case import Window

FACE = {"name": "face", "confidence": 0.97, "box": [160, 60, 80, 60]}
FACES = {"count": 1, "width": 320, "height": 240, "items": [FACE]}


@pytest.fixture
def view(qtbot, qapp) -> PictureView:
    made = PictureView(Theme("light"))
    qtbot.addWidget(made)
    made.resize(400, 400)
    made.show()
    return made


def stream_of(shown: Picture, **figures: float) -> ImageStream:
    stream = ImageStream("/c")
    stream.picture = shown
    stream.arriving_hz, stream.shown_hz, stream.silent_s = 60.0, 30.0, 0.01
    for name, value in figures.items():
        setattr(stream, name, value)
    return stream


def test_a_picture_keeps_its_aspect_on_black(view) -> None:
    view.take(stream_of(picture(320, 240)))  # type: ignore[arg-type]
    assert view.area() == QRectF(0, 50, 400, 300)
    image = view.grab().toImage()
    assert image.pixelColor(200, 20).name() == "#000000"
    assert image.pixelColor(200, 380).name() == "#000000"
    assert image.pixelColor(20, 80).name() == "#c4c6be"
    ball = image.pixelColor(round(250 * 1.25), 50 + round(150 * 1.25))
    assert ball.name() == "#d23e3a"  # red stays red: the bytes are blue, green, red


def test_it_says_how_many_are_shown_and_their_size(view) -> None:
    view.take(stream_of(picture(320, 240)))  # type: ignore[arg-type]
    assert view.words == "shown 30 of 60/s  320\u00d7240"
    assert rate_sentence(None, None) == ""
    assert rate_sentence(17.2, 15.0) == "shown 15 of 15/s"  # two windows of time: never more than arrive


def test_each_picture_is_told_as_shown_once(view) -> None:
    stream = stream_of(picture())
    view.take(stream)  # type: ignore[arg-type]
    view.take(stream)  # type: ignore[arg-type]
    assert len(stream.painted) == 1
    stream.picture = picture()
    view.take(stream)  # type: ignore[arg-type]
    assert len(stream.painted) == 2


def test_a_silent_stream_is_grey_and_says_how_old_its_picture_is(view) -> None:
    view.take(stream_of(picture()))  # type: ignore[arg-type]
    before = view.grab().toImage().pixelColor(20, 80)
    view.take(stream_of(view._picture, silent_s=4.2))  # type: ignore[arg-type]
    assert view.words == "Last picture, 4 s old"
    assert view.grab().toImage().pixelColor(20, 80) != before


def test_boxes_are_drawn_where_they_are_with_their_words(view) -> None:
    boxes = boxes_of(FACES)
    assert (boxes[0].words, boxes[0].confidence) == ("face", 0.97)
    assert boxes[0].place == QRectF(0.5, 0.25, 0.25, 0.25)
    view.take(stream_of(picture()), boxes)  # type: ignore[arg-type]
    image = view.grab().toImage()
    assert image.pixelColor(250, 125).name() == "#ffc53d"  # its upper edge
    assert image.pixelColor(203, 110).name() == "#ffc53d"  # the tag above


@pytest.mark.parametrize(
    "broken", [None, [], {"items": [FACE]}, {**FACES, "items": "x"}, {**FACES, "items": [{}, 3]}]
)
def test_what_is_no_detection_makes_no_box(broken: object) -> None:
    assert boxes_of(broken) == ()


def test_the_value_under_the_mouse_is_said(qtbot, view) -> None:
    view.take(stream_of(picture()))  # type: ignore[arg-type]
    QTest.mouseMove(view, QPoint(20, 60))
    qtbot.waitUntil(lambda: "(16, 8)  196 198 190" in view.words)
    QTest.mouseMove(view, QPoint(20, 20))
    qtbot.waitUntil(lambda: "(" not in view.words)


def test_the_image_panel_shows_the_first_picture_topic_and_others_on_demand(qtbot, qapp) -> None:
    window = Window(Session.full())
    panel = window.make(PANEL, (400, 300))
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.header_widgets()[0])
    assert isinstance(panel, ImagePanel)
    assert panel.subtitle() == "/robot/camera"
    assert panel.topics() == ["/robot/camera", "/robot/depth"]
    panel.show_topic("/robot/depth")
    panel.refresh()
    assert [(one.topic, one.closed) for one in window.session.images.streams] == [
        ("/robot/camera", True), ("/robot/depth", False),
    ]  # fmt: skip
    assert panel.view.isVisible()
    panel.shut()
    assert all(one.closed for one in window.session.images.streams)


def test_the_image_panel_marks_what_the_cameras_robot_recognises(qtbot, qapp) -> None:
    window = Window(Session.full())
    window.session.topics.put(Topic("/Pepper/camera", "image", "image"))
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.header_widgets()[0])
    assert isinstance(panel, ImagePanel)
    panel.refresh()
    assert panel.view.boxes == ()
    panel.show_topic("/Pepper/camera")
    panel.refresh()
    assert [box.words for box in panel.view.boxes] == ["face"]
    assert window.session.fleet.looked_at == ["Pepper"]
    panel.show_topic("/robot/camera")
    panel.refresh()
    assert window.session.fleet.looked_at == []


def test_without_pictures_it_says_what_will_appear(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.images.source = lambda _topic: None
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, ImagePanel)
    assert panel.empty.isVisible()
    window.session.topics.put(Topic("/cam", "image", "image"))
    panel.refresh()
    assert panel.empty._text.text() == "The next picture on /cam appears here."
    window.session.images.streams[0].error = "'/cam' does not send pictures"
    panel.refresh()
    assert panel.empty._text.text() == "'/cam' does not send pictures."


def test_the_camera_panel_follows_the_first_robot_with_a_camera(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.images.source = lambda _topic: Picture(np.zeros((24, 32, 4), np.uint8), 32, 24, 1, 1, 0.0)
    panel = window.make(CAMERA)
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.header_widgets()[0])
    assert isinstance(panel, CameraPanel)
    assert panel.empty.isVisible()
    link = window.session.fleet.join(RobotLink("Pepper", pepper()))
    link.values["faces"] = FACES
    panel.refresh()
    assert panel.subtitle() == "/Pepper/camera"
    assert panel.rate.text() == "shown 15 of 15/s"
    assert len(panel.view.boxes) == 1
    link.connected = False
    window.session.fleet.revision += 1
    window.session.images.streams[0].silent_s = 4.0
    panel.refresh()
    assert panel.view.words == "Last picture, 4 s old"  # the last picture stays, grey
    assert panel.rate.text() == ""
    panel.shut()
    assert window.session.images.streams[0].closed
    assert window.session.fleet.looked_at == []
