"""What is different between two states of a behaviour, roughly: how many blocks came, went and changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.blocks.model.workspace import Placed, parse_workspace
from app.core.storage import deep_json

Workspace = Mapping[str, object]


@dataclass(frozen=True)
class Difference:
    """Of ``blocks`` blocks then: how many were ``added``, ``removed`` and ``changed`` since."""

    blocks: int
    added: int = 0
    removed: int = 0
    changed: int = 0
    moved: bool = False
    """Whether they are the same blocks, put together in another way."""


def difference(then: Workspace, now: Workspace) -> Difference:
    """Blocks are the same when their ids are; numbers and words inside a block are part of it."""
    old, new = (dict(_blocks(workspace)) for workspace in (then, now))
    stayed = old.keys() & new.keys()
    made = Difference(
        len(old),
        added=len(new.keys() - old.keys()),
        removed=len(old.keys() - new.keys()),
        changed=sum(old[id] != new[id] for id in stayed),
    )
    if made != Difference(len(old)) or _same(then, now):
        return made
    return Difference(len(old), moved=True)


def _same(then: Workspace, now: Workspace) -> bool:
    try:
        return deep_json.same(then, now)
    except RecursionError:
        return False


def _blocks(workspace: Workspace) -> Iterator[tuple[str, object]]:
    """The id of each block that a person placed, and what it says."""
    for block in parse_workspace(workspace).all_blocks():
        if not block.shadow:
            yield block.id, _said(block)


def _said(block: Placed) -> object:
    inside = {name: [_said(inner) for inner in held if inner.shadow] for name, held in block.inputs.items()}
    return (
        block.type,
        dict(block.fields),
        block.enabled,
        dict(block.extra),
        {k: v for k, v in inside.items() if v},
    )
