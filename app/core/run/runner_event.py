"""What a program's process says, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["ready", "running", "paused", "error", "print", "ended"]


@dataclass(frozen=True)
class RunnerEvent:
    """What a program's process said.

    ``run`` is the number of the runner's program. ``blocks`` run now (kind running), are held (paused; the
    first is the next one), or failed (error). ``says`` is what happens, in words (for paused: the next block
    in words); ``text`` a printed line, what a person should know (paused), an error's sentence, or at the end
    why it did not end well. ``ok``: it ended, and no block failed. ``silent``: robots that did not answer the
    program's own stop at its end.
    """

    kind: Kind
    run: int
    blocks: tuple[str, ...] = ()
    says: str = ""
    text: str = ""
    ok: bool = True
    elapsed_s: float | None = None
    silent: tuple[str, ...] = ()
