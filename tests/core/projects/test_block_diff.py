"""Tests of counting added, removed and changed blocks between two states of a behaviour."""

from __future__ import annotations

from app.blocks.model.project import Project
from app.core.projects.block_diff import Difference, difference

Block = dict[str, object]


def block(id: str, text: str = "", following: Block | None = None) -> Block:
    """Return a block with a text in its slot, and the block below it."""
    made: Block = {"id": id, "type": "robot_say"}
    if text:
        made["inputs"] = {"TEXT": {"shadow": {"id": f"{id} word", "type": "text", "fields": {"TEXT": text}}}}
    if following is not None:
        made["next"] = {"block": following}
    return made


def stack(*blocks: Block) -> Project:
    return Project.of_blocks("Mine", {"blocks": {"languageVersion": 0, "blocks": list(blocks)}})


def test_unchanged_behaviour_has_no_difference() -> None:
    assert difference(stack(block("a", "x")), stack(block("a", "x"))) == Difference(1)


def test_added_removed_and_changed_blocks_are_counted() -> None:
    then = stack(block("a", "x", block("b", "y")), block("c"))
    now = stack(block("a", "other", block("d")), block("c"), block("e"))
    assert difference(then, now) == Difference(3, added_count=2, removed_count=1, changed_count=1)


def test_shadow_text_change_counts_as_changed_block() -> None:
    assert difference(stack(block("a", "x")), stack(block("a"))) == Difference(1, changed_count=1)


def test_reordered_blocks_are_reported_as_moved() -> None:
    then, now = stack(block("a", "", block("b"))), stack(block("b", "", block("a")))
    assert difference(then, now) == Difference(2, is_rearranged=True)


def test_invalid_workspace_can_be_compared() -> None:
    assert difference(Project.of_blocks("Mine", {}), Project.of_blocks("Mine", {"blocks": 7})) == Difference(
        0, is_rearranged=True
    )


def test_very_long_stack_can_be_compared() -> None:
    long = block("last")
    for number in range(3000):
        long = block(str(number), "", long)
    assert difference(stack(long), stack(long)) == Difference(3001)
