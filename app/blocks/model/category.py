"""A category of the toolbox: a plug-in is one module of `app.blocks.categories` that binds ``CATEGORY``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.blocks.model.block import Block
from app.blocks.model.fields import Say
from app.robots.description.description import Robot


@dataclass(frozen=True)
class ToolboxEntry:
    """One block in the toolbox, with fields that are set there already."""

    block: Block
    fields: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """A part of the toolbox under a robot's heading: "Speech" with its blocks."""

    title: str
    icon: str
    style: str
    entries: tuple[ToolboxEntry, ...]


@dataclass(frozen=True)
class Category:
    """Blocks that belong together.

    ``order`` is its place in the toolbox, ``button`` words and key of a button above its blocks.
    ``make`` gives the blocks of a robot (all robots that are known are passed, so that its drop-down can name
    those of the same model), ``groups`` where they stand under the robot's heading.
    """

    name: str
    title: str
    style: str
    icon: str
    order: int
    blocks: tuple[Block, ...] = ()
    button: tuple[str, str] | None = None
    make: Callable[[Robot, Sequence[Robot]], tuple[Block, ...]] | None = None
    dynamic: str = ""  # the editor adds what people made themselves: "functions"
    headings: Mapping[str, str] = field(default_factory=dict)  # type of a block -> what stands above it
    within: str = ""  # the category whose blocks these stand among, under their title
    groups: Callable[[Robot, Sequence[Robot]], tuple[Group, ...]] | None = None

    def translated(self, say: Say) -> Category:
        """The same with the words that `say` gives for the English ones, see `Block.translated`."""
        button = None if self.button is None else (say(None, self.button[0]), self.button[1])
        return replace(
            self,
            title=say("category", self.title),
            button=button,
            headings={block: say("heading", words) for block, words in self.headings.items()},
            blocks=tuple(block.translated(say) for block in self.blocks),
        )
