"""Tests of the input controls of typed values: validation, keyboard and wheel, images, colours, angles."""

from __future__ import annotations

import base64
import os
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QImage, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget

from app.robots.description.inputs import Choice as Option
from app.robots.description.inputs import Parameter, parameter_of
from app.robots.description.model import Action
from app.ui.panels.robots.robots.controls.angle import AngleDial
from app.ui.panels.robots.robots.controls.colour import ColourChoice, ColourSwatches, HueStrip
from app.ui.panels.robots.robots.controls.picture import EmptyImageSource, PictureChoice
from app.ui.panels.robots.robots.controls.picture_file import MAX_FILE_BYTES, encode_image, read_picture
from app.ui.panels.robots.robots.form import ActionForm
from app.ui.theme.theme import Theme
from app.ui.widgets import SliderWithUnit
from app.ui.widgets.inputs.fields import MIN_HEIGHT, LongTextField
from app.ui.widgets.menus import Menu
from tests.nep.bad_pictures import BOMBS, chunk, exif, segment
from tests.ui import fakes
from tests.ui.sample_data import picture

KEEP = Option(0, "keep"), Option(1, "turn")


@pytest.fixture
def theme(qapp) -> Theme:
    return Theme("light")


def form_of(qtbot, theme: Theme, *parameters: Parameter, pictures: object = None) -> ActionForm:
    action = Action("do", "do it", "bot", "Movement", parameters, "%robot do", None, "/c", "/a")
    made = ActionForm(theme, action, pictures=pictures)  # type: ignore[arg-type]
    qtbot.addWidget(made)
    made.resize(560, 300)
    made.show()
    qtbot.waitExposed(made)
    return made


def child(form: ActionForm, kind: type) -> object:
    found = form.findChild(kind)
    assert found is not None
    return found


def wheel(widget: QWidget, notches: int = 1) -> None:
    at = QPointF(widget.rect().center())
    none = QPoint()
    turned = QPoint(0, 120 * notches)
    keys, buttons = Qt.KeyboardModifier.NoModifier, Qt.MouseButton.NoButton
    phase = Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(at, widget.mapToGlobal(at), none, turned, buttons, keys, phase, False)
    QApplication.sendEvent(widget, event)


# ---- entered text is kept --------------------------------------------------------------------------


def test_out_of_range_number_is_returned_by_the_form_unclamped_and_reported(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("d", "distance", "number", -1, 1, 0.05, "m", 0.5))
    slider = child(form, SliderWithUnit)
    slider.field.setFocus()
    slider.field.selectAll()
    QTest.keyClicks(slider.field, "12")
    assert form.input() == {"d": 12.0}  # also while the field has the focus
    assert form.action.check(form.input()) == ("do: distance must be between -1 and 1 m",)
    QTest.keyClick(slider.field, Qt.Key.Key_Return)
    assert slider.field.text() == "12"
    form.show_problems(form.action.problems(form.input()))
    shown = [text for text in (slider._error_label.text(), form._error_labels["d"].text()) if text]
    assert shown == ["The maximum is 1 m."]  # reported only once
    assert slider.field.property("wrong") == "true"


@pytest.mark.parametrize(
    ("typed", "given"), [("two", "two"), ("2,5", 2.5), ("1.234,5", "1.234,5"), ("", None)]
)
def test_number_field_returns_numbers_and_keeps_invalid_text(qtbot, theme, typed, given) -> None:
    form = form_of(qtbot, theme, Parameter("x", "x", "number", minimum=0))
    field = child(form, QLineEdit)
    QTest.keyClicks(field, typed)
    assert form.input() == ({} if given is None else {"x": given})
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert field.text() == (typed if given != 2.5 else field.text())
    assert bool(field.problem) is isinstance(given, str)


def test_integer_field_rejects_a_fraction_with_a_sentence(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("n", "count", "integer", 0, 9, default=2))
    slider = child(form, SliderWithUnit)
    slider.field.setText("2.5")
    assert form.action.check(form.input()) == ("do: count must be a whole number",)


def test_arrow_and_page_keys_step_a_number_not_below_its_minimum(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("n", "count", "integer", minimum=0, default=2))
    field = child(form, QLineEdit)
    for key in (Qt.Key.Key_Up, Qt.Key.Key_Up, Qt.Key.Key_PageUp, Qt.Key.Key_Down):
        QTest.keyClick(field, key)
    assert form.input() == {"n": 13}
    for _ in range(3):
        QTest.keyClick(field, Qt.Key.Key_PageDown)
    assert form.input() == {"n": 0}  # not below the minimum


def test_text_that_is_too_long_is_kept_and_reported_when_editing_ends(qtbot, theme) -> None:
    form = form_of(
        qtbot,
        theme,
        Parameter("t", "text", "text", max_length=5, is_required=True),
        Parameter("o", "other", "text"),
    )
    first, second = form.findChildren(QLineEdit)
    assert second.placeholderText() == "Optional"
    QTest.keyClicks(first, "too long")
    QTest.keyClick(first, Qt.Key.Key_Return)
    assert form._error_labels["t"].isVisible()
    assert form._error_labels["t"].text() == "Text must be at most 5 characters long."
    assert first.text() == "too long"
    QTest.keyClick(first, Qt.Key.Key_Backspace)
    assert not form._error_labels["t"].isVisible()


def test_zero_is_a_valid_choice_and_an_invalid_advanced_value_shows_its_row(qtbot, theme) -> None:
    form = form_of(
        qtbot,
        theme,
        Parameter("how", "how", "choice", choices=KEEP, default=0),
        Parameter("s", "speed", "number", 0, 1, default=0.5, is_advanced=True),
    )
    assert form.input() == {"how": 0, "s": 0.5}
    slider = child(form, SliderWithUnit)
    slider.field.setText("7")
    assert not slider.isVisible()
    form.show_problems(form.action.problems(form.input()))
    assert slider.isVisible()


# ---- long texts ------------------------------------------------------------------------------------


def test_text_field_grows_to_at_most_five_lines(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("t", "text", "text", max_length=500, is_required=True))
    field = child(form, LongTextField)
    one = field.height()
    assert one >= MIN_HEIGHT
    field.set_text("a\nb\nc")
    three = field.height()
    field.set_text("\n".join("abcdefgh"))
    five = field.height()
    assert one < three < five < 2 * three
    field.set_text("word " * 60)  # wraps
    assert field.height() > one
    assert form.input() == {"t": "word " * 60}


# ---- keys, wheel and double click ------------------------------------------------------------------


def test_slider_supports_home_end_and_double_click(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("v", "volume", "integer", 0, 100, 5, "%", 60))
    track = child(form, SliderWithUnit).track
    for key, expected in [(Qt.Key.Key_End, 100), (Qt.Key.Key_Home, 0), (Qt.Key.Key_Right, 5)]:
        QTest.keyClick(track, key)
        assert form.input() == {"v": expected}
    QTest.keyClick(track, Qt.Key.Key_PageUp)
    assert form.input() == {"v": 55}
    QTest.mouseDClick(track, Qt.MouseButton.LeftButton, pos=track.rect().center())
    assert form.input() == {"v": 60}


def test_angle_is_changed_by_keys_dial_and_wheel_only_with_focus(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("a", "angle", "angle", -360, 360, 5, "°", 90))
    dial, slider = child(form, AngleDial), child(form, SliderWithUnit)
    wheel(dial)
    assert form.input() == {"a": 90.0}
    dial.setFocus()
    qtbot.waitUntil(dial.hasFocus)
    wheel(dial)
    assert form.input() == {"a": 95.0}
    for key, expected in [
        (Qt.Key.Key_Home, -360.0), (Qt.Key.Key_End, 360.0), (Qt.Key.Key_Right, 355.0),
        (Qt.Key.Key_Left, 360.0), (Qt.Key.Key_PageDown, 310.0),
    ]:  # fmt: skip
        QTest.keyClick(dial, key)
        assert (form.input(), slider.value, dial.value) == ({"a": expected}, expected, expected)
    QTest.mouseDClick(dial, Qt.MouseButton.LeftButton)
    assert form.input() == {"a": 90.0}
    slider.track.setFocus()
    QTest.keyClick(slider.track, Qt.Key.Key_Home)
    assert dial.value == -360.0  # the dial follows the slider


def test_dragging_an_angle_dial_around_adds_full_turns_up_to_the_limit(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("a", "angle", "angle", -360, 360, 5, "°", 0))
    dial = child(form, AngleDial)
    middle, reach = dial.rect().center(), dial.width() // 2 - 3

    def at(angle_deg: float) -> QPoint:
        away = dial.direction(angle_deg) * reach
        return middle + QPoint(round(away.x()), round(away.y()))

    QTest.mousePress(dial, Qt.MouseButton.LeftButton, pos=at(0))
    for angle in range(30, 421, 30):
        QTest.mouseMove(dial, at(angle))
        QApplication.processEvents()
    assert form.input() == {"a": 360.0}
    QTest.mouseRelease(dial, Qt.MouseButton.LeftButton, pos=at(420))
    assert dial.direction(90).x() == pytest.approx(-1)  # left of the robot is left in the drawing, too


def test_pitch_angle_is_drawn_from_the_side(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("pitch", "down", "angle", -40, 36, 2, "°", 8))
    assert child(form, AngleDial).direction(30).y() > 0.4  # positive pitch points down


# ---- colours ---------------------------------------------------------------------------------------


def test_colour_swatches_emit_the_pressed_colour(qtbot, theme) -> None:
    swatches = ColourSwatches(theme, "#3AB7FF")
    qtbot.addWidget(swatches)
    told: list[str] = []
    swatches.changed.connect(told.append)
    assert (swatches.value, swatches._name.text()) == ("#3ab7ff", "sky blue")
    swatches._swatches["#ff6b5e"].click()
    swatches._swatches["#ff6b5e"].click()
    assert (swatches.value, swatches._name.text(), told) == ("#ff6b5e", "coral", ["#ff6b5e"])
    swatches.set_value("#102030")
    assert (swatches.value, swatches._name.text()) == ("#102030", "#102030")
    swatches.set_value("no colour")
    assert (swatches.value, told) == ("#102030", ["#ff6b5e"])


def test_custom_colour_is_selected_from_the_strip_or_by_hex_code(qtbot, theme) -> None:
    form = form_of(qtbot, theme, Parameter("c", "colour", "colour", default="#35c26b"))
    choice, strip = child(form, ColourChoice), child(form, HueStrip)
    assert not strip.isVisible()
    QTest.mouseClick(choice.other, Qt.MouseButton.LeftButton)
    assert strip.isVisible()
    QTest.mouseClick(strip, Qt.MouseButton.LeftButton, pos=QPoint(2, strip.height() // 2))
    red, green, blue = (int(form.input()["c"][at : at + 2], 16) for at in (1, 3, 5))
    assert red > 150 > max(green, blue)
    choice.field.selectAll()
    QTest.keyClicks(choice.field, "#00ff")
    assert form.input() == {"c": "#00ff"}  # returned as typed
    assert form.action.check(form.input())
    QTest.keyClick(choice.field, Qt.Key.Key_Return)
    assert "#33aaff" in choice._error_label.text()
    QTest.keyClicks(choice.field, "80")
    assert form.input() == {"c": "#00ff80"}
    assert not choice._error_label.isVisible()


# ---- images ----------------------------------------------------------------------------------------


class Cameras:
    def __init__(self) -> None:
        self.images = fakes.Images()
        self.made = self.images.stream("/Pepper/camera")

    def send(self, width: int, height: int) -> None:
        """Offer a camera image of this size in pixels."""
        message = picture(width, height).message
        assert message is not None
        self.images.offer([fakes.on_topic(message, "/Pepper/camera")])

    def topics(self) -> Sequence[str]:
        return ["/Pepper/camera"]

    def open_stream(self, topic: str) -> fakes.ImageStream:
        assert topic == "/Pepper/camera"
        return self.made


def decoded(value: object) -> QImage:
    assert isinstance(value, str)
    head, _, body = value.partition(",")
    assert head == "data:image/jpeg;base64"
    return QImage.fromData(base64.b64decode(body))


def drawn(path: Path, width: int, height: int) -> Path:
    image = QImage(width, height, QImage.Format.Format_RGB32)
    image.fill(Qt.GlobalColor.red)
    assert image.save(str(path))
    return path


def test_image_file_is_previewed_and_sent_as_base64_at_most_1280_px_wide(qtbot, theme, tmp_path) -> None:
    form = form_of(qtbot, theme, Parameter("p", "picture", "image", is_required=True))
    assert form.input() == {}
    assert form.action.check(form.input()) == ("do: picture is missing",)
    choice = child(form, PictureChoice)
    choice.use_file(drawn(tmp_path / "red.png", 2560, 640))
    sent = decoded(form.input()["p"])
    assert (sent.width(), sent.height()) == (1280, 320)
    assert sent.pixelColor(5, 5).red() > 240
    assert choice.thumbnail.image is not None
    assert choice.field.text() == "red.png"


def test_file_that_is_not_an_image_is_reported_and_not_sent(qtbot, theme, tmp_path) -> None:
    form = form_of(qtbot, theme, Parameter("p", "picture", "image"))
    choice = child(form, PictureChoice)
    (tmp_path / "not.png").write_text("hello")
    choice.use_file(tmp_path / "not.png")
    assert choice.error_text == "“not.png” can't be used: not a JPEG or PNG image."
    assert choice.thumbnail.image is None
    assert read_picture(tmp_path / "none.png")[1] == "“none.png” can't be read: no such file or directory."
    with (tmp_path / "big.png").open("wb") as big:
        big.truncate(MAX_FILE_BYTES + 1)
    assert "too large" in read_picture(tmp_path / "big.png")[1]


@pytest.mark.parametrize("name", ["bmp", "gif", "svg", "png of many pixels", "jpeg of a thousand passes"])
def test_decompression_bomb_is_rejected_as_file_and_as_url(qtbot, theme, tmp_path, name) -> None:
    form = form_of(qtbot, theme, Parameter("p", "picture", "image"))
    choice = child(form, PictureChoice)
    (tmp_path / "photo.png").write_bytes(BOMBS[name])
    choice.use_file(tmp_path / "photo.png")
    assert choice.error_text.startswith("“photo.png” can't be used: ")
    assert choice.thumbnail.image is None
    choice.set_value("data:image/png;base64," + base64.b64encode(BOMBS[name]).decode())
    assert choice.thumbnail.image is None
    choice.set_value("data:image/png;base64,é")  # not base64 at all
    assert choice.thumbnail.image is None


def test_image_button_opens_the_file_dialog_in_the_last_folder(theme, qtbot, tmp_path) -> None:
    folders: list[str] = []

    class Asked(EmptyImageSource):
        def prompt_file(self, folder, take) -> None:
            folders.append(folder)
            take(tmp_path / "no.png")

    choice = PictureChoice(theme, Parameter("p", "picture", "image"), Asked())
    qtbot.addWidget(choice)
    choice.choose.click()
    assert choice.field.text() == str(tmp_path / "no.png")
    assert choice.error_text
    choice.choose.click()
    assert folders == ["", str(tmp_path)]


def test_folder_and_pipe_are_not_opened_as_an_image(tmp_path) -> None:
    assert read_picture(tmp_path)[1] == f"“{tmp_path.name}” isn't a file."
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.png")
        assert read_picture(tmp_path / "pipe.png")[1] == "“pipe.png” isn't a file."


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["jpeg", "png"])
def test_photo_is_rotated_by_its_exif_orientation(qapp, tmp_path, kind, orientation) -> None:
    frame = np.zeros((32, 64, 3), np.uint8)
    frame[:16, :16] = 255
    data = cv2.imencode(f".{kind}", frame)[1].tobytes()
    told = exif(orientation)
    if kind == "jpeg":
        data = data[:2] + segment(0xE1, told) + data[2:]
    else:
        data = data[:33] + chunk(b"eXIf", told[6:]) + data[33:]
    (tmp_path / "photo").write_bytes(data)
    image, _ = read_picture(tmp_path / "photo")
    assert image is not None
    wanted = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert (image.height(), image.width()) == wanted.shape[:2]
    for y, x in ((4, 4), (4, image.width() - 4), (image.height() - 4, 4)):
        assert (image.pixelColor(x, y).red() > 128) == (wanted[y, x, 2] > 128)


def test_cameras_are_offered_in_a_menu(qtbot, theme, monkeypatch) -> None:
    dropped: list[Menu] = []
    monkeypatch.setattr(
        "app.ui.panels.robots.robots.controls.picture.open_below", lambda menu, _below: dropped.append(menu)
    )
    form = form_of(qtbot, theme, Parameter("p", "picture", "image"), pictures=Cameras())
    choice = child(form, PictureChoice)
    QTest.mouseClick(choice.camera, Qt.MouseButton.LeftButton)
    (camera,) = dropped[0].actions()
    camera.trigger()
    assert choice.field.text() == "newest image of /Pepper/camera"


def test_form_returns_the_newest_image_of_the_selected_topic(qtbot, theme) -> None:
    cameras = Cameras()
    form = form_of(qtbot, theme, Parameter("p", "picture", "image"), pictures=cameras)
    choice = child(form, PictureChoice)
    choice.use_topic("/Pepper/camera")
    assert form.input() == {}  # no image received yet
    cameras.send(320, 240)
    qtbot.waitUntil(lambda: choice.thumbnail.image is not None)
    cameras.send(160, 120)
    sent = decoded(form.input()["p"])
    assert (sent.width(), sent.height()) == (160, 120)
    cameras.made.suspend()
    cameras.made.resume()  # the panel was hidden: its image may be outdated
    assert form.input() == {}
    cameras.send(160, 120)
    assert decoded(form.input()["p"]).width() == 160
    form.dispose()
    assert not choice._timer.isActive()


def test_url_is_sent_unchanged_and_bare_base64_where_the_robot_expects_it(qtbot, theme, tmp_path) -> None:
    form = form_of(qtbot, theme, Parameter("p", "picture", "image"))
    choice = child(form, PictureChoice)
    QTest.keyClicks(choice.field, "http://robot/cat.png")
    assert form.input() == {"p": "http://robot/cat.png"}
    schema = {"type": "string", "contentEncoding": "base64", "contentMediaType": "image/jpeg"}
    bare = parameter_of("p", schema)
    assert (bare.kind, bare.is_bare_base64) == ("image", True)
    image = QImage(str(drawn(tmp_path / "red.png", 32, 24)))
    assert QImage.fromData(base64.b64decode(encode_image(image, omit_prefix=True))).width() == 32
    linked = parameter_of("p", {"type": "string", "format": "uri-reference", "rb:widget": "image"})
    assert (linked.kind, linked.is_bare_base64) == ("image", False)


# ---- lists and objects -----------------------------------------------------------------------------


def test_number_list_and_object_fields_are_parsed_and_validated(qtbot, theme) -> None:
    speeds = parameter_of("speeds", {"type": "array", "items": {"type": "number"}}, is_required=True)
    pose = parameter_of("pose", {"type": "object", "properties": {"x": {"type": "number"}}}, is_required=True)
    form = form_of(qtbot, theme, speeds, pose)
    first, second = form.findChildren(QLineEdit)
    assert first.placeholderText() == "Numbers separated by commas"
    assert second.placeholderText() == '{"x": …}'
    first.setText("1, 2.5")
    second.setText('{"x": 3}')
    assert form.input() == {"speeds": [1, 2.5], "pose": {"x": 3}}
    assert form.action.check(form.input()) == ()
    first.setText("1, far")
    second.setText("{x")
    assert form.action.check(form.input()) == (
        "do: speeds value 2 must be a number",
        "do: pose must be an object with named values",
    )
