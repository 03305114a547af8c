"""Perception messages of RIZE programs, mostly on `/blackboard`. Performs no input or output.

Format: `{"primitive": "touched", "input": {"head": 1}, "robot": "Pepper"}`, where values are probabilities or
booleans. Older programs send only `"input": "add"`, and some quote names and values: `{"'happy'": "1"}`.
Through rosbridge, the message is a JSON text in the field `data`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from nep.errors import DecodeError
from nep.messages.codecs import JSON
from nep.messages.message import NO_EXTENSION

_QUOTES = "'\""


class Perception(NamedTuple):
    """Message about something that a robot perceived.

    Attributes:
        primitive: Kind of perception, such as "touched".
        values: Perceived values by name.
        robot: Name of the robot; "" if unknown.
    """

    primitive: str
    values: Mapping[str, object]
    robot: str


def parse_perception(payload: object) -> Perception | None:
    """Parse a payload as a perception; return None for other messages."""
    if isinstance(payload, Mapping) and len(payload) == 1 and isinstance(payload.get("data"), str):
        try:
            payload = JSON.decode(payload["data"].encode("utf-8", "surrogatepass"), NO_EXTENSION)
        except DecodeError:
            return None
    if not isinstance(payload, Mapping):
        return None
    primitive, inputs, robot = (payload.get(name) for name in ("primitive", "input", "robot"))
    if not isinstance(primitive, str) or not primitive:
        return None
    if isinstance(inputs, str) and inputs and payload.get("node") == "perception":
        inputs = {inputs: 1}
    if not isinstance(inputs, Mapping) or not all(isinstance(name, str) for name in inputs):
        return None
    values = {name.strip(_QUOTES): _parse_number(value) for name, value in inputs.items()}
    return Perception(primitive, values, robot if isinstance(robot, str) else "")


def _parse_number(value: object) -> object:
    if not isinstance(value, str):
        return value
    try:
        parsed = float(value.strip(_QUOTES))
    except ValueError:
        return value
    if not math.isfinite(parsed):
        return value
    return int(parsed) if parsed.is_integer() and "." not in value else parsed
