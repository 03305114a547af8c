"""All blocks that there are: those of the categories, and those of the robots that are known."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.robots.description.description import Robot
from nep.i18n import ENGLISH, language, translate
from nep.system.plugins import discover

_HOLE = re.compile(r"%[A-Za-z_]\w*")


class Catalogue:
    """Blocks by type. ``connected`` robots by name; `absent` ones bring their blocks, but can't be asked."""

    def __init__(self, robots: Sequence[Robot], absent: Sequence[Robot] = ()) -> None:
        """Make the blocks of all robots; where two models share a type, the connected one counts."""
        self.connected: Mapping[str, Robot] = {robot.name: robot for robot in robots}
        self.absent: Mapping[str, Robot] = {
            robot.name: robot for robot in absent if robot.name not in self.connected
        }
        known = (*self.connected.values(), *self.absent.values())
        self.blocks: dict[str, Block] = {}
        for category in categories():
            for block in category.blocks:
                self.blocks[block.type] = block
        for robot in known:
            for category in categories():
                for block in category.make(robot, known) if category.make else ():
                    self.blocks.setdefault(block.type, block)


def categories() -> tuple[Category, ...]:
    """Every category, in the toolbox's order and in the language of now."""
    return english_categories() if language() == ENGLISH else _translated(language())


@lru_cache(maxsize=1)
def _translated(_language: str) -> tuple[Category, ...]:
    return tuple(category.translated(_say) for category in english_categories())


@lru_cache(maxsize=1)
def english_categories() -> tuple[Category, ...]:
    """Every category as its module has it."""
    found = discover("app.blocks.categories", "CATEGORY", Category)
    return tuple(sorted(found.values(), key=lambda category: (category.order, category.name)))


def has_words(english: str) -> bool:
    """Whether a translator has something to do: "%A %SIGN %B" and "+" are the same everywhere."""
    return any(letter.isalpha() for letter in _HOLE.sub("", english))


def _say(context: str | None, english: str) -> str:
    return translate(context, english) if has_words(english) else english
