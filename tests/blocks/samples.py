"""Sample robots, described as by a driver, and functions that build workspaces."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import lru_cache

from app.robots.description.description import Robot, parse, thing_description
from nep.i18n import language


def _block(category: str, icon: str, text: str, says: str | None = None) -> dict[str, object]:
    words: dict[str, object] = {"category": category, "icon": icon, "text": {"en": text}}
    return words if says is None else words | {"says": {"en": says}}


def _action(block: dict[str, object], required: list[str], **properties: object) -> dict[str, object]:
    return {
        "title": str(block.pop("title")),
        "synchronous": False,
        "input": {"type": "object", "required": required, "properties": properties},
        "rb:cancel": True,
        "rb:uses": [],
        "rb:onBusy": "queue",
        "rb:timeout": 30,
        "rb:block": block,
    }


ACTIONS: dict[str, object] = {
    "say": _action(
        {"title": "say"} | _block("Speech", "message-circle", "%robot say %text", "%robot says “%text”"),
        ["text"],
        text={"title": "text", "type": "string", "minLength": 1, "maxLength": 500, "default": "Hello"},
    ),
    "light": _action(
        {"title": "light"} | _block("Face and lights", "lightbulb", "%robot light %where %colour"),
        ["where", "colour"],
        where={"title": "where", "type": "string", "enum": ["eyes", "shoulders"], "default": "eyes"},
        colour={
            "title": "colour",
            "type": "string",
            "pattern": "^#[0-9a-fA-F]{6}$",
            "default": "#37b6ff",
            "rb:widget": "colour",
        },
    ),
    "turn": _action(
        {"title": "turn"}
        | _block(
            "Movement",
            "rotate-ccw",
            "%robot turn %direction by %angle °",
            "%robot turns %direction by %angle°",
        ),
        ["direction", "angle"],
        direction={"title": "direction", "type": "string", "enum": ["left", "right"], "default": "left"},
        angle={
            "title": "angle",
            "type": "number",
            "minimum": 0,
            "maximum": 360,
            "unit": "deg",
            "default": 90,
        },
    ),
    "look": _action(
        {"title": "look"} | _block("Face and lights", "smile", "%robot look %emotion for %seconds s"),
        ["emotion"],
        emotion={"title": "emotion", "type": "string", "enum": ["happy", "surprised"], "default": "happy"},
        seconds={"title": "seconds", "type": "number", "minimum": 0, "maximum": 60, "default": 2},
    ),
    "listen": _action(
        {"title": "hear one of", "returns": "word"} | _block("Speech", "ear", "%robot hear one of %words"),
        ["words"],
        words={"title": "words", "type": "array", "items": {"type": "string"}, "default": ["yes", "no"]},
    ),
    "go-home": _action(
        {"title": "go home"} | _block("Movement", "house", "%robot go home %with_song", None),
        [],
        with_song={"title": "song", "type": "boolean", "default": False},
    ),
    "stop": _action({"title": "stop"} | _block("Control", "square", "%robot stop"), []),
}

MODEL: dict[str, object] = {
    "@context": ["https://www.w3.org/2022/wot/td/v1.1", {"rb": "https://example.org/robot-blocks/v1#"}],
    "@type": ["tm:ThingModel", "rb:Robot"],
    "title": "Pepper-like robot",
    "rb:profile": 1,
    "rb:robot": {"model": "pepper", "virtual": True},
    "rb:resources": ["speech"],
    "rb:safeStop": {
        "action": "stop",
        "watchdog": 1.0,
        "onProgramEnd": True,
        "onDisconnect": True,
        "within": 0.2,
    },
    "properties": {
        "battery": {
            "title": "battery",
            "type": "integer",
            "minimum": 0,
            "maximum": 100,
            "unit": "%",
            "readOnly": True,
            "observable": True,
            "rb:block": _block("Sensors", "battery", "%robot battery"),
        },
        "distance": {
            "title": "distance",
            "type": "number",
            "unit": "m",
            "readOnly": True,
            "observable": True,
            "rb:block": _block("Sensors", "ruler", "%robot distance"),
        },
        "sees_face": {
            "title": "sees a face",
            "type": "boolean",
            "readOnly": True,
            "observable": True,
            "rb:block": _block("Sensors", "scan-face", "%robot sees a face"),
        },
        "pose": {
            "title": "position",
            "type": "object",
            "readOnly": True,
            "observable": True,
            "properties": {"x": {"type": "number", "unit": "m"}, "y": {"type": "number", "unit": "m"}},
            "rb:block": _block("Sensors", "map-pin", "%robot position"),
        },
        "camera": {
            "title": "camera",
            "type": "string",
            "readOnly": True,
            "observable": True,
            "contentEncoding": "base64",
            "contentMediaType": "image/jpeg",
            "rb:widget": "image",
        },
    },
    "actions": ACTIONS,
    "events": {
        "touched": {
            "title": "touched",
            "rb:filter": ["place"],
            "rb:level": True,
            "data": {
                "type": "object",
                "properties": {
                    "place": {"type": "string", "enum": ["head", "left_hand"]},
                    "down": {"type": "boolean"},
                },
            },
            "rb:block": _block("Sensors", "hand", "when %robot %place is touched"),
        },
        "heard": {
            "title": "heard",
            "rb:filter": ["word"],
            "data": {"type": "object", "properties": {"word": {"type": "string"}}},
            "rb:block": _block("Speech", "ear", "when %robot hears %word"),
        },
    },
}


def robot(name: str = "Pepper", **changes: object) -> Robot:
    """Return a connected robot with this name; without changes it is parsed once."""
    return parse(thing_description(MODEL | changes, name)) if changes else _robot(name, language())


@lru_cache(maxsize=64)
def _robot(name: str, _language: str) -> Robot:
    return parse(thing_description(MODEL, name))


def nao(name: str = "NAO") -> Robot:
    """Return a robot of another model, whose only actions are *wave* and *stop*."""
    wave = _action(
        {"title": "wave"} | _block("Movement", "hand", "%robot wave %hand hand"),
        ["hand"],
        hand={"title": "hand", "type": "string", "enum": ["right", "left"], "default": "right"},
    )
    stop = _action({"title": "stop"} | _block("Control", "square", "%robot stop"), [])
    return robot(name, **{"rb:robot": {"model": "nao"}, "actions": {"wave": wave, "stop": stop}})


_ids = itertools.count(1)


def block(
    block_type: str, id: str | None = None, *, below: object = None, **parts: object
) -> dict[str, object]:
    """Return a block in Blockly's JSON format.

    Blocks and lists of blocks become inputs; all other parts become fields.
    """
    saved: dict[str, object] = {"type": block_type, "id": id or f"b{next_id()}"}
    for name, value in parts.items():
        if isinstance(value, Mapping) and "type" in value:
            _part(saved, "inputs")[name] = {"block": value}
        elif isinstance(value, list):
            _part(saved, "inputs")[name] = {"block": stack(*value)} if value else {}
        else:
            _part(saved, "fields")[name] = value
    if below is not None:
        saved["next"] = {"block": below}
    return saved


def next_id() -> int:
    return next(_ids)


def _part(saved: dict[str, object], name: str) -> dict[str, object]:
    part = saved.setdefault(name, {})
    assert isinstance(part, dict)
    return part


def stack(*blocks: dict[str, object]) -> dict[str, object]:
    """Connect blocks from top to bottom and return the first."""
    for above, below in itertools.pairwise(blocks):
        above["next"] = {"block": below}
    return blocks[0]


def number(value: object) -> dict[str, object]:
    return block("values_number", NUMBER=value)


def text(value: object) -> dict[str, object]:
    return block("values_text", TEXT=value)


def boolean(value: bool) -> dict[str, object]:
    return block("values_boolean", VALUE="true" if value else "false")


def get(variable: str) -> dict[str, object]:
    return block("variables_get", VAR={"id": variable})


def say(value: object, name: str = "Pepper") -> dict[str, object]:
    return block("robot_pepper_do_say", ROBOT=name, TEXT=value if isinstance(value, Mapping) else text(value))


def define(
    id: str, name: str, inputs: tuple[str, ...], *body: dict[str, object], result: object = None
) -> dict[str, object]:
    """Return the definition of a function.

    The ID of an input is ``i`` followed by a space and its name.
    """
    made = block(
        "functions_define" if result is None else "functions_define_result", id, NAME=name, BODY=list(body)
    )
    made["extraState"] = {"inputs": [{"id": f"i {each}", "name": each} for each in inputs]}
    if result is not None:
        _part(made, "inputs")["RESULT"] = {"block": result}
    return made


def call(
    function: str, *, value: bool = False, id: str | None = None, **given: dict[str, object]
) -> dict[str, object]:
    """Return a call of a function, as a statement or, if `value` is true, as a value block."""
    made = block("functions_result" if value else "functions_call", id)
    inputs = [{"id": f"i {each}", "name": each} for each in given]
    made["extraState"] = {"function": function, "name": function, "inputs": inputs}
    made["inputs"] = {f"IN_i {each}": {"block": inner} for each, inner in given.items()}
    return made


def given(name: str) -> dict[str, object]:
    """Return the block for an input inside its function."""
    return block("functions_input", INPUT=f"i {name}")


def list_of(*items: dict[str, object]) -> dict[str, object]:
    made = block("lists_create", **{f"ITEM{number}": item for number, item in enumerate(items)})
    return made | {"extraState": {"items": len(items)}}


def write(value: object) -> dict[str, object]:
    return block("messages_write", VALUE=value)


def started(*blocks: dict[str, object]) -> dict[str, object]:
    return stack(block("events_started"), *blocks)


def workspace(*tops: Mapping[str, object], variables: tuple[str, ...] = ()) -> dict[str, object]:
    """Return a workspace with these scripts; the ID of a variable is its name."""
    return {
        "blocks": {"languageVersion": 0, "blocks": list(tops)},
        "variables": [{"id": name, "name": name} for name in variables],
    }
