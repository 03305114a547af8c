"""RIZE's words for what the virtual robot does: a primitive's input and options to an action's input.

ValueError or KeyError when they mean nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.robots.description.json_access import number_of


def turn(given: str, options: Mapping[str, object]) -> Mapping[str, object]:
    """``left`` or ``right`` and the option ``degrees``."""
    degrees = number_of(options.get("degrees"))
    return {"direction": given} | ({} if degrees is None else {"angle": degrees})


def walk(given: str, options: Mapping[str, object]) -> Mapping[str, object]:
    """``forwards`` or ``backwards`` and the option ``meters``."""
    metres = number_of(options.get("meters"))
    sign = {"forwards": 1.0, "backwards": -1.0}[given]
    return {"distance": sign * (0.5 if metres is None else metres)}


def light(given: str, options: Mapping[str, object]) -> Mapping[str, object]:
    """``eyes`` or ``all`` and the options ``R``, ``G``, ``B``, 0 to 255."""
    parts = [number_of(options.get(name)) for name in "RGB"]
    colour = "".join(f"{min(255, max(0, int(part or 0))):02x}" for part in parts)
    return {"where": "eyes" if given == "eyes" else "both", "colour": f"#{colour}"}
