"""Tests of the help text of blocks."""

from __future__ import annotations

import pytest

from app.blocks.toolbox.catalogue import Catalogue, categories
from app.blocks.toolbox.help import help_of
from tests.blocks.samples import robot

CATALOGUE = Catalogue([robot()])
ALL = sorted(CATALOGUE.blocks.values(), key=lambda each: each.type)


@pytest.mark.parametrize("described", ALL, ids=lambda each: each.type)
def test_every_block_has_help(described) -> None:
    told = help_of(described)
    assert str(told["does"]).endswith(".")
    assert str(told["example"]).startswith("For example: ")
    assert str(told["example"]).endswith(".")
    assert told["title"]
    for text in (str(told["title"]), str(told["example"]), str(told["more"])):
        assert "%" not in text
        assert "…" not in text
    shown = {argument.name for argument in described.arguments if not argument.is_display_only}
    assert len(told["gaps"]) >= len(shown)  # type: ignore[arg-type]


def test_every_built_in_block_has_its_own_example() -> None:
    examples = [described.example for category in categories() for described in category.blocks]
    assert all(example.startswith("For example: ") for example in examples)
    assert len(set(examples)) == len(examples)


def test_help_of_robot_block_comes_from_its_description() -> None:
    told = help_of(CATALOGUE.blocks["robot_pepper_do_turn"])
    assert told["title"] == "(robot) turn (direction) by (angle) °"
    assert told["example"] == "For example: Pepper turn left by 90 °."
    assert ["angle", "a number; 90 by default, from 0 to 360 °"] in told["gaps"]  # type: ignore[operator]
    assert ["direction", "“left” or “right”"] in told["gaps"]  # type: ignore[operator]


def test_slot_used_only_for_one_choice_is_described_in_help() -> None:
    told = help_of(CATALOGUE.blocks["lists_get"])
    assert told["title"] == "(where) (number) of (list)"
    assert told["gaps"][1] == [  # type: ignore[index]
        "number", "a number; 1 by default; used only if you choose by number",
    ]  # fmt: skip
