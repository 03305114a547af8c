"""A compiled behaviour, and whether compiling one would hold the window up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.blocks import Program

QUICK_S = 0.02
"""A behaviour that compiles faster than this is compiled at once, in the window's thread."""
LONG_CHARACTERS = 20_000
Key = tuple[int, int, int]


@dataclass(frozen=True)
class Compiled:
    """A program, what it was made of, and how long that took."""

    key: Key
    program: Program
    seconds: float


def compiled(key: Key, compiling: Callable[[], Program], timer: Callable[[], float]) -> Compiled:
    """Compile, and take the time."""
    began = timer()
    return Compiled(key, compiling(), timer() - began)


def is_long(workspace: Mapping[str, object]) -> bool:
    """Whether a behaviour that was never compiled is worth a thread."""
    inner = workspace.get("blocks")
    tops = inner.get("blocks") if isinstance(inner, Mapping) else None
    try:
        return tops is not None and len(repr(tops)) > LONG_CHARACTERS
    except RecursionError:
        return True
