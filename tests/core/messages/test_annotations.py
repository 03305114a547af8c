"""Tests of annotations on images: normalized positions, and no values that can't be painted."""

from __future__ import annotations

import pytest

from app.core.messages.annotations import MAX_POINTS, MAX_SHAPES, is_annotation, parse_shapes

RED = {"r": 1, "g": 0, "b": 0, "a": 1}
CLEAR = {"r": 1, "g": 1, "b": 1, "a": 0}


def points(kind: object, count: int = 4, **more: object) -> dict[str, object]:
    made = {"type": kind, "points": [{"x": 32 * n, "y": 24 * n} for n in range(count)], "thickness": 3}
    return {"points": [{**made, "outline_color": RED, **more}]}


def test_circles_and_texts_are_drawn_at_their_positions() -> None:
    payload = {
        "circles": [
            {"position": {"x": 160, "y": 120}, "diameter": 64, "thickness": 2, "outline_color": RED,
             "fill_color": CLEAR},
        ],
        "texts": [
            {"position": {"x": 32, "y": 48}, "text": " two\nlines ", "font_size": 24, "text_color": RED},
        ],
    }  # fmt: skip
    circle, text = parse_shapes(payload, 320, 240)
    assert (circle.kind, circle.points, circle.size) == ("circle", ((0.5, 0.5),), (0.1, 64 / 480))
    assert (circle.outline, circle.fill, circle.thickness) == ((1, 0, 0, 1), None, 2)
    assert (text.kind, text.points, text.text) == ("text", ((0.1, 0.2),), "two lines")
    assert text.size == (0.0, 0.1)
    assert is_annotation(payload)


@pytest.mark.parametrize(
    ("kind", "kinds"),
    [
        (1, ["points"]),
        (2, ["area"]),
        (3, ["line"]),
        (4, ["line", "line"]),
        (0, []),
        (9, []),
        ("2", []),
        (None, []),
    ],
)
def test_points_are_drawn_as_points_or_lines_by_type(kind, kinds) -> None:
    assert [each.kind for each in parse_shapes(points(kind), 320, 240)] == kinds


def test_points_and_line_segments_have_individual_colours() -> None:
    colours = [{**RED, "g": n / 4} for n in range(4)]
    greens = [each.outline[1] for each in parse_shapes(points(1, outline_colors=colours), 320, 240)]  # type: ignore[index]
    assert greens == [0, 0.25, 0.5, 0.75]
    greens = [each.outline[1] for each in parse_shapes(points(4, outline_colors=colours[1:3]), 320, 240)]  # type: ignore[index]
    assert greens == [0.25, 0.5]


def test_rize_face_is_drawn_as_box_in_its_own_frame() -> None:
    payload = {"face": {"center": {"x": 320, "y": 120}, "size": {"w": 64, "h": 48}, "box": {}}}
    (face,) = parse_shapes(payload, 1280, 960)
    assert face.points == ((0.5, 0.25), (0.6, 0.25), (0.6, 0.35), (0.5, 0.35))
    assert face.text == "face"
    assert is_annotation(payload)
    assert parse_shapes({"positions": []}, 1280, 960) == ()
    assert is_annotation({"positions": []})


@pytest.mark.parametrize(
    "payload",
    [
        None,
        [],
        "text",
        {"circles": 7, "points": "no", "texts": b"bytes"},
        {"circles": [None, 3, {}, {"position": {"x": "1", "y": 2}, "diameter": 4}]},
        {"circles": [{"position": {"x": float("nan"), "y": 2}, "diameter": 4}]},
        {"circles": [{"position": {"x": 1, "y": 2}, "diameter": -4}]},
        {"circles": [{"position": {"x": 1e300, "y": 2}, "diameter": 4}]},
        {"circles": [{"position": {"x": 1, "y": 2}, "diameter": 10**400}]},
        {"points": [{"type": 2, "points": [{"x": 1, "y": 1}]}]},
        {"points": [{"type": 4, "points": [{"x": True, "y": 1}] * 9}]},
        {"texts": [{"position": {"x": 1, "y": 1}, "text": "  "}, {"position": {}, "text": "a"}]},
        {"face": {"center": {"x": 1, "y": 1}, "size": {"w": 0, "h": 5}}},
        {"face": [1, 2]},
    ],
)
def test_message_without_valid_annotations_draws_nothing(payload) -> None:
    assert parse_shapes(payload, 320, 240) == ()


def test_number_of_drawn_shapes_and_points_is_limited() -> None:
    many = [{"position": {"x": 1, "y": 1}, "diameter": 2, "outline_color": RED}] * (MAX_SHAPES + 50)
    assert len(parse_shapes({"circles": many}, 320, 240)) == MAX_SHAPES
    (line,) = parse_shapes(points(3, MAX_POINTS + 50), 320, 240)
    assert len(line.points) == MAX_POINTS
    assert parse_shapes({"circles": many[:1]}, 0, 240) == ()
