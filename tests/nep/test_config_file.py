"""Tests of configuration files: positions of keys in TOML and JSON, and conversion of tables."""

from __future__ import annotations

import json
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Meta, Struct

from nep.errors import NepError
from nep.messages.fields import FieldPathError, Path
from nep.programs.config_file import ConfigFile, ConfigKind, checks, convert_table

TOML = ConfigKind("TOML", "nep x", 100, "{path} has more than {most} bytes")
JSON = ConfigKind("JSON", "nep x", 100, "{path} has more than {most} bytes")

TABLES = '''\
# [comment] a = 1
name = """
[a]
key = 1 \\""" quoted
"""
a.b = 1
  a."c d" = [1, [2, "]"],  # ]
    {x = 1, y = {z = 2}}]
'q.r' = 1
[b]
key = 'it # is'
[[topics]]
a = 1
[topics.sub]
key = 1
[[topics]]
  a = 2
[topics.sub]
key = 2026-01-31 12:00:00
'''


@pytest.mark.parametrize(
    ("path", "line", "column"),
    [
        (("name",), 2, 1),
        (("a",), 6, 1),
        (("a", "b"), 6, 1),
        (("a", "c d"), 7, 3),
        (("a", "c d", 1, 1), 7, 21),
        (("a", "c d", 2, "y", "z"), 8, 18),
        (("q.r",), 9, 1),
        (("b",), 10, 1),
        (("b", "key"), 11, 1),
        (("topics",), 12, 1),
        (("topics", 0, "sub", "key"), 15, 1),
        (("topics", 1), 16, 1),
        (("topics", 1, "a"), 17, 3),
        (("topics", 1, "sub", "key"), 19, 1),
        (("topics", 1, "missing", "x"), 16, 1),
        (("b", "missing"), 10, 1),
    ],
)
def test_key_is_found_in_toml(path: Path, line: int, column: int) -> None:
    assert ConfigFile(TOML, "f", TABLES).position(path) == (line, column)


def test_missing_key_of_the_root_table_has_no_position_in_toml() -> None:
    assert ConfigFile(TOML, "f", TABLES).position(("missing",)) is None


@pytest.mark.parametrize(
    ("path", "line", "column"),
    [
        ((), 2, 1),
        (("a",), 3, 2),
        (("a", 1), 4, 3),
        (("a", 1, "d\n"), 4, 13),
        (("a", 1, "missing"), 4, 3),
        (("a", 5), 3, 2),
        (("missing",), 2, 1),
        (("b", 0, "x"), 5, 2),
    ],
)
def test_key_is_found_in_json(path: Path, line: int, column: int) -> None:
    text = '\n{\n "a" : [1,\n  {"c": {}, "d\\n": 2} ],\n "b": "a"\n}'
    assert ConfigFile(JSON, "f", text).position(path) == (line, column)


KEYS = st.text(max_size=3)
VALUES = st.recursive(
    st.text(max_size=5) | st.integers(-9, 9) | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)


def toml(value: object) -> str:
    """Return a value in TOML, whose strings and keys are those of JSON except for two escapes."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + " , ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(character):08x}" for character in value) + '"'
    return json.dumps(value)


def paths(value: object, path: Path = ()) -> list[Path]:
    """Return the paths of all keys and items in a value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found: list[Path] = []
    for key, each in items:
        found += [(*path, key), *paths(each, (*path, key))]
    return found


@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_every_key_and_item_is_found_at_its_text(table: dict[str, object]) -> None:
    texts = {
        "TOML": "".join(f"{toml(key)} = {toml(each)}\n" for key, each in table.items()),
        "JSON": json.dumps(table, indent=1),
    }
    for kind in (TOML, JSON):
        text = texts[kind.syntax]
        file = ConfigFile(kind, "f", text)
        starts = set()
        for path in paths(table):
            position = file.position(path)
            assert position is not None
            rest = text.splitlines(keepends=True)[position.line - 1][position.column - 1 :]
            step = path[-1]
            if isinstance(step, str):
                assert rest.startswith(toml(step) if kind is TOML else json.dumps(step))
            starts.add(position)
        assert len(starts) == len(paths(table))


class Table(Struct):
    """Table of the tests."""

    name: str = ""
    rate_hz: Annotated[float, Meta(ge=1)] = 1.0
    is_on: bool = True
    items: list[int] = []


@pytest.mark.parametrize(
    ("table", "path", "reason"),
    [
        ({"nam": ""}, "nam", "unknown key; did you mean 'name'?"),
        ({"name": 1}, "name", "must be a string in quotes"),
        ({"rate_hz": True}, "rate_hz", "must be at least 1"),
        ({"rate_hz": 0}, "rate_hz", "must be at least 1"),
        ({"rate_hz": 10**400}, "rate_hz", "must be at least 1"),
        ({"is_on": 1}, "is_on", "must be true or false"),
        ({"items": {}}, "items", "must be a list"),
        ({"items": [1, 2, "3"]}, "items[2]", "must be a number"),
    ],
)
def test_invalid_table_is_rejected_with_its_key(table: dict[str, object], path: str, reason: str) -> None:
    with pytest.raises(FieldPathError) as caught:
        convert_table(table, Table, {"rate_hz": "must be at least 1"})
    assert (caught.value.path, caught.value.reason) == (path, reason)


def test_errors_of_nested_checks_have_the_whole_path() -> None:
    file = ConfigFile(TOML, "f", "[[a]]\nx = 1\n[[a]]\nx = 2\n")
    with pytest.raises(FieldPathError) as caught, checks("a", 1), checks("x"):
        raise NepError("too small")
    assert str(file.error(caught.value)) == "line 4 of 'f', a[2].x: too small"
