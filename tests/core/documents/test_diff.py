"""How many blocks came, went and changed between two states of a behaviour."""

from __future__ import annotations

from app.core.documents.diff import Difference, difference

Block = dict[str, object]


def block(id: str, text: str = "", following: Block | None = None) -> Block:
    """A block with a word in its gap, and what hangs below it."""
    made: Block = {"id": id, "type": "robot_say"}
    if text:
        made["inputs"] = {"TEXT": {"shadow": {"id": f"{id} word", "type": "text", "fields": {"TEXT": text}}}}
    if following is not None:
        made["next"] = {"block": following}
    return made


def stack(*blocks: Block) -> dict[str, object]:
    return {"blocks": {"languageVersion": 0, "blocks": list(blocks)}}


def test_nothing_changed() -> None:
    assert difference(stack(block("a", "x")), stack(block("a", "x"))) == Difference(1)


def test_blocks_came_went_and_changed() -> None:
    then = stack(block("a", "x", block("b", "y")), block("c"))
    now = stack(block("a", "other", block("d")), block("c"), block("e"))
    assert difference(then, now) == Difference(3, added=2, removed=1, changed=1)


def test_words_inside_a_block_are_no_blocks_of_their_own() -> None:
    assert difference(stack(block("a", "x")), stack(block("a"))) == Difference(1, changed=1)


def test_the_same_blocks_in_another_order() -> None:
    then, now = stack(block("a", "", block("b"))), stack(block("b", "", block("a")))
    assert difference(then, now) == Difference(2, moved=True)


def test_anything_may_be_in_a_file() -> None:
    assert difference({}, {"blocks": 7}) == Difference(0, moved=True)


def test_a_very_long_stack() -> None:
    long = block("last")
    for number in range(3000):
        long = block(str(number), "", long)
    assert difference(stack(long), stack(long)) == Difference(3001)
