"""Tests of faults in JSON text: their position, their reason and the edit that fixes them."""

from __future__ import annotations

import json

import pytest

from nep.messages.json_fault import find_json_fault, looks_like_json

LINES = """{
  "action": "look",
  "input": {
    "pitch": 4.0
    "speed": 0.3
  }
}"""


@pytest.mark.parametrize(
    ("text", "line", "column", "word"),
    [
        ("  ", 1, 1, "the text is empty"),
        (LINES, 4, 17, "a comma is missing"),
        ('{"a": 1 "b": 2}', 1, 8, "a comma is missing"),
        ('{"a": 1,\n}', 1, 8, "an extra comma"),
        ("[1,2,]", 1, 5, "an extra comma"),
        ('{"a" 1}', 1, 5, "a colon is missing"),
        ('{"a": }', 1, 6, "a value is missing"),
        ("{\n'a': 1}", 2, 1, "double quotes"),
        ("{speed: 1}", 1, 2, "speed needs double quotes"),
        ('{"a": True}', 1, 7, "true instead of True"),
        ('{"a": NaN}', 1, 7, "NaN isn't JSON; use null"),
        ('["NaN", -Infinity]', 1, 9, "-Infinity isn't JSON"),
        ('{"a": "x\n}', 1, 9, "no closing quote"),
        ('["a\tb"]', 1, 4, "a tab"),
        ('["a\x01b"]', 1, 4, "invisible"),
        ('["\\q"]', 1, 3, "a single \\"),
        ('["\\ud800"]', 1, 3, "surrogate"),
        ('{"a": [1, 2', 1, 12, "a closing ]} is missing at the end"),
        ('{"fix": {"lat": 35.7}', 1, 22, "a closing } is missing at the end"),
        ('{"a": [1}', 1, 9, "} doesn't match"),
        ('{"a": 01}', 1, 8, "doesn't support this number"),
        ('{"a": 1} x', 1, 10, "extra text after the first value"),
        ("1e999", 1, 1, "too large"),
        ("9" * 5000, 1, 1, "too large"),
        ("[" * 100_000, 1, 1, "levels"),
    ],
)
def test_json_fault_has_position_and_reason(text, line, column, word) -> None:
    fault = find_json_fault(text)
    assert fault is not None
    assert (fault.line, fault.column) == (line, column)
    assert word in fault.reason
    assert fault.is_nan == (word.partition(" ")[0] in {"NaN", "-Infinity"})


def test_applying_json_fixes_repairs_the_text() -> None:
    text = '{"a": [1, {"b": "x'
    while (fault := find_json_fault(text)) is not None:
        assert fault.fix is not None
        text = text[: fault.fix.start] + fault.fix.text + text[fault.fix.end :]
    assert json.loads(text) == {"a": [1, {"b": "x"}]}


def test_nan_is_accepted_if_allowed() -> None:
    assert find_json_fault('{"a": NaN}', allow_nan=True) is None
    fault = find_json_fault('{"a": NaN', allow_nan=True)
    assert fault is not None
    assert not fault.is_nan


@pytest.mark.parametrize("text", ['{"a', "[1", '"x', "-1.", "0x", "NaN", " true ", "-Infinity"])
def test_text_that_begins_like_json_is_recognized_as_json(text) -> None:
    assert looks_like_json(text)


@pytest.mark.parametrize("text", ["hello", "", "truest", "- x", "'a'", "Nancy", ".5"])
def test_text_without_json_syntax_is_not_recognized_as_json(text) -> None:
    assert not looks_like_json(text)
