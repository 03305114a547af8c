"""Record of one run: its state, and what its blocks did."""

from __future__ import annotations

from app.blocks.runtime.trace import RunningBlocks
from app.core.run.view import RunState


class RunRecord:
    """Record of one run, from Run until the robots' replies to its Stop. A new run has a new record.

    Attributes:
        state: Newest state of the run.
        blocks: What its blocks did, read from the trace of the program.
    """

    def __init__(self, state: RunState) -> None:
        self.state = state
        self.blocks = RunningBlocks()

    @property
    def name(self) -> str:
        """Name of the behaviour, or the text of the block that is tried."""
        return self.state.tried_label or self.state.name

    @property
    def is_active(self) -> bool:
        """True while the program is running or paused."""
        return self.state.state in {"running", "paused"}

    @property
    def failure(self) -> str:
        """Message of the block that failed, or ""."""
        if self.blocks.failure is not None:
            return self.blocks.failure.text
        return next(iter(self.state.errors.values()), "")  # of a program that failed before its first block
