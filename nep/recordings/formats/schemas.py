"""JSON Schema of message types: those of `nep.geometry` and `nep.sensor`, and what a program declares.

A viewer learns from it which fields there are before a message came. Viewers read little of JSON Schema:
scalars, objects and lists of these. So a field of any other form is left out, which a schema may do, and a
type of which nothing is known is an object with any fields.
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

__all__ = ["ANY_OBJECT", "json_schema", "schema_of"]

ANY_OBJECT = b'{"type":"object"}'
_SCALARS: Mapping[object, str] = {str: "string", bool: "boolean", int: "integer", float: "number"}
_DEEPEST = 10


@cache
def _known() -> Mapping[str, type]:
    kinds = [vars(module)[name] for module in (geometry, sensor) for name in module.__all__]
    return {str(kind.MSG_TYPE): kind for kind in kinds if hasattr(kind, "MSG_TYPE")}


def schema_of(msg_type: str) -> bytes:
    """The JSON Schema of a type's messages, by its name in the graph."""
    declared = _known().get(msg_type)
    return ANY_OBJECT if declared is None else json_schema(declared)


@cache
def json_schema(declared: type) -> bytes:
    """The JSON Schema of a dataclass or a TypedDict whose instances are published."""
    made = _of(declared, 0) or {"type": "object"}
    return orjson.dumps({"title": getattr(declared, "MSG_TYPE", declared.__name__), **made})


def _of(hint: Any, depth: int) -> dict[str, object] | None:  # noqa: ANN401 - any annotation
    """The schema of an annotation; None where it has no form that viewers read."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SCALARS:
        return {"type": _SCALARS[hint]}
    if origin in {typing.Union, types.UnionType}:
        known = [each for each in arguments if each is not type(None)]
        return _of(known[0], depth) if len(known) == 1 else None
    if origin in {list, Sequence} or (origin is tuple and arguments[1:] == (...,)):
        items = _of(arguments[0], depth)
        return None if items is None or items["type"] == "array" else {"type": "array", "items": items}
    if not (dataclasses.is_dataclass(hint) or hasattr(hint, "__required_keys__")) or depth >= _DEEPEST:
        return None
    made = {
        name: its
        for name, each in typing.get_type_hints(hint).items()
        if not name.startswith("_") and (its := _of(each, depth + 1)) is not None
    }
    return {"type": "object", "properties": made}
