"""All blocks that there are: those of the categories, and those of the robots that are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.robots.description.description import Robot
from nep.system.plugins import discover


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


@lru_cache(maxsize=1)
def categories() -> tuple[Category, ...]:
    """Every category, in the toolbox's order."""
    found = discover("app.blocks.categories", "CATEGORY", Category)
    return tuple(sorted(found.values(), key=lambda category: (category.order, category.name)))
