"""JSON as it is typed: where it is wrong, what mends it, and what its places are filled with."""

from __future__ import annotations

import json

import pytest

from app.core.run.acting.json_text import MOST_LETTERS, JsonText, pretty, value_typed
from nep.errors import NepError

LINES = """{
  "action": "look",
  "input": {
    "pitch": 4.0
    "speed": 0.3
  }
}"""


def mended(text: str) -> str:
    """The text after all that can be mended was, one after the other."""
    for _each in range(5):
        fault = JsonText(text).fault
        if fault is None or fault.mend is None:
            break
        text = text[: fault.mend.start] + fault.mend.text + text[fault.mend.end :]
    return text


@pytest.mark.parametrize(
    ("text", "line", "column", "sentence"),
    [
        ("  ", 1, 1, 'Write the message as JSON, such as {"x": 1}.'),
        (LINES, 4, 17, "Line 4 needs a comma at its end."),
        ('{"a": 1 "b": 2}', 1, 8, "Line 1 needs a comma between two values."),
        ('{"a": 1,\n}', 1, 8, "Line 1 has a comma too many at its end."),
        ("[1,2,]", 1, 5, "Line 1 has a comma too many at its end."),
        ('{"a" 1}', 1, 5, "Line 1 needs a colon after the name."),
        ('{"a": }', 1, 6, "Line 1 has no value after the colon."),
        ("{\n'a': 1}", 2, 1, "Line 2 has single quotes; JSON takes double ones."),
        ("{speed: 1}", 1, 2, "Line 1 needs quotes around speed."),
        ('{"a": True}', 1, 7, "Line 1 has True; JSON writes true."),
        ('{"a": NaN}', 1, 7, "Line 1 has NaN, which JSON does not know; null stands for no value."),
        ('["NaN", -Infinity]', 1, 9,
         "Line 1 has -Infinity, which JSON does not know; null stands for no value."),
        ('{"a": "x\n}', 1, 9, "Line 1 has a text without a closing quote."),
        ('["a\tb"]', 1, 4, "Line 1 has a tab inside a text; write \\t."),
        ('["a\x01b"]', 1, 4, "Line 1 has a sign inside a text that can't be seen; delete it."),
        ('["\\q"]', 1, 3, "Line 1 has a single \\; inside a text write \\\\."),
        ('{"a": [1, 2', 1, 12, "]} is missing at the end, after line 1."),
        ('{"a": [1}', 1, 9, "Line 1 closes with } what was opened otherwise."),
        ('{"a": 01}', 1, 8, "Line 1 has a number that JSON does not know."),
        ('{"a": 1} x', 1, 10, "Line 1 goes on after the end of the message."),
        ("1e999", 1, 1, "A number is too large to be sent."),
        ("9" * 5000, 1, 1, "A number is too large to be sent."),
        ("[" * 100_000, 1, 1, "It has too many levels."),
        ("x" * (MOST_LETTERS + 1), 1, 1,
         f"The text has more than {MOST_LETTERS} letters; send it by nep topic pub."),
    ],
)  # fmt: skip
def test_a_sentence_says_where_it_is_wrong(text, line, column, sentence) -> None:
    fault = JsonText(text).fault
    assert fault is not None
    assert (fault.line, fault.column, fault.sentence) == (line, column, sentence)


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
def test_what_can_be_mended_is_json_afterwards(text, value) -> None:
    assert JsonText(mended(text)).filled({"yaw": 2}) == value


def test_places_are_filled_outside_of_texts_alone() -> None:
    read = JsonText('{"say": "a {name}", "to": {name}, "yaw": { yaw }, "again": [{name}]}')
    assert read.fault is None
    assert read.to_fill == ("name", "yaw")
    made = read.filled({"name": 'Ai"ko', "yaw": -12.5})
    assert made == {"say": "a {name}", "to": 'Ai"ko', "yaw": -12.5, "again": ['Ai"ko']}
    with pytest.raises(NepError, match="Fill in “yaw” first"):
        read.filled({"name": "Aiko"})


def test_ids_and_times_fill_themselves_anew() -> None:
    read = JsonText('{"id": {new id}, "at": {now}}')
    assert read.to_fill == ()
    one, other = read.filled({}), read.filled({})
    assert isinstance(one, dict)
    assert isinstance(other, dict)
    assert one["id"] != other["id"]
    assert 1e9 < one["at"] <= other["at"]


def test_a_number_is_no_name_of_a_field() -> None:
    read = JsonText("{{name}: 1}")
    assert read.filled({"name": "x"}) == {"x": 1}
    with pytest.raises(NepError, match="needs a name in quotes"):
        read.filled({"name": 3})


@pytest.mark.parametrize(
    ("text", "value"),
    [("12.5", 12.5), ("Aiko", "Aiko"), ('"12"', "12"), (" true ", True), ("[1, 2]", [1, 2]), ("NaN", "NaN")],
)
def test_a_value_is_json_or_else_a_text(text, value) -> None:
    assert value_typed(text) == value


def test_a_cut_anywhere_has_its_line_and_column() -> None:
    value = {"a": [1, -2.5e-3, True, None], "b": {"c": 'x "y" \\ {z}', "ü": "\n"}, "d": [], "e": {}}
    text = pretty(value)
    assert JsonText(text).filled({}) == json.loads(text) == value
    for place in range(len(text)):
        cut = text[:place]
        fault = JsonText(cut).fault
        assert fault is not None
        lines = cut.split("\n")
        assert 1 <= fault.line <= len(lines)
        assert 1 <= fault.column <= len(lines[fault.line - 1]) + 1
        assert fault.sentence
        JsonText(mended(cut))
