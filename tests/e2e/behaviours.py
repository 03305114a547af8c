"""Behaviour files for the end-to-end tests."""

from __future__ import annotations

import json
from pathlib import Path

Block = dict[str, object]
EXAMPLES = Path(__file__).resolve().parents[2] / "resources" / "examples"
PEPPER = json.loads((EXAMPLES / "1-greeting.nepb").read_text("utf-8"))["robots"]


def block(kind: str, *, below: Block | None = None, fields: Block | None = None, **inputs: Block) -> Block:
    """Return a block whose id is the last word of its type.

    ``inputs`` have the upper-case names of the file.
    """
    made: Block = {"type": kind, "id": kind.rpartition("_")[2], "fields": fields or {}, "inputs": inputs}
    return {**made, "next": {"block": below}} if below else made


def number(value: float) -> Block:
    return {"shadow": {"type": "values_number", "id": f"number {value}", "fields": {"NUMBER": value}}}


def text(value: str) -> Block:
    return {"shadow": {"type": "values_text", "id": f"text {value}", "fields": {"TEXT": value}}}


def say(words: str, below: Block | None = None, robot: str = "Pepper", model: str = "pepper") -> Block:
    made = block(f"robot_{model}_do_say", below=below, fields={"ROBOT": robot}, TEXT=text(words))
    return {**made, "id": f"say {words}"}


def turn(degrees: float) -> Block:
    fields = {"ROBOT": "Pepper", "DIRECTION": "left"}
    return block("robot_pepper_do_turn", fields=fields, ANGLE=number(degrees))


def started(first: Block) -> Block:
    return {**block("events_started", below=first), "x": 56, "y": 56}


def forever(first: Block) -> Block:
    return block("control_forever", BODY={"block": first})


def write(path: Path, *scripts: Block, robots: dict[str, object] = PEPPER) -> Path:
    """Write scripts to a behaviour file with the descriptions of its robots, as Studio does."""
    content = {
        "format": "nep-behaviour",
        "version": 1,
        "name": path.stem,
        "workspace": {"blocks": {"languageVersion": 0, "blocks": list(scripts)}},
        "robots": robots,
    }
    path.write_text(json.dumps(content), encoding="utf-8")
    return path
