"""Difference between two states of a project: numbers of added, removed and changed blocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from app.blocks.model.project import Project
from app.blocks.model.workspace import PlacedBlock, parse_workspace


@dataclass(frozen=True)
class Difference:
    """Difference between an earlier state of a behaviour and its current one.

    Attributes:
        block_count: Number of blocks in the earlier state.
        added_count: Number of added blocks.
        removed_count: Number of removed blocks.
        changed_count: Number of blocks whose fields, values or texts differ.
        is_rearranged: True if the blocks are the same, but their positions or anything else in the
            workspace differs.
    """

    block_count: int
    added_count: int = 0
    removed_count: int = 0
    changed_count: int = 0
    is_rearranged: bool = False


def difference(earlier: Project, now: Project) -> Difference:
    """Return the difference between an earlier and the current state, comparing blocks by id.

    Numbers and texts in the slots of a block count as part of that block.
    """
    old, new = (dict(_blocks(project)) for project in (earlier, now))
    common_ids = old.keys() & new.keys()
    result = Difference(
        len(old),
        added_count=len(new.keys() - old.keys()),
        removed_count=len(old.keys() - new.keys()),
        changed_count=sum(old[id] != new[id] for id in common_ids),
    )
    if result != Difference(len(old)) or earlier.pages == now.pages:
        return result
    return Difference(len(old), is_rearranged=True)


def _blocks(project: Project) -> Iterator[tuple[str, object]]:
    # Blocks that the user placed, with their content.
    for page in project.pages:
        for block in parse_workspace(page.workspace.blocks, page.block_prefix).all_blocks():
            if not block.is_shadow:
                yield block.id, _content(block)


def _content(block: PlacedBlock) -> object:
    shadow_contents = {
        name: [_content(inner) for inner in inner_blocks if inner.is_shadow]
        for name, inner_blocks in block.inputs.items()
    }
    return (
        block.type,
        dict(block.fields),
        block.is_enabled,
        dict(block.extra_state),
        {k: v for k, v in shadow_contents.items() if v},
    )
