"""Tests of the parser for typed numbers, with the same examples as the tests of the block editor."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.robots.description.typed_number import TypedNumberError, parse_number

EXAMPLES = json.loads((Path(__file__).parents[1] / "data" / "typed_numbers.json").read_text("utf-8"))


@pytest.mark.parametrize(("text", "number"), EXAMPLES["numbers"])
def test_comma_and_point_are_decimal_separators(text: str, number: float) -> None:
    assert parse_number(text) == number


@pytest.mark.parametrize("text", EXAMPLES["separators"])
def test_thousands_separators_are_rejected_instead_of_removed(text: str) -> None:
    with pytest.raises(TypedNumberError) as caught:
        parse_number(text)
    assert caught.value.has_separators


@pytest.mark.parametrize("text", EXAMPLES["not_numbers"])
def test_text_that_is_not_a_number_is_rejected(text: str) -> None:
    with pytest.raises(TypedNumberError) as caught:
        parse_number(text)
    assert not caught.value.has_separators
