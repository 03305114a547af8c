"""Tests of typed parameters: instances for the node itself, validated plain values for other nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from itertools import count
from typing import Any, TypedDict

import pytest

import nep
from nep.errors import ParameterError, RequestRefusedError

_names = count()


class Gait(Enum):
    WALK = "walk"
    RUN = "run"


class Mixed(Enum):
    A = 1
    B = "b"


class Level(Enum):
    LOW = 1
    HIGH = 2


@dataclass
class Limits:
    least: float
    most: float = 1.0
    names: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError("the minimum is above the most")


@dataclass
class Held:
    thing: object
    lock: Any = None
    made: complex = 0j


class Place(TypedDict):
    x: float


@pytest.fixture
def nodes() -> Iterator[tuple[nep.Node, nep.Node]]:
    hub = f"parameters-{next(_names)}"
    with nep.node("robot", "memory", master=hub) as robot, nep.node("tool", "memory", master=hub) as tool:
        yield robot, tool


def test_dataclass_parameter_is_an_instance_locally_and_a_map_remotely(
    nodes: tuple[nep.Node, nep.Node],
) -> None:
    robot, tool = nodes
    assert robot.parameters.declare("limits", Limits(0.0)) == Limits(0.0)
    asked: list[object] = []
    robot.parameters.on_change(lambda values: asked.append(values["limits"]))
    with tool.parameters_of("robot") as theirs:
        assert theirs.get("limits") == {"least": 0.0, "most": 1.0, "names": []}
        theirs.set("limits", {"least": -1, "names": ["a"], "unknown": 5})
        (told,) = theirs.list()
        assert (told["type"], told["default"]) == ("dict", {"least": 0.0, "most": 1.0, "names": []})
    assert robot.parameters["limits"] == Limits(-1.0, 1.0, ["a"])
    assert asked == [Limits(-1.0, 1.0, ["a"])]
    assert robot.parameters.describe("limits").value == {"least": -1.0, "most": 1.0, "names": ["a"]}


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({"least": "low"}, "least"),
        ({}, "least"),
        ({"least": 2.0}, "the minimum is above the most"),
        ({"least": 0.0, "names": [1]}, r"names\[0\]"),
        ([], "Limits"),
        (None, "Limits"),
        (5, "Limits"),
    ],
)
def test_mismatched_typed_value_is_rejected_locally_and_remotely(
    nodes: tuple[nep.Node, nep.Node], value: object, said: str
) -> None:
    robot, tool = nodes
    robot.parameters.declare("limits", Limits(0.0))
    with tool.parameters_of("robot") as theirs, pytest.raises(RequestRefusedError, match=said):
        theirs.set("limits", value)
    with pytest.raises(ParameterError, match=said):
        robot.parameters["limits"] = value
    assert robot.parameters["limits"] == Limits(0.0)


def test_in_place_change_of_a_parameter_instance_has_no_effect(nodes: tuple[nep.Node, nep.Node]) -> None:
    robot, _tool = nodes
    given = Limits(0.0)
    robot.parameters.declare("limits", given)
    given.names.append("later")
    found = robot.parameters["limits"]
    assert isinstance(found, Limits)
    found.most = 99.0
    assert robot.parameters["limits"] == Limits(0.0)
    robot.parameters["limits"] = found
    assert robot.parameters["limits"] == Limits(0.0, 99.0)


def test_enum_parameter_is_its_value_remotely(nodes: tuple[nep.Node, nep.Node]) -> None:
    robot, tool = nodes
    assert robot.parameters.declare("gait", Gait.WALK) is Gait.WALK
    robot.parameters.declare("level", 2, type=Level)
    assert robot.parameters["level"] is Level.HIGH
    with tool.parameters_of("robot") as theirs:
        gait, level = theirs.list()
        assert (gait["type"], gait["value"], gait["choices"]) == ("str", "walk", ["walk", "run"])
        assert (level["type"], level["value"], level["choices"]) == ("int", 2, [1, 2])
        theirs.set_all({"gait": "run", "level": 1})
        with pytest.raises(RequestRefusedError, match="'walk' or 'run'"):
            theirs.set("gait", "fly")
        with pytest.raises(RequestRefusedError):
            theirs.set("gait", "WALK")
    assert (robot.parameters["gait"], robot.parameters["level"]) == (Gait.RUN, Level.LOW)
    robot.parameters["gait"] = Gait.WALK
    assert robot.parameters["gait"] is Gait.WALK


def test_enum_choices_can_be_restricted(nodes: tuple[nep.Node, nep.Node]) -> None:
    robot, _tool = nodes
    robot.parameters.declare("gait", Gait.WALK, choices=(Gait.WALK,))
    with pytest.raises(ParameterError, match="walk"):
        robot.parameters["gait"] = Gait.RUN


def test_typed_dict_parameter_is_validated(nodes: tuple[nep.Node, nep.Node]) -> None:
    robot, tool = nodes
    robot.parameters.declare("place", {"x": 1}, type=Place)
    assert robot.parameters["place"] == {"x": 1.0}
    with tool.parameters_of("robot") as theirs, pytest.raises(RequestRefusedError, match="x is a 'str'"):
        theirs.set("place", {"x": "left"})
    with pytest.raises(ParameterError):
        robot.parameters.set("place", {"y": 1.0})


@pytest.mark.parametrize(
    ("default", "kind"),
    [(Mixed.A, None), (Held(1), None), (5, Held), (1 + 2j, None), (5, complex), (Limits(0.0), Gait)],
)
def test_unsupported_parameter_type_cannot_be_declared(
    nodes: tuple[nep.Node, nep.Node], default: object, kind: type | None
) -> None:
    robot, _tool = nodes
    with pytest.raises(ParameterError):
        robot.parameters.declare("x", default, type=kind)
    assert robot.parameters.list() == ()


def test_non_finite_number_in_a_typed_parameter_is_rejected(nodes: tuple[nep.Node, nep.Node]) -> None:
    robot, _tool = nodes
    robot.parameters.declare("limits", Limits(0.0))
    with pytest.raises(ParameterError, match=r"'limits' .*: least .*finite"):
        robot.parameters["limits"] = Limits(float("nan"))
    with pytest.raises(ParameterError, match=r"'limits' .*: least .*finite"):
        robot.parameters["limits"] = {"least": None}
    robot.parameters["limits"] = Limits(-1e300)
    assert robot.parameters["limits"] == Limits(-1e300)
