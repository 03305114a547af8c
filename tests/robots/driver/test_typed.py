from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Literal, TypedDict

import numpy as np
import pytest
from typing_extensions import NotRequired

import nep
from app.errors import DescriptionError, RobotValueError
from app.robots.description.description import parse
from app.robots.driver.driver import Driver
from app.robots.driver.schema import (
    Advanced,
    Colour,
    Range,
    Suggested,
    Text,
    Title,
    Words,
    input_schema,
    schema_of,
)
from app.robots.driver.schema_values import from_json, to_json
from app.robots.kit import Call, Kind, Link, action, event, safe_stop, sensor
from tests.pseudo import untranslated
from tests.robots.conftest import Ears, eventually


@pytest.mark.parametrize(
    ("kind", "schema"),
    [
        (float, {"type": "number"}),
        (bool, {"type": "boolean"}),
        (list[str], {"type": "array", "items": {"type": "string"}}),
        (Annotated[float, Range(-2, 2, step=0.05, unit="m")],
         {"type": "number", "minimum": -2, "maximum": 2, "rb:step": 0.05, "unit": "m"}),
        (Annotated[int, Range(0, 100, 5, "%")],
         {"type": "integer", "minimum": 0, "maximum": 100, "multipleOf": 5, "unit": "%"}),
        (Annotated[str, Text(1, 9)], {"type": "string", "minLength": 1, "maxLength": 9}),
        (Literal["a", "b"], {"type": "string", "enum": ["a", "b"]}),
        (Literal[1, 2], {"type": "number", "enum": [1, 2]}),
        (Annotated[Literal["a", "b"], Words({"a": "first"})],
         {"type": "string", "oneOf": [{"const": "a", "title": "first"}, {"const": "b", "title": "b"}]}),
        (Colour, {"type": "string", "pattern": "^#[0-9a-fA-F]{6}$", "rb:widget": "colour"}),
        (Annotated[float, Title("how far"), Suggested(1.0), Advanced()],
         {"type": "number", "title": "how far", "default": 1.0, "rb:advanced": True}),
    ],
)  # fmt: skip
def test_types_are_converted_to_schemas(kind, schema):
    assert schema_of(kind) == schema


@pytest.mark.parametrize(
    "kind",
    [
        dict,
        complex,
        float | str,
        list[float | None],
        dict[int, str],
        tuple,
        Annotated[float, "metres"],
        Literal["a", True],
        Annotated[float, Range(0, 1, unit="degrees")],
        Annotated[float, Range(0, 1, unit=5)],
    ],
)
def test_unsupported_types_are_rejected(kind):
    with pytest.raises(TypeError):
        schema_of(kind)


def test_parameters_with_defaults_are_optional():
    def walk(self: object, call: Call, far: float, speed: float = 0.2) -> None:
        """Walk."""

    assert input_schema(walk) == {
        "type": "object",
        "required": ["far"],
        "properties": {
            "far": {"type": "number", "title": "far"},
            "speed": {"type": "number", "title": "speed", "default": 0.2},
        },
    }


def test_untyped_parameters_are_rejected():
    def walk(self, call, far):
        """Walk."""

    with pytest.raises(TypeError, match="'far' needs a type annotation"):
        input_schema(walk)


def test_robot_without_exactly_one_stop_is_rejected():
    class NoStop:
        @action("go", category="Movement", icon="play")
        def go(self, call: Call) -> None:
            """Go."""

    class TwoStops(NoStop):
        @safe_stop()
        def halt(self) -> None:
            """Stop."""

        @safe_stop()
        def stop(self) -> None:
            """Stop."""

    for body in (NoStop, TwoStops):
        with pytest.raises(DescriptionError, match="exactly one method"):
            Kind(model="x", title="X", body=body)


def test_block_text_with_an_unknown_parameter_is_rejected():
    class Wrong:
        @action("go %far", category="Movement", icon="play")
        def go(self, call: Call) -> None:
            """Go."""

        @safe_stop()
        def stop(self) -> None:
            """Stop."""

    with pytest.raises(DescriptionError, match="uses %far"):
        Kind(model="x", title="X", body=Wrong)


# ---- values of richer types (enums, dataclasses, arrays) -------------------------------------------


class Side(Enum):
    LEFT = "l"
    FAR_RIGHT = "r"


class Gear(Enum):
    SLOW = (1, 2)
    FAST = (3, 4)


@dataclass(frozen=True)
class Pose:
    x: Annotated[float, Range(-5, 5, unit="m")]
    y: float = 0.0
    name: str | None = None


class Box(TypedDict):
    width: int
    label: NotRequired[str]


POSE = {
    "type": "object", "required": ["x"],
    "properties": {
        "x": {"title": "x", "type": "number", "minimum": -5, "maximum": 5, "unit": "m"},
        "y": {"title": "y", "type": "number"},
        "name": {"title": "name", "type": "string", "rb:nullable": True},
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "schema"),
    [
        (float | None, {"type": "number", "rb:nullable": True}),
        (Annotated[int | None, Range(0)], {"type": "integer", "minimum": 0, "rb:nullable": True}),
        (Annotated[int, Range(0)] | None, {"type": "integer", "minimum": 0, "rb:nullable": True}),
        (tuple[float, str],
         {"type": "array", "items": [{"type": "number"}, {"type": "string"}], "minItems": 2, "maxItems": 2}),
        (tuple[int, ...], {"type": "array", "items": {"type": "integer"}}),
        (dict[str, bool], {"type": "object", "additionalProperties": {"type": "boolean"}}),
        (dict[str, object], {"type": "object"}),
        (Side, {"type": "string",
                "oneOf": [{"const": "l", "title": "left"}, {"const": "r", "title": "far right"}]}),
        (Gear, {"type": "string",
                "oneOf": [{"const": "SLOW", "title": "slow"}, {"const": "FAST", "title": "fast"}]}),
        (Pose, POSE),
        (Box, {"type": "object", "required": ["width"],
               "properties": {"width": {"title": "width", "type": "integer"},
                              "label": {"title": "label", "type": "string"}}}),
        (list[Pose], {"type": "array", "items": POSE}),
        (Literal["a", 1], {"enum": ["a", 1]}),
    ],
)  # fmt: skip
def test_composite_types_are_converted_to_schemas(kind, schema):
    assert schema_of(kind) == schema


@pytest.mark.parametrize(
    ("kind", "json", "python"),
    [
        (float, 2, 2.0),
        (int, 2.0, 2),
        (Literal[1, 2], 2.0, 2),
        (Side, "r", Side.FAR_RIGHT),
        (Gear, "SLOW", Gear.SLOW),
        (Side | None, None, None),
        (tuple[float, Side], [1, "l"], (1.0, Side.LEFT)),
        (tuple[int, ...], [1, 2.0], (1, 2)),
        (list[list[float]], [[1], []], [[1.0], []]),
        (dict[str, Side], {"a": "l"}, {"a": Side.LEFT}),
        (Pose, {"x": 1}, Pose(1.0)),
        (Pose, {"x": 1, "name": "door", "y": 2}, Pose(1.0, 2.0, "door")),
        (Box, {"width": 3.0}, {"width": 3}),
    ],
)
def test_values_round_trip_between_json_and_python(kind, json, python):
    made = from_json(kind, json)
    assert made == python
    assert type(made) is type(python)
    assert from_json(kind, to_json(kind, made)) == python


@pytest.mark.parametrize(
    ("kind", "value", "sentence"),
    [
        (float, "far", "the value must be a number, not 'far'"),
        (float, True, "the value must be a number, not True"),
        (float, None, "the value must be a number, not None"),
        (int, 2.5, "the value must be a whole number, not 2.5"),
        (int, float("nan"), "the value must be a whole number, not nan"),
        (bool, 1, "the value must be True or False, not 1"),
        (str, 1, "the value must be text, not 1"),
        (Literal["a", "b"], "c", "the value must be a or b, not 'c'"),
        (Side, "x", "the value must be l or r, not 'x'"),
        (list[float], "abc", "the value must be a list, not 'abc'"),
        (list[float], [1, "a"], "value 2 must be a number, not 'a'"),
        (tuple[float, float], [1], "the value must have 2 values, not 1"),
        (dict[str, int], {"a": "b"}, "“a” must be a whole number, not 'b'"),
        (Pose, {"y": 1}, "x is missing"),
        (Pose, Pose("far"), "x must be a number, not 'far'"),  # type: ignore[arg-type]
        (Pose, 7, "the value must be an object with x, y and name, not 7"),
        (object, object(), "the value must be a JSON value, not object"),
    ],
)
def test_value_that_mismatches_the_declared_type_is_rejected_with_a_message(kind, value, sentence):
    with pytest.raises(RobotValueError) as caught:
        to_json(kind, value)
    assert str(caught.value) == sentence


def test_numpy_numbers_and_arrays_become_numbers_and_lists():
    assert to_json(float, np.float32(0.5)) == 0.5
    assert to_json(int, np.int64(7)) == 7
    assert to_json(bool, np.bool_(True)) is True
    assert to_json(list[float], np.array([1.0, 2.0])) == [1.0, 2.0]
    assert json.dumps(to_json(object, {"a": [np.int8(3)]})) == '{"a": [3]}'


def test_recursive_type_is_rejected():
    @dataclass
    class Tree:
        below: list[Tree]

    Tree.__annotations__["below"] = list[Tree]
    with pytest.raises(TypeError, match="recursive types aren't supported: Tree"):
        schema_of(Tree)


# ---- robot with richer types -----------------------------------------------------------------------


class Arm:
    """Fake robot that accepts and returns values of every supported type."""

    pose = sensor(Pose, title="pose")
    limits = sensor(tuple[float, float], title="limits")
    heat = sensor(float | None, title="heat")
    bumped = event("when bumped", title="bumped", icon="zap", fields={"side": Side, "force": float})

    def __init__(self, link: Link) -> None:
        self.link = link
        self.had: list[object] = []
        self.gives: object = None

    @action("take", "Movement", "move")
    def take(
        self,
        call: Call,
        angles: list[float],
        at: tuple[float, Side] = (0.0, Side.LEFT),
        pose: Pose | None = None,
        speeds: dict[str, float] = {},  # noqa: B006 - as people write it
        side: Side = Side.FAR_RIGHT,
        must: int | None = 3,
    ) -> None:
        """Store the arguments."""
        self.had = [angles, at, pose, speeds, side, must]

    @action("need", "Movement", "move")
    def need(self, call: Call, maybe: float | None) -> None:
        """Accept None for a parameter that has no default."""
        self.had = [maybe]

    @action("measure", "Movement", "move")
    def measure(self, call: Call) -> Annotated[float, Range(unit="cm"), Title("width")]:
        """Return a number with a unit and a title."""
        return self.gives  # type: ignore[return-value]

    @action("look", "Movement", "move")
    async def look(self, call: Call) -> Pose:
        """Return a pose from a coroutine."""
        return self.gives  # type: ignore[return-value]

    @action("count", "Movement", "move", output={"count": int})
    def count(self, call: Call) -> int:
        """Return an integer."""
        return self.gives  # type: ignore[return-value]

    @action("anything", "Movement", "move")
    def anything(self, call: Call):
        """Return a value without a type annotation."""
        return self.gives

    @safe_stop()
    def stop(self) -> None:
        """Stand still."""


ARM = Kind(model="arm", title="Arm", body=Arm)


@pytest.fixture
def arm(node):
    with nep.node("listener", "memory") as other, Driver(ARM, "Arm", node) as driver:
        yield driver.body, Ears(other, "Arm")


def test_action_receives_values_of_its_declared_types(arm):
    body, ears = arm
    ears.invoke("1", "take", angles=[1, 2.5])
    assert ears.final("1")["state"] == "succeeded"
    assert body.had == [[1.0, 2.5], (0.0, Side.LEFT), None, {}, Side.FAR_RIGHT, 3]
    given_ = {"at": [2, "r"], "pose": {"x": 1}, "speeds": {"a": 2}, "side": "l", "must": None}
    ears.invoke("2", "take", angles=[], **given_)
    assert ears.final("2")["state"] == "succeeded"
    assert body.had[1:] == [(2.0, Side.FAR_RIGHT), Pose(1.0), {"a": 2.0}, Side.LEFT, None]
    ears.invoke("3", "need")
    assert ears.final("3")["state"] == "succeeded"
    assert body.had == [None]


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"angles": ["a"]}, "take: angles value 1 must be a number"),
        ({"angles": "a"}, "take: angles must be a list"),
        ({"angles": [], "at": [1]}, "take: at must have 2 values"),
        ({"angles": [], "at": [1, "up"]}, "take: at value 2 must be left or far right"),
        ({"angles": [], "pose": {"x": 9}}, "take: pose x must be between -5 and 5 m"),
        ({"angles": [], "pose": {}}, "take: pose x is missing"),
        ({"angles": [], "pose": {"x": 1, "z": 1}}, "take: pose has no “z”"),
        ({"angles": [], "pose": [1]}, "take: pose must be an object with named values"),
        ({"angles": [], "speeds": {"a": "fast"}}, "take: speeds “a” must be a number"),
        ({"angles": None}, "take: angles must be a list"),
    ],
)
def test_invalid_nested_values_are_rejected(arm, wrong, sentence):
    body, ears = arm
    ears.invoke("1", "take", **wrong)
    assert ears.final("1")["error"] == sentence
    assert body.had == []


@pytest.mark.parametrize(
    ("asked", "returned", "output"),
    [
        ("measure", 3, {"value": 3}),
        ("look", Pose(1.0, name="here"), {"x": 1.0, "y": 0.0, "name": "here"}),
        ("look", {"x": 1, "y": 2}, {"x": 1, "y": 2}),
        ("count", 7, {"count": 7}),
        ("count", {"count": 7, "more": [1]}, {"count": 7, "more": [1]}),
        ("count", None, {}),
        ("anything", 2.5, {"value": 2.5}),
        ("anything", {"a": Side.LEFT}, {"a": "l"}),
        ("anything", None, {}),
    ],
)
def test_return_value_of_a_function_is_the_output(arm, asked, returned, output):
    body, ears = arm
    body.gives = returned
    ears.invoke("1", asked)
    answer = ears.final("1")
    assert (answer["state"], answer["output"]) == ("succeeded", output)


@pytest.mark.parametrize(
    ("asked", "returned", "why"),
    [
        ("measure", "wide", "the value must be a number, not 'wide'"),
        ("measure", None, "the value must be a number, not None"),
        ("measure", float("nan"), "the value must be a finite number, not nan"),
        ("look", 7, "the value must be an object with x, y and name, not 7"),
        ("count", "many", "count must be a whole number, not 'many'"),
        ("anything", {"a": float("inf")}, "the value must be a finite number, not inf"),
        ("anything", {"a": ["\ud800"]}, "the value must be valid Unicode text"),
    ],
)
def test_return_value_that_mismatches_the_declared_type_is_a_failure(arm, asked, returned, why):
    body, ears = arm
    body.gives = returned
    ears.invoke("1", asked)
    answer = ears.final("1")
    assert answer["state"] == "failed"
    assert answer["error"] == f"{asked} finished, but its result is invalid: {why}"


def test_description_declares_the_output_of_an_action():
    actions = ARM.thing_model["actions"]
    assert actions["measure"]["output"]["properties"] == {
        "value": {"title": "width", "type": "number", "unit": "cm"}
    }
    assert set(actions["look"]["output"]["properties"]) == {"x", "y", "name"}
    assert "output" not in actions["anything"]
    described = parse(ARM.thing_model).action("measure")
    assert [(field.name, field.title, field.unit) for field in described.output] == [("value", "width", "cm")]


def test_sensors_and_events_publish_values_of_their_declared_types(arm):
    body, ears = arm
    poses, limits, heats, bumps = (ears.listen(leaf) for leaf in ("pose", "limits", "heat", "bumped"))
    body.link.sense("pose", Pose(1.0))
    body.link.sense("limits", (1, np.float32(0.5)))
    body.link.sense("heat", None)
    body.link.happen("bumped", side=Side.LEFT, force=1)
    eventually(lambda: poses and limits and heats and bumps)
    assert poses == [{"x": 1.0, "y": 0.0, "name": None}]
    assert (limits, heats, bumps) == ([{"value": [1, 0.5]}], [{"value": None}], [{"side": "l", "force": 1}])
    with pytest.raises(RobotValueError, match="Arm's sensor 'heat': the value must be a number, not 'hot'"):
        body.link.sense("heat", "hot")
    with pytest.raises(RobotValueError, match="Arm's event 'bumped': force must be a number, not 'hard'"):
        body.link.happen("bumped", side="l", force="hard")


@pytest.mark.usefixtures("pseudo")
def test_type_error_message_is_translated():
    for kind, value in (
        (float, "zz"),
        (Pose, {"y": 1}),
        (list[float], [1, "zz"]),
        (dict[str, int], {"y": "zz"}),
    ):
        with pytest.raises(RobotValueError) as caught:
            to_json(kind, value)
        assert untranslated(str(caught.value), "zz", "x", "y", "name") == []
