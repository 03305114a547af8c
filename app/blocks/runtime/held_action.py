"""What is left of an action that a pause took back, to be done when the program goes on."""

from __future__ import annotations

import math
from collections.abc import Mapping

from app.blocks.runtime.link import Call
from app.robots.description.description import Action

LEFT = "to_go"
"""The feedback with which an action says how much is left, in the unit of one of its parameters."""


def rest_of(action: Action, input: Mapping[str, object], call: Call) -> dict[str, object] | None:
    """The input for what is left of a call that was taken back; None when nothing is to be done any more.

    An action that tells what is left does the rest, another one begins again. One that moves the robot to
    another place and does not tell what is left would go too far: the rest is left out.
    """
    if not call.began:
        return dict(input)
    if is_unknown(action, input, call):
        return None
    name = measured_by(action, input)
    if name is None:
        return dict(input)
    left, whole = _number(call.feedback.get(LEFT)), _number(input[name])
    if abs(left) <= abs(whole) / 1000:
        return None
    return {**input, name: math.copysign(min(abs(left), abs(whole)), whole)}


def is_unknown(action: Action, input: Mapping[str, object], call: Call) -> bool:
    """Whether the robot was on its way to another place, and does not tell how much of it is left."""
    name = measured_by(action, input)
    if not call.began or name is None:
        return call.began and action.risk == "locomotes"
    return not _is_number(call.feedback.get(LEFT))


def measured_by(action: Action, input: Mapping[str, object]) -> str | None:
    """The parameter of which the action tells what is left: the only number in the same unit."""
    unit = next((field.unit for field in action.feedback if field.name == LEFT), None)
    same = [
        parameter.name
        for parameter in action.parameters
        if unit is not None and parameter.unit == unit and _is_number(input.get(parameter.name))
    ]
    return same[0] if len(same) == 1 else None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) else 0.0
