"""Categories of the toolbox.

A plug-in is a module of `app.blocks.categories` that binds ``CATEGORY``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.blocks.model.block import Block
from app.blocks.model.fields import Translate
from app.robots.description.description import Robot


@dataclass(frozen=True)
class ToolboxEntry:
    """Block in the toolbox, with preset field values."""

    block: Block
    fields: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """Titled group of blocks under the heading of a robot in the toolbox, such as "Speech"."""

    title: str
    icon: str
    style: str
    entries: tuple[ToolboxEntry, ...]


@dataclass(frozen=True)
class Category:
    """Category of blocks in the toolbox.

    Attributes:
        order: Position in the toolbox.
        button: Text and key of a button above the blocks.
        make_blocks: Returns the blocks of a robot, given its description and the descriptions of all robots.
        make_groups: Returns the groups under the heading of a robot; arguments as for `make_blocks`.
        functions: Functions of the category's module that the Python of its blocks calls, by their names.
            They can't wait or use a robot; an error for the user is a `BehaviourError`.
    """

    name: str
    title: str
    style: str
    icon: str
    order: int
    blocks: tuple[Block, ...] = ()
    button: tuple[str, str] | None = None
    make_blocks: Callable[[Robot, Sequence[Robot]], tuple[Block, ...]] | None = None
    dynamic: str = ""  # the editor adds user-defined blocks: "functions"
    headings: Mapping[str, str] = field(default_factory=dict)  # block type -> heading above it
    parent: str = ""  # category that includes these blocks, under their title
    make_groups: Callable[[Robot, Sequence[Robot]], tuple[Group, ...]] | None = None
    functions: tuple[Callable[..., object], ...] = ()

    def translated(self, translate: Translate) -> Category:
        """Return the category with translated texts; see `Block.translated`."""
        button = None if self.button is None else (translate(None, self.button[0]), self.button[1])
        return replace(
            self,
            title=translate("category", self.title),
            button=button,
            headings={block: translate("heading", heading) for block, heading in self.headings.items()},
            blocks=tuple(block.translated(translate) for block in self.blocks),
        )
