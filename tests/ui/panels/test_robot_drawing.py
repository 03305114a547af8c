from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QImage, QPainter

from app.ui.robot_drawing.bubble import paint_bubble, scroll_to_spoken, wrap_text
from app.ui.robot_drawing.pepper import EMOTIONS
from app.ui.robot_drawing.room import Spot, Stage
from app.ui.robot_drawing.scene import PREVIEW_STATE, RobotDrawing
from app.ui.robot_drawing.state import RobotState, RoomBounds, Thing
from tests.ui.sample_data import drawing

AREA = QRectF(0, 0, 382, 286)


def painted(state: RobotState, area: QRectF = AREA, *, dark: bool = False) -> QImage:
    image = QImage(area.size().toSize(), QImage.Format.Format_RGB32)
    image.fill(QColor("magenta"))
    painter = QPainter(image)
    RobotDrawing().paint(painter, area, state, is_dark=dark)
    painter.end()
    return image


def differing(first: QImage, second: QImage) -> int:
    """Return the number of differing pixels, sampled at every third row and column."""
    return sum(
        first.pixel(x, y) != second.pixel(x, y)
        for x in range(0, first.width(), 3)
        for y in range(0, first.height(), 3)
    )


@pytest.mark.parametrize(
    "change",
    [
        {"x": 1.5}, {"y": 1.0}, {"theta_deg": 30.0}, {"theta_deg": 90.0}, {"theta_deg": 180.0},
        {"head_yaw_deg": 40.0}, {"head_pitch_deg": 20.0}, {"speech": "Hello"}, {"eyes": "#ff0000"},
        {"shoulders": "#00ff00"}, {"arm_left_deg": 90.0}, {"arm_right_deg": 180.0}, {"is_moving": True},
        {"touched_parts": ("head",)}, {"objects": (Thing("ball", 0, 1),)},
            {"objects": (Thing("person", -2, 1, "Aiko"),)},
        {"objects": (Thing("person", 2, 0, "Aiko"),)}, {"objects": (Thing("marker", -2, 1),)},
    ],
    ids=str,
)  # fmt: skip
def test_each_part_of_the_state_is_drawn(qapp, change) -> None:
    plain = RobotState()
    assert differing(painted(plain), painted(replace(plain, **change))) > 0


def test_each_emotion_has_a_different_face(qapp) -> None:
    faces = {}
    for emotion in ("neutral", "happy", "sad", "surprised", "angry", "thinking", "sleepy"):
        assert emotion in EMOTIONS
        image = painted(RobotState(emotion=emotion))
        faces[emotion] = bytes(image.constBits())
    assert len(set(faces.values())) == len(faces)
    assert painted(RobotState(emotion="a word nobody knows")) == painted(RobotState())


def test_equal_states_give_equal_drawings(qapp) -> None:
    assert painted(PREVIEW_STATE) == painted(PREVIEW_STATE)


@pytest.mark.parametrize("size", [(382, 286), (900, 200), (200, 700), (40, 30)])
def test_drawing_fills_any_area(qapp, size) -> None:
    image = painted(PREVIEW_STATE, QRectF(0, 0, *size))
    corners = [(0, 0), (size[0] - 1, 0), (0, size[1] - 1), (size[0] - 1, size[1] - 1)]
    assert all(image.pixelColor(x, y) != QColor("magenta") for x, y in corners)


def test_drawing_is_dimmed_in_the_dark_theme(qapp) -> None:
    light, dark = painted(PREVIEW_STATE), painted(PREVIEW_STATE, dark=True)
    assert dark.pixelColor(5, 5).lightness() < light.pixelColor(5, 5).lightness()


def test_left_turn_of_the_robot_is_drawn_to_the_right_of_the_viewer(qapp) -> None:
    def eyes(theta_deg: float) -> list[int]:
        image = painted(RobotState(theta_deg=theta_deg, eyes="#ff00ff", shoulders="#ffffff"))
        return [
            x
            for x in range(image.width())
            for y in range(image.height())
            if image.pixelColor(x, y) == QColor("#ff00ff")
        ]

    front, left, right = eyes(0), eyes(40), eyes(-40)
    assert sum(left) / len(left) > sum(front) / len(front) > sum(right) / len(right)
    assert eyes(180) == []


@pytest.mark.parametrize("part", ["head", "left_hand", "right_hand", "ball"])
@pytest.mark.parametrize("size", [(382, 286), (700, 300)])
def test_hit_test_finds_parts_at_their_drawn_position(qapp, part, size) -> None:
    area, pen = QRectF(0, 0, *size), RobotDrawing()
    state = replace(PREVIEW_STATE, arm_left_deg=100.0)
    place = pen.point_of(part, area, state)
    assert place is not None
    assert pen.part_at(place, area, state) == part
    assert pen.part_at(QPointF(2, 2), area, state) is None
    assert pen.point_of("nobody", area, state) is None


@pytest.mark.parametrize("place", [(0.0, 0.0), (-2.0, 1.5), (2.4, -2.0), (1.2, 0.3)])
def test_floor_position_is_mapped_back_from_the_screen(place) -> None:
    stage = Stage(AREA, RoomBounds())
    spot = stage.spot_at(*place)
    x, y = stage.floor_at(stage.origin + QPointF(spot.u, spot.v) * stage.scale)
    assert (x, y) == (pytest.approx(place[0]), pytest.approx(place[1]))


def test_nearer_objects_are_lower_and_larger() -> None:
    stage = Stage(AREA, RoomBounds())
    far, near = stage.spot_at(-2, 0), stage.spot_at(2, 0)
    assert near.v > far.v
    assert near.scale > far.scale
    assert stage.spot_at(0, 2).u > stage.spot_at(0, -2).u


def test_message_is_parsed_into_a_state_and_invalid_fields_keep_their_defaults() -> None:
    state = RobotState.parse(drawing(x=1.5, touched=["head"], speech="  "))
    assert (state.x, state.touched_parts, state.speech) == (1.5, ("head",), None)
    assert state.objects[0].kind == "ball"
    assert state.room == RoomBounds(-3, 3, -2.5, 2.5)
    broken = RobotState.parse(
        {"x": "far", "eyes": "blue", "objects": "none", "room": {"width": 0}, "emotion": None}
    )
    assert broken == RobotState()
    room = RobotState.parse({"room": {"x_min": -1, "x_max": 3, "y_min": -2, "y_max": 2}}).room
    assert room == RoomBounds(-1, 3, -2, 2)


LONG = "Once upon a time there was a small robot. " * 11 + "end"


@pytest.mark.parametrize("width", [60.0, 140.0, 300.0])
@pytest.mark.parametrize("words", ["Hello", LONG, "x" * 300, "a " * 200, f"{'y' * 80} and {'z' * 3}"])
def test_wrapped_speech_keeps_all_words_within_the_bubble(qapp, words, width) -> None:
    metrics = QFontMetricsF(QFont())
    lines = wrap_text(words, metrics, width)
    assert "".join(lines).replace(" ", "") == words.replace(" ", "")
    assert all(metrics.horizontalAdvance(line) <= width for line in lines)


def test_long_speech_scrolls_with_the_spoken_line() -> None:
    lines = [f"line {number:02}" for number in range(20)]
    seen: dict[str, None] = {}
    for step in range(101):
        text = scroll_to_spoken(lines, 6, step / 100)
        spoken = lines[min(19, int(step / 100 * 20))]
        assert spoken in text.visible_lines
        assert len(text.visible_lines) == 6
        seen.update(dict.fromkeys(text.visible_lines))
    assert list(seen) == lines
    assert scroll_to_spoken(lines, 6, 0.0).first == 0
    assert scroll_to_spoken(["one"], 6, 0.5).visible_lines == ["one"]
    assert len(scroll_to_spoken(lines, 0, 0.5).visible_lines) == 1


@pytest.mark.parametrize("size", [(382, 286), (900, 300), (200, 150)])
@pytest.mark.parametrize("place", [(0.0, 0.0), (2.5, 2.4), (2.5, -2.4), (-2.5, 0.0)])
def test_long_bubble_stays_inside_the_drawing_and_scrolls(qapp, size, place) -> None:
    area = QRectF(0, 0, *size)
    told = RobotState(x=place[0], y=place[1], speech=LONG)
    begun, ended = (painted(replace(told, spoken_fraction=spoken), area) for spoken in (0.0, 1.0))
    assert differing(begun, ended) > 0
    edges = [(x, y) for x in (0, size[0] - 1) for y in range(size[1])]
    silent = painted(replace(told, speech=None), area)
    assert all(begun.pixel(*at) == silent.pixel(*at) for at in edges)


@pytest.mark.parametrize("apart", [0.0, 20.0, 60.0, 150.0])
def test_bubbles_of_adjacent_robots_do_not_overlap(qapp, apart) -> None:
    image = QImage(382, 286, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    first = paint_bubble(
        painter, AREA, Spot(150.0, 110.0, 1.0), RobotState(speech="I like to tell long stories"), QFont()
    )
    second = paint_bubble(
        painter, AREA, Spot(150.0 + apart, 110.0, 1.0), RobotState(sound="bell"), QFont(), [first]
    )
    painter.end()
    assert not first.intersects(second)
    assert AREA.contains(second)
