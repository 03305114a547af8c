from __future__ import annotations

import math

import pytest

from app.blocks.runtime import values
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.pure import texts
from tests.blocks.fakes import play
from tests.blocks.samples import block, number, started, text, workspace, write

FAMILY = "👨‍👩‍👧"
FLAGS = "🇦🇷🇲🇽"


def worked_out(name: str, *given: object) -> object:
    try:
        return getattr(texts, name)(*given)
    except BehaviourError as error:
        return error.sentence


@pytest.mark.parametrize(
    ("words", "count"),
    [
        ("", 0),
        ("Hello", 5),
        ("é", 1),
        ("e\u0301", 1),
        ("👍🏽", 1),
        (FAMILY, 1),
        (FLAGS, 2),
        (f"a{FAMILY}b", 3),
        ("日本", 2),
    ],
)
def test_letters_are_grapheme_clusters(words, count):
    assert values.length(words) == count
    assert "".join(values.grapheme_clusters(words)) == words


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("letter", ("Hello", 1), "H"),
        ("letter", ("Hello", "last"), "o"),
        ("letter", (f"a{FAMILY}", 2), FAMILY),
        ("letter", (FLAGS, 2), "🇲🇽"),
        ("letter", (2026, "first"), "2"),
        ("letter", ("a", "random"), "a"),
        ("letter", ("Hello", 0), "The text has only 5 letters; it has no letter 0."),
        ("letter", ("Hello", -1), "The text has only 5 letters; it has no letter -1."),
        ("letter", ("H", 2**64 - 1), "The text has only 1 letter; it has no letter 18446744073709551615."),
        ("letter", ("Hello", 1.5), "“letter number” needs a whole number, not 1.5."),
        ("letter", ("", 1), "The text is empty."),
        ("letter", ("Hello", "two"), "“letter number” needs a number, not a text."),
        ("letter", ("Hello", math.nan), "“letter number” needs a finite number."),
        ("letter", ("Hello", None), "“letter number” can't run: one of its values isn't known yet."),
        ("part_of_text", ("Hello", 1, 4), "Hell"),
        ("part_of_text", ("Hello", 4, 99), "lo"),
        ("part_of_text", ("Hello", -3, 2), "He"),
        ("part_of_text", ("Hello", 4, 2), ""),
        ("part_of_text", ("", 1, 2**64 - 1), ""),
        ("part_of_text", ("Hello", math.inf, 2), "“letters” needs a finite number."),
        ("position_in_text", ("Hello", "l"), 3),
        ("position_in_text", (f"{FAMILY}x", "x"), 2),
        ("position_in_text", ("Hello", "z"), 0),
        ("position_in_text", ("Hello", ""), 0),
        ("has_in_it", ("Hello", ""), True),
        ("has_in_it", (2026, 2), True),
        ("has_in_it", (None, "a"), False),
        ("starts_with", ("Hello", "He"), True),
        ("ends_with", ("Hello", "He"), False),
        ("same_words", (" YES", "yes "), True),
        ("same_words", ("STRASSE", "straße"), True),
        ("same_words", (5, "5"), True),
        ("same_words", ("", None), True),
        ("is_empty", ("  \n",), True),
        ("is_empty", (0,), False),
        ("in_capitals", ("straße",), "STRASSE"),
        ("in_small_letters", ("ÁB",), "áb"),
        ("without_spaces_around", ("  a b ",), "a b"),
        ("backwards", (f"ab{FAMILY}",), f"{FAMILY}ba"),
        ("replaced", ("a-b-c", "-", ""), "abc"),
        ("replaced", ("abc", "", "x"), "abc"),
        ("number_in", ("I am 12 years old",), 12),
        ("number_in", ("−3.5 °C",), -3.5),  # noqa: RUF001 (the sign that people write)
        ("number_in", ("2,5",), 2.5),
        ("number_in", ("0,125",), 0.125),
        ("number_in", ("1,000 m",), 1000),
        ("number_in", ("1,234,567.5",), 1234567.5),
        ("number_in", ("18446744073709551615",), 2**64 - 1),
        ("number_in", (7.5,), 7.5),
        ("number_in", ("",), "“” doesn't contain a number."),
        ("number_in", ("two",), "“two” doesn't contain a number."),
        ("number_in", ("nan inf",), "“nan inf” doesn't contain a number."),
        ("number_in", ("9" * 5000,), f"“{'9' * 60}” doesn't contain a number."),
        ("number_in", (math.nan,), "“number in” needs a finite number."),
        ("number_in", (None,), "“number in” can't run: one of its values isn't known yet."),
        ("has_number", ("room 4",), True),
        ("has_number", ("²",), False),
        ("has_number", ([1],), True),
        ("has_number", ("",), False),
    ],
)  # fmt: skip
def test_text_operations_return_expected_results(name, given, expected):
    result = worked_out(name, *given)
    assert (type(result), result) == (type(expected), expected)


def test_length_of_replaced_text_is_limited():
    with pytest.raises(BehaviourError, match="too long"):
        texts.replaced("a" * 1000, "a", "b" * 2000)


def test_letter_block_runs_and_error_names_its_block():
    far = block("texts_letter", "far", WHERE="number", NUMBER=number(9), TEXT=text("Hello"))
    first = block("texts_letter", WHERE="first", NUMBER=number(9), TEXT=text("Ada"))
    run = play(workspace(started(write(first), write(far))))
    assert run.lines == ["A"]
    assert run.runtime.error is not None
    assert run.runtime.error.block == "far"
