"""Tests of JSON text typed by a user: the position of errors, their fixes, and placeholders."""

from __future__ import annotations

import json

import pytest

from app.core.run.acting.json_text import MAX_LENGTH, JsonText, format_json, parse_typed_value
from nep.errors import NepError

LINES = """{
  "action": "look",
  "input": {
    "pitch": 4.0
    "speed": 0.3
  }
}"""


def fixed(text: str) -> str:
    """Return the text after all available fixes were applied one after the other."""
    for _each in range(5):
        fault = JsonText(text).fault
        if fault is None or fault.fix is None:
            break
        text = text[: fault.fix.start] + fault.fix.text + text[fault.fix.end :]
    return text


def test_json_error_is_reported_with_its_position() -> None:
    fault = JsonText(LINES).fault
    assert fault is not None
    assert (fault.line, fault.column) == (4, 17)
    assert fault.message.startswith("Line 4, column 17: ")
    assert JsonText("x" * (MAX_LENGTH + 1)).fault is not None


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (LINES, {"action": "look", "input": {"pitch": 4.0, "speed": 0.3}}),
        ("{'a': True, b: None,}", {"a": True, "b": None}),
        ('{"a": [1, {"b": "x', {"a": [1, {"b": "x"}]}),
        ('["\\q", NaN]', ["\\q", None]),
        ('{"a": {yaw}\n"b": 1}', {"a": 2, "b": 1}),
    ],
)
def test_repaired_text_is_valid_json(text, value) -> None:
    assert JsonText(fixed(text)).fill({"yaw": 2}) == value


def test_placeholders_are_filled_only_outside_strings() -> None:
    read = JsonText('{"say": "a {name}", "to": {name}, "yaw": { yaw }, "again": [{name}]}')
    assert read.fault is None
    assert read.manual_placeholders == ("name", "yaw")
    made = read.fill({"name": 'Ai"ko', "yaw": -12.5})
    assert made == {"say": "a {name}", "to": 'Ai"ko', "yaw": -12.5, "again": ['Ai"ko']}
    with pytest.raises(NepError, match="Fill in “yaw” first"):
        read.fill({"name": "Aiko"})


def test_id_and_time_placeholders_get_new_values_each_time() -> None:
    read = JsonText('{"id": {new id}, "at": {now}}')
    assert read.manual_placeholders == ()
    one, other = read.fill({}), read.fill({})
    assert isinstance(one, dict)
    assert isinstance(other, dict)
    assert one["id"] != other["id"]
    assert 1e9 < one["at"] <= other["at"]


def test_number_is_rejected_as_object_key() -> None:
    read = JsonText("{{name}: 1}")
    assert read.fill({"name": "x"}) == {"x": 1}
    with pytest.raises(NepError, match="column 2"):
        read.fill({"name": 3})


@pytest.mark.parametrize(
    ("text", "value"),
    [("12.5", 12.5), ("Aiko", "Aiko"), ('"12"', "12"), (" true ", True), ("[1, 2]", [1, 2]), ("NaN", "NaN"),
     ("0,2", 0.2), ('"0,2"', "0,2"), ("[1,2]", [1, 2]), ("1.234,5", "1.234,5"), ("007", "007"), ("+3", "+3")],
)  # fmt: skip
def test_typed_value_is_json_or_falls_back_to_text(text, value) -> None:
    assert parse_typed_value(text) == value


def test_truncated_json_is_reported_with_line_and_column() -> None:
    value = {"a": [1, -2.5e-3, True, None], "b": {"c": 'x "y" \\ {z}', "ü": "\n"}, "d": [], "e": {}}
    text = format_json(value)
    assert JsonText(text).fill({}) == json.loads(text) == value
    for place in range(len(text)):
        cut = text[:place]
        fault = JsonText(cut).fault
        assert fault is not None
        lines = cut.split("\n")
        assert 1 <= fault.line <= len(lines)
        assert 1 <= fault.column <= len(lines[fault.line - 1]) + 1
        assert fault.message
        JsonText(fixed(cut))
