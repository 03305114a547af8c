"""State of a virtual robot for the drawing, parsed from messages of its ``state`` topic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from nep.i18n import _
from nep.text import bounded_str

DEFAULT_EYE_COLOUR = "#35B0FA"
DEFAULT_SHOULDER_COLOUR = "#3AB5FF"
MAX_HEARD_CHARS = 200


@dataclass(frozen=True, slots=True)
class Thing:
    """Object in the room.

    Attributes:
        kind: Kind of object, such as "ball", "face" or "marker".
        x: Position in m.
        y: Position in m.
        name: Unique name; "" if unknown.
        colour: Colour as "#rrggbb"; None for the default.
        size_m: Radius or side length in m; None for the default.
        height_m: Height in m; None for the default.
    """

    kind: str
    x: float
    y: float
    name: str = ""
    colour: str | None = None
    size_m: float | None = None
    height_m: float | None = None


@dataclass(frozen=True, slots=True)
class RoomBounds:
    """Extent of the floor in m.

    The viewer looks from ``x_max`` towards ``x_min``, with ``y_max`` at the right.
    """

    x_min: float = -3.0
    x_max: float = 3.0
    y_min: float = -2.5
    y_max: float = 2.5


@dataclass(frozen=True, slots=True)
class RobotState:
    """State of a robot for the drawing.

    Attributes:
        x, y: Position in m.
        theta_deg: Heading; 0 faces along x, towards the viewer, and positive angles turn to the robot's
            left.
        head_yaw_deg: Direction of the head relative to the body, positive to the robot's left.
        head_pitch_deg: Inclination of the head, positive downwards.
        speech: Text that is being spoken, or None.
        spoken_fraction: Spoken fraction of the text, 0 to 1.
        sound: Title of the sound that is being played, such as "bell" or "440 Hz"; "" for none.
        heard_text: Words that the user recently said to the robot.
        eyes: Colour of the eyes as "#rrggbb".
        shoulders: Colour of the shoulders as "#rrggbb".
        emotion: Name of the facial expression, one of `app.ui.robot_drawing.pepper.EMOTIONS`; any other
            name is drawn as "neutral".
        arm_left_deg, arm_right_deg: 0 is hanging, 90 horizontal, 180 straight up.
        is_moving: True while the robot moves.
        touched_parts: Names of the touched parts, such as "head".
        figure: ``pepper`` or ``turtle``.
        pressed_bumper: Side of the pressed bumper; "" for none.
        is_lifted: True while the user has lifted the robot.
        is_room_shared: True if the robot shares the room with all other robots.
        objects: Objects in the room.
        room: Extent of the room.
    """

    x: float = 0.0
    y: float = 0.0
    theta_deg: float = 0.0
    head_yaw_deg: float = 0.0
    head_pitch_deg: float = 0.0
    speech: str | None = None
    spoken_fraction: float = 0.0
    sound: str = ""
    heard_text: str = ""
    eyes: str = DEFAULT_EYE_COLOUR
    shoulders: str = DEFAULT_SHOULDER_COLOUR
    emotion: str = "neutral"
    arm_left_deg: float = 0.0
    arm_right_deg: float = 0.0
    is_moving: bool = False
    touched_parts: tuple[str, ...] = ()
    figure: str = "pepper"
    pressed_bumper: str = ""
    is_lifted: bool = False
    is_room_shared: bool = False
    objects: tuple[Thing, ...] = ()
    room: RoomBounds = field(default_factory=RoomBounds)

    @property
    def caption(self) -> str:
        """Text of the speech bubble: the spoken text, and the sound such as ``♪ bell``; "" for no bubble."""
        sound_text = f"♪\N{NO-BREAK SPACE}{_(self.sound)}" if self.sound else ""
        return " ".join(each for each in (self.speech or "", sound_text) if each)

    @classmethod
    def parse(cls, data: Mapping[str, object]) -> RobotState:
        """Parse the payload of a state message; missing and malformed values are replaced by defaults."""
        speech = data.get("speech")
        return cls(
            x=_parse_number(data.get("x")),
            y=_parse_number(data.get("y")),
            theta_deg=_parse_number(data.get("theta_deg")),
            head_yaw_deg=_parse_number(data.get("head_yaw_deg")),
            head_pitch_deg=_parse_number(data.get("head_pitch_deg")),
            speech=speech if isinstance(speech, str) and speech.strip() else None,
            spoken_fraction=min(1.0, max(0.0, _parse_number(data.get("spoken")))),
            sound=_parse_sound(data.get("sound")),
            heard_text=bounded_str(data.get("heard") or "")[:MAX_HEARD_CHARS],
            eyes=_parse_colour(data.get("eyes"), DEFAULT_EYE_COLOUR),
            shoulders=_parse_colour(data.get("shoulders"), DEFAULT_SHOULDER_COLOUR),
            emotion=bounded_str(data.get("emotion") or "neutral"),
            arm_left_deg=_parse_number(data.get("arm_left_deg")),
            arm_right_deg=_parse_number(data.get("arm_right_deg")),
            is_moving=data.get("moving") is True,
            figure=bounded_str(data.get("figure") or "pepper"),
            pressed_bumper=bounded_str(data.get("bumped") or ""),
            touched_parts=_parse_touched_parts(data.get("touched", data.get("touch"))),
            is_lifted=data.get("held") is True,
            is_room_shared=_is_shared(data.get("room")),
            objects=_parse_things(data.get("objects")),
            room=_parse_room(data.get("room")),
        )


def _parse_sound(value: object) -> str:
    return bounded_str(value.get("title") or "")[:40] if isinstance(value, Mapping) else ""


def _parse_number(value: object, default: float = 0.0) -> float:
    is_valid = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e6
    return float(value) if is_valid else default  # type: ignore[arg-type]


def _parse_colour(value: object, default: str) -> str:
    if isinstance(value, str) and len(value) == 7 and value.startswith("#"):
        return value if all(sign in "0123456789abcdefABCDEF" for sign in value[1:]) else default
    return default


def _parse_touched_parts(value: object) -> tuple[str, ...]:
    if isinstance(value, str):
        return (value,)
    if isinstance(value, Mapping):
        return tuple(bounded_str(part) for part, is_touched in value.items() if is_touched is True)
    if isinstance(value, Sequence):
        return tuple(bounded_str(part) for part in value)
    return ()


def _parse_things(value: object) -> tuple[Thing, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        return ()
    return tuple(_parse_thing(item) for item in value if isinstance(item, Mapping))


def _parse_thing(item: Mapping[str, object]) -> Thing:
    colour = item.get("colour", item.get("color"))
    size = item.get("radius", item.get("size"))
    return Thing(
        kind=bounded_str(item.get("kind") or "box"),
        x=_parse_number(item.get("x")),
        y=_parse_number(item.get("y")),
        name=bounded_str(item.get("name") or ""),
        colour=_parse_colour(colour, "") or None,
        size_m=_parse_number(size) if size is not None else None,
        height_m=_parse_number(item.get("height")) if item.get("height") is not None else None,
    )


def _is_shared(room: object) -> bool:
    return isinstance(room, Mapping) and room.get("shared") is True


def _parse_room(value: object) -> RoomBounds:
    if not isinstance(value, Mapping):
        return RoomBounds()
    if "x_min" in value and "y_min" in value:
        sides = [_parse_number(value.get(side)) for side in ("x_min", "x_max", "y_min", "y_max")]
        return RoomBounds(*sides) if sides[1] - sides[0] > 0.1 and sides[3] - sides[2] > 0.1 else RoomBounds()
    width = _parse_number(value.get("width"), 6.0)
    depth = _parse_number(value.get("depth"), 5.0)
    return (
        RoomBounds(-width / 2, width / 2, -depth / 2, depth / 2) if min(width, depth) > 0.1 else RoomBounds()
    )
