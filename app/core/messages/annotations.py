"""Image annotations in JSON messages: `foxglove.ImageAnnotations`, and RIZE's `face_positions`.

Positions are fractions of the image's width and height, independent of the displayed size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from nep.i18n import _
from nep.text import shortened

MAX_SHAPES = 2000
MAX_POINTS = 20_000
MAX_TEXT_LENGTH = 200
MAX_COORDINATE_PX = 1e6
"""Maximum coordinate and size in pixels.

Larger shapes are skipped, because graphics libraries don't support them.
"""
FACE_FRAME = (640, 480)
"""Width and height of the images in which RIZE detects faces."""
POINTS, LINE_LOOP, LINE_STRIP, LINE_LIST = 1, 2, 3, 4

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each 0 to 1."""
Point = tuple[float, float]
YELLOW: Colour = (1.0, 0.77, 0.24, 1.0)


@dataclass(frozen=True, slots=True)
class AnnotationShape:
    """Shape to draw. Positions are fractions of the image's width and height.

    Attributes:
        kind: "points", "line", "area" (closed), "circle" or "text".
        points: Vertices; the centre of a circle, the lower left corner of a text.
        outline: Colour of the outline; None for no outline.
        fill: Fill colour; None for no fill.
        thickness: Width of the outline in pixels of the image.
        size: Radius of a circle as fractions of width and height; height of a text as a fraction.
        text: Text to draw.
    """

    kind: str
    points: tuple[Point, ...]
    outline: Colour | None = None
    fill: Colour | None = None
    thickness: float = 1.0
    size: Point = (0.0, 0.0)
    text: str = ""


def is_annotation(payload: object) -> bool:
    """Return True if a decoded message may contain annotations."""
    if not isinstance(payload, Mapping):
        return False
    lists = (payload.get(name) for name in ("circles", "points", "texts"))
    return any(_is_list(each) for each in lists) or _parse_face(payload) is not None or "positions" in payload


def parse_shapes(payload: object, width: int, height: int) -> tuple[AnnotationShape, ...]:
    """Return the shapes in a decoded message; invalid shapes are skipped.

    Args:
        payload: Decoded message.
        width: Width of the image in pixels.
        height: Height of the image in pixels.
    """
    if not isinstance(payload, Mapping) or width <= 0 or height <= 0:
        return ()
    frame = _Frame(width, height)
    return tuple(islice(_all_shapes(payload, frame), MAX_SHAPES))


class _Frame:
    """Conversion from pixels to fractions of the image, with a limit on the total number of points."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self.remaining_points = MAX_POINTS

    def point(self, value: object) -> Point | None:
        if not isinstance(value, Mapping):
            return None
        x, y = _number(value.get("x")), _number(value.get("y"))
        if x is None or y is None:
            return None
        self.remaining_points -= 1
        return x / self.width, y / self.height


def _all_shapes(payload: Mapping[str, object], frame: _Frame) -> Iterator[AnnotationShape]:
    parsers = (("circles", _parse_circle), ("points", _parse_points), ("texts", _parse_text))
    for name, parse_item in parsers:
        for item in _items(payload.get(name)):
            if isinstance(item, Mapping) and frame.remaining_points > 0:
                yield from parse_item(item, frame)
    face = _parse_face(payload)
    if face is not None:
        yield from face


def _parse_circle(item: Mapping[str, object], frame: _Frame) -> Iterator[AnnotationShape]:
    centre, diameter = frame.point(item.get("position")), _number(item.get("diameter"))
    if centre is None or diameter is None or diameter <= 0:
        return
    size = diameter / 2 / frame.width, diameter / 2 / frame.height
    outline, fill = _colour(item.get("outline_color")), _colour(item.get("fill_color"))
    yield AnnotationShape("circle", (centre,), outline, fill, _thickness(item), size)


def _parse_points(item: Mapping[str, object], frame: _Frame) -> Iterator[AnnotationShape]:
    kind = _number(item.get("type")) or 0
    parsed_points = (
        frame.point(value) for value in islice(_items(item.get("points")), frame.remaining_points)
    )
    points, thickness = tuple(point for point in parsed_points if point is not None), _thickness(item)
    outline, fill = _colour(item.get("outline_color")), _colour(item.get("fill_color"))
    point_colours = [_colour(colour) for colour in islice(_items(item.get("outline_colors")), len(points))]
    if kind == POINTS and len(point_colours) == len(points):
        for vertex, point_colour in zip(points, point_colours, strict=True):
            yield AnnotationShape("points", (vertex,), point_colour, None, thickness)
    elif kind == POINTS:
        yield AnnotationShape("points", points, outline, fill, thickness)
    elif kind == LINE_LOOP and len(points) > 1:
        yield AnnotationShape("area", points, outline, fill, thickness)
    elif kind == LINE_STRIP and len(points) > 1:
        yield AnnotationShape("line", points, outline, None, thickness)
    elif kind == LINE_LIST:
        for index in range(0, len(points) - 1, 2):
            point_colour = point_colours[index // 2] if index // 2 < len(point_colours) else outline
            yield AnnotationShape("line", points[index : index + 2], point_colour, None, thickness)


def _parse_text(item: Mapping[str, object], frame: _Frame) -> Iterator[AnnotationShape]:
    position, text, height = (
        frame.point(item.get("position")),
        item.get("text"),
        _number(item.get("font_size")),
    )
    if position is None or not isinstance(text, str) or not text.strip():
        return
    size = (0.0, (height if height is not None and height > 0 else 12.0) / frame.height)
    colour, background = _colour(item.get("text_color")) or YELLOW, _colour(item.get("background_color"))
    yield AnnotationShape(
        "text", (position,), colour, background, 1.0, size, shortened(" ".join(text.split()), MAX_TEXT_LENGTH)
    )


def _parse_face(payload: Mapping[str, object]) -> tuple[AnnotationShape, ...] | None:
    # The field `center` of `face_positions` is in fact the upper left corner.
    face = payload.get("face")
    if not isinstance(face, Mapping):
        return None
    frame = _Frame(*FACE_FRAME)
    corner, size = frame.point(face.get("center")), face.get("size")
    if corner is None or not isinstance(size, Mapping):
        return None
    width, height = _number(size.get("w")), _number(size.get("h"))
    if width is None or height is None or width <= 0 or height <= 0:
        return None
    x, y = corner
    right, bottom = x + width / frame.width, y + height / frame.height
    corners = ((x, y), (right, y), (right, bottom), (x, bottom))
    return (AnnotationShape("area", corners, YELLOW, None, 2.0, text=_("face")),)


def _thickness(item: Mapping[str, object]) -> float:
    thickness = _number(item.get("thickness"))
    return thickness if thickness is not None and thickness > 0 else 1.0


def _colour(value: object) -> Colour | None:
    # None for invisible colours.
    if not isinstance(value, Mapping):
        return None
    red, green, blue, opacity = (_number(value.get(name)) for name in "rgba")
    if red is None or green is None or blue is None or not opacity or opacity <= 0:
        return None
    return _clamp(red), _clamp(green), _clamp(blue), _clamp(opacity)


def _clamp(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _items(value: object) -> Iterator[object]:
    return iter(value) if _is_list(value) else iter(())  # type: ignore[call-overload]


def _is_list(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview))


def _number(value: object) -> float | None:
    # None for numbers that a painter doesn't support.
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if abs(value) <= MAX_COORDINATE_PX else None  # also excludes NaN
