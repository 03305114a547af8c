from __future__ import annotations

from typing import Annotated, Literal

import pytest

from app.errors import DescriptionError
from app.robots.kit import Call, Kind, action, safe_stop
from app.robots.typed import (
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
def test_types_become_schemas(kind, schema):
    assert schema_of(kind) == schema


@pytest.mark.parametrize("kind", [dict, complex, float | None, Annotated[float, "metres"]])
def test_what_can_not_be_described_is_refused_at_once(kind):
    with pytest.raises(TypeError):
        schema_of(kind)


def test_defaults_make_a_value_optional():
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


def test_untyped_parameters_are_refused():
    def walk(self, call, far):
        """Walk."""

    with pytest.raises(TypeError, match="'far' has no type"):
        input_schema(walk)


def test_a_robot_without_one_stop_is_refused():
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


def test_a_block_text_that_names_nothing_is_refused():
    class Wrong:
        @action("go %far", category="Movement", icon="play")
        def go(self, call: Call) -> None:
            """Go."""

        @safe_stop()
        def stop(self) -> None:
            """Stop."""

    with pytest.raises(DescriptionError, match="uses %far"):
        Kind(model="x", title="X", body=Wrong)
