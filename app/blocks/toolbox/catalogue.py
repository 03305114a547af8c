"""Catalogue of the blocks of all categories and all known robots."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.robots.description.description import Robot
from nep.i18n import ENGLISH, language, translate
from nep.system.plugins import discover

_PLACEHOLDER = re.compile(r"%[A-Za-z_][A-Za-z0-9_]*")


class Catalogue:
    """Block descriptions by type.

    Attributes:
        blocks: Descriptions of all blocks by type.
        connected: Connected robots by name.
        absent: Disconnected robots by name; `blocks` contains their blocks, which can't run.
    """

    def __init__(self, robots: Sequence[Robot], absent: Sequence[Robot] = ()) -> None:
        self.connected: Mapping[str, Robot] = {robot.name: robot for robot in robots}
        self.absent: Mapping[str, Robot] = {
            robot.name: robot for robot in absent if robot.name not in self.connected
        }
        robots_with_absent = (*self.connected.values(), *self.absent.values())
        self.blocks: dict[str, Block] = {}
        for category in categories():
            for block in category.blocks:
                self.blocks[block.type] = block
        for robot in robots_with_absent:
            for category in categories():
                for block in category.make_blocks(robot, robots_with_absent) if category.make_blocks else ():
                    self.blocks.setdefault(block.type, block)

    def copy(self) -> Catalogue:
        """Return a catalogue to which descriptions can be added without changing this one."""
        copied = copy.copy(self)
        copied.blocks = dict(self.blocks)
        return copied


def categories() -> tuple[Category, ...]:
    """Return all categories in the order of the toolbox, translated to the current language."""
    return english_categories() if language() == ENGLISH else _translated_categories(language())


@lru_cache(maxsize=1)
def _translated_categories(_language: str) -> tuple[Category, ...]:
    return tuple(category.translated(_translate) for category in english_categories())


@lru_cache(maxsize=1)
def english_categories() -> tuple[Category, ...]:
    """Return all categories in the order of the toolbox, in English."""
    discovered = discover("app.blocks.categories", "CATEGORY", Category)
    return tuple(sorted(discovered.values(), key=lambda category: (category.order, category.name)))


@lru_cache(maxsize=1)
def function_modules() -> Mapping[str, str]:
    """Return the modules of the functions that categories define (`Category.functions`), by function name."""
    return {
        function.__name__: function.__module__
        for category in english_categories()
        for function in category.functions
    }


def is_translatable(english: str) -> bool:
    """Return True if a text on a block contains words to translate; False for "+" or "%A %SIGN %B"."""
    return any(letter.isalpha() for letter in _PLACEHOLDER.sub("", english))


def _translate(context: str | None, english: str) -> str:
    return translate(context, english) if is_translatable(english) else english
