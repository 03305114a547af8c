"""Tests of the image panel's colour maps, colour bar and annotations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QColor, QImage, QPainter, QTransform

from app.core.messages.annotations import MAX_COORDINATE_PX, parse_shapes
from app.core.messages.image_style import ColourScale
from app.ui.panels.watch.image.overlays import MAX_OVERLAYS
from app.ui.panels.watch.image.panel import PANEL, ImagePanel
from app.ui.pictures.annotations import bar_image, paint_annotations, paint_colour_bar
from app.ui.theme.theme import Theme
from nep.messages.message import Message
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press, ticks
from tests.ui.sample_data import Topic

DEPTH, CAMERA, MARKS = "/robot/depth16", "/cam", "/marks"
RED = {"r": 1, "g": 0, "b": 0, "a": 1}


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session())
    for name in (DEPTH, CAMERA):
        made.session.put(Topic(name, "image", "image"))
    made.session.put(Topic(MARKS, "foxglove.ImageAnnotations"))
    made.session.put(Topic("/face_positions"))
    made.session.put(Topic("/other"))
    return made


@pytest.fixture
def panel(qtbot, window) -> Iterator[ImagePanel]:
    made = window.make(PANEL, (640, 480))
    qtbot.addWidget(made)
    assert isinstance(made, ImagePanel)
    yield made
    made.dispose()


def sends(window: Window, panel: ImagePanel, topic: str, frame: np.ndarray, encoding: str) -> None:
    extension = {"shape": list(frame.shape), "encoding": encoding}
    window.session.shown.images.offer(
        [Message(topic, frame.tobytes(), "image", "image", extension=extension)]
    )
    ticks(window, panel)


def depth() -> np.ndarray:
    return np.tile(np.linspace(500, 4500, 320).astype(np.uint16), (240, 1))


def shown(panel: ImagePanel) -> np.ndarray:
    picture = panel.view.picture
    assert picture is not None
    return picture.bgra


def test_depth_image_has_a_colour_bar_with_selectable_colours_and_range(panel, window) -> None:
    panel.show_topic(DEPTH)
    sends(window, panel, DEPTH, depth(), "mono16")
    assert panel.view.picture.scale is not None
    assert (panel.view.picture.scale.low, panel.view.picture.scale.high) == (500.0, 4500.0)
    usual = shown(panel).copy()
    press(panel.style_button)
    assert panel.style_bar.isVisible()
    panel.style_bar.colour_map_choice.set_value("turbo")
    panel.style_bar.colour_map_choice.activated.emit(panel.style_bar.colour_map_choice.currentIndex())
    ticks(window, panel)
    assert not np.array_equal(shown(panel), usual)  # the same image with another colour map
    press(panel.style_bar.range_button)
    assert panel.style_bar.low_field.isVisible()
    assert (panel.style_bar.low_field.text(), panel.style_bar.high_field.text()) == ("500", "4500")
    panel.style_bar.low_field.setText("1000")
    panel.style_bar.high_field.setText("2000")
    panel.style_bar.high_field.editingFinished.emit()
    ticks(window, panel)
    assert (panel.view.picture.scale.low, panel.view.picture.scale.high) == (1000.0, 2000.0)
    press(panel.style_bar.reset_button)
    ticks(window, panel)
    assert np.array_equal(shown(panel), usual)


def test_brightness_and_contrast_apply_to_a_frozen_image(panel, window) -> None:
    panel.show_topic(CAMERA)
    sends(window, panel, CAMERA, np.full((24, 32, 3), 100, np.uint8), "bgr8")
    assert panel.view.picture.scale is None
    assert not panel.style_bar.colour_map_choice.isEnabled()  # colour maps need a single-channel image
    panel.freeze.setChecked(True)
    panel.style_bar.brightness.setValue(panel.style_bar.brightness.maximum())
    ticks(window, panel)
    assert shown(panel)[..., :3].min() == 255
    panel.style_bar.brightness.reset.emit()  # like a double click
    panel.style_bar.contrast.setValue(0)
    ticks(window, panel)
    assert shown(panel)[0, 0, :3].tolist() == [125, 125, 125]


def test_display_settings_are_kept_per_topic_and_restored_with_the_layout(qtbot, panel, window) -> None:
    panel.show_topic(DEPTH)
    panel.style_bar.contrast.setValue(150)
    panel.style_button.setChecked(True)
    panel.overlays.set_visible(MARKS, is_visible=True)
    look = panel.style_bar.picture_style
    panel.show_topic(CAMERA)
    assert panel.style_bar.picture_style != look
    panel.show_topic(DEPTH)
    assert panel.style_bar.picture_style == look
    again = window.make(PANEL)
    qtbot.addWidget(again)
    assert isinstance(again, ImagePanel)
    again.restore_state(panel.save_state())
    assert again.style_bar.picture_style == look
    assert again.style_button.isChecked()
    assert again.overlays.selected_topics == (MARKS,)
    again.restore_state({"look": {"contrast": "much"}, "layers": [3], "topic": DEPTH})
    again.dispose()


def test_annotation_topics_are_offered_watched_while_selected_and_drawn(panel, window) -> None:
    panel.show_topic(CAMERA)
    assert panel.overlays.choices() == [MARKS, "/face_positions"]
    panel.overlays.set_visible(MARKS, is_visible=True)
    assert MARKS in window.session.watched
    sends(window, panel, CAMERA, np.zeros((240, 320, 3), np.uint8), "bgr8")
    assert panel.view.annotations == ()
    circle = {"position": {"x": 160, "y": 120}, "diameter": 80, "thickness": 4, "outline_color": RED}
    window.session.send(MARKS, {"circles": [{**circle, "fill_color": RED}]})
    ticks(window, panel)
    assert [each.kind for each in panel.view.annotations] == ["circle"]
    middle = panel.view.grab().toImage().pixelColor(panel.view.rect().center())
    assert (middle.red(), middle.green()) == (255, 0)
    window.session.send(MARKS, {"circles": "none"})
    ticks(window, panel)
    assert panel.view.annotations == ()
    panel.overlays.set_visible(MARKS, is_visible=False)
    assert MARKS not in window.session.watched
    for number in range(MAX_OVERLAYS + 3):
        panel.overlays.set_visible(f"/m{number}", is_visible=True)
    assert len(panel.overlays.selected_topics) == MAX_OVERLAYS


def painted(payload: object, turned: int = 0) -> QImage:
    image = QImage(320, 240, QImage.Format.Format_RGB32)
    image.fill(QColor("black"))
    painter = QPainter(image)
    shares = QTransform.fromScale(320, 240)
    if turned:
        shares = QTransform().translate(0.5, 0.5).rotate(turned).translate(-0.5, -0.5) * shares
    paint_annotations(painter, Theme("light"), shares, 1.0, parse_shapes(payload, 320, 240))
    painter.end()
    return image


def test_lines_polygons_points_and_texts_are_drawn_at_their_positions(qapp) -> None:
    line = {"type": 3, "points": [{"x": 0, "y": 120}, {"x": 320, "y": 120}], "thickness": 5}
    assert painted({"points": [{**line, "outline_color": RED}]}).pixelColor(200, 120).red() == 255
    area = {"type": 2, "points": [{"x": 10, "y": 10}, {"x": 90, "y": 10}, {"x": 90, "y": 90}]}
    image = painted({"points": [{**area, "fill_color": RED}]})
    assert (image.pixelColor(80, 20).red(), image.pixelColor(20, 80).red()) == (255, 0)
    image = painted({"points": [{**area, "fill_color": RED}]}, turned=180)
    assert (image.pixelColor(240, 220).red(), image.pixelColor(80, 20).red()) == (255, 0)
    point = {"type": 1, "points": [{"x": 50, "y": 60}], "outline_color": RED, "thickness": 6}
    assert painted({"points": [point]}).pixelColor(50, 60).red() == 255
    text = {"position": {"x": 100, "y": 100}, "text": "HHHH", "font_size": 30, "background_color": RED}
    assert painted({"texts": [text]}).pixelColor(102, 90).red() == 255
    face = {"face": {"center": {"x": 64, "y": 48}, "size": {"w": 320, "h": 240}}}
    assert painted(face).pixelColor(32, 80).red() > 100


def test_extreme_annotation_coordinates_are_painted_safely(qapp) -> None:
    far = {"x": MAX_COORDINATE_PX, "y": -MAX_COORDINATE_PX}
    huge = {
        "position": far,
        "diameter": MAX_COORDINATE_PX,
        "thickness": MAX_COORDINATE_PX,
        "outline_color": RED,
    }
    text = {"position": {"x": 5, "y": 5}, "text": "x" * 10_000, "font_size": MAX_COORDINATE_PX}
    image = painted({"circles": [huge], "points": [{"type": 3, "points": [far, far], "outline_color": RED}],
                     "texts": [text]})  # fmt: skip
    assert image.width() == 320


def test_colour_bar_has_the_maximum_on_top_and_is_hidden_when_space_is_short(qapp) -> None:
    colours = np.zeros((256, 3), np.uint8)
    colours[:, 0] = np.arange(256)
    scale = ColourScale(-1.5, 2500.0, colours)
    bar = bar_image(scale)
    assert (bar.pixelColor(0, 0).red(), bar.pixelColor(0, 255).red()) == (255, 0)
    for height, is_there in ((300, True), (60, False)):
        image = QImage(300, height, QImage.Format.Format_RGB32)
        image.fill(QColor("blue"))
        painter = QPainter(image)
        paint_colour_bar(painter, Theme("light"), QRectF(image.rect()), scale)
        painter.end()
        changed = any(image.pixelColor(x, 20).blue() < 200 for x in range(150, 300))
        assert changed is is_there
        assert image.pixelColor(QPointF(20, 20).toPoint()).blue() == 255
