"""JSON Schemas of message types: types of `nep.geometry` and `nep.sensor`, and declared types.

Viewers use a schema to list the fields of a topic before the first message. They support a small part of JSON
Schema: scalars, objects, and lists of these. Other fields are omitted. The schema of an unknown type is an
object with any fields.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import orjson

from nep import geometry, sensor

ANY_OBJECT = b'{"type":"object"}'
_SCALAR_TYPES: Mapping[object, str] = {str: "string", bool: "boolean", int: "integer", float: "number"}
_MAX_DEPTH = 10


@cache
def _known_types() -> Mapping[str, type]:
    kinds = [vars(module)[name] for module in (geometry, sensor) for name in module.__all__]
    return {str(kind.MSG_TYPE): kind for kind in kinds if hasattr(kind, "MSG_TYPE")}


def schema_of(msg_type: str) -> bytes:
    """Return the encoded JSON Schema of the message type with this name; `ANY_OBJECT` if unknown."""
    declared = _known_types().get(msg_type)
    return ANY_OBJECT if declared is None else json_schema(declared)


@cache
def json_schema(declared: type) -> bytes:
    """Return the encoded JSON Schema of a dataclass or TypedDict."""
    schema = _schema_for(declared, 0) or {"type": "object"}
    return orjson.dumps({"title": getattr(declared, "MSG_TYPE", declared.__name__), **schema})


def _schema_for(hint: Any, depth: int) -> dict[str, object] | None:  # noqa: ANN401 - any annotation
    # None if viewers don't support it.
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SCALAR_TYPES:
        return {"type": _SCALAR_TYPES[hint]}
    if origin in {typing.Union, types.UnionType}:
        members = [each for each in arguments if each is not type(None)]
        return _schema_for(members[0], depth) if len(members) == 1 else None
    if origin in {list, Sequence} or (origin is tuple and arguments[1:] == (...,)):
        items = _schema_for(arguments[0], depth)
        return None if items is None or items["type"] == "array" else {"type": "array", "items": items}
    if not (dataclasses.is_dataclass(hint) or hasattr(hint, "__required_keys__")) or depth >= _MAX_DEPTH:
        return None
    properties = {
        name: field_schema
        for name, each in typing.get_type_hints(hint).items()
        if not name.startswith("_") and (field_schema := _schema_for(each, depth + 1)) is not None
    }
    return {"type": "object", "properties": properties}
