"""Trace of a running program: what each block did and when, as records in the order of their occurrence.

A script runs one block at a time: a block ends when its script begins the next one, or with `BlockEnded`.
Times are in seconds since the start of the program, on the program's clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Literal

from msgspec import Meta, Struct

MAX_BATCH_BYTES = 32_000
"""Maximum size of the records between two calls of `Trace.take`, as estimated by `_estimated_bytes`."""
MAX_TEXT_LENGTH = 2_000
_RECORD_BYTES = 64  # JSON of a record without the names of blocks, and without texts
_BYTES_PER_CHARACTER = 4  # at most, in UTF-8

_Text = Annotated[str, Meta(max_length=MAX_TEXT_LENGTH)]

WaitCause = Literal["time", "condition", "robot", "answer", "broadcast", "pace"]
"""What a block waits for: seconds, a condition, a robot, the user's answer, receivers of a broadcast, or the
delay of slow motion."""
InterruptionCause = Literal["pause", "hold", "replaced", "canceled"]
"""Why a block was interrupted: the program was paused, its group was held, its robot action was replaced by
that of another script, or the robot canceled the action."""
EndCause = Literal["", "failed", "stopped", "canceled"]
"""Why a script ended: "" at its end, an error, Stop, or another script or event that ended it."""
SkipCause = Literal["unknown_remainder"]
"""Why a block or its remainder was skipped: after a pause, the robot doesn't report how much remains."""


class TraceRecord(Struct, frozen=True, array_like=True, tag=True, gc=False):
    """Base class of the records of a trace.

    Attributes:
        time_s: Time since the start of the program in seconds.
    """

    time_s: float


class BlockBegan(TraceRecord, frozen=True, array_like=True, tag="began", gc=False):
    """Begin of a block, which ends the previous block of the script.

    A loop begins again after each repetition, when it checks its condition.

    Attributes:
        script: Number of the script.
        block: Id of the block.
    """

    script: int
    block: str


class BlockEnded(TraceRecord, frozen=True, array_like=True, tag="ended", gc=False):
    """End of the last block of a script's run.

    Attributes:
        script: Number of the script.
        block: Id of the block.
        cause: Why the run ended.
        text: Message if the block failed, else "".
        value_block: Id of the value in the block that failed, or "".
    """

    script: int
    block: str
    cause: EndCause = ""
    text: _Text = ""
    value_block: str = ""


class BlockWaiting(TraceRecord, frozen=True, array_like=True, tag="waiting", gc=False):
    """Begin of a wait within a block, recorded once per block and cause.

    Attributes:
        script: Number of the script.
        block: Id of the block.
        cause: What the block waits for.
    """

    script: int
    block: str
    cause: WaitCause


class BlockInterrupted(TraceRecord, frozen=True, array_like=True, tag="interrupted", gc=False):
    """Interruption before a block or within it.

    Attributes:
        script: Number of the script.
        block: Id of the block.
        cause: Why the block was interrupted; after "pause" and "hold", `BlockResumed` can follow.
    """

    script: int
    block: str
    cause: InterruptionCause


class BlockResumed(TraceRecord, frozen=True, array_like=True, tag="resumed", gc=False):
    """End of an interruption.

    Attributes:
        script: Number of the script.
        block: Id of the block.
    """

    script: int
    block: str


class BlockSkipped(TraceRecord, frozen=True, array_like=True, tag="skipped", gc=False):
    """Block that was not executed, or not executed to its end.

    Attributes:
        script: Number of the script.
        block: Id of the block.
        cause: Why it was skipped.
    """

    script: int
    block: str
    cause: SkipCause


class RecordsLost(TraceRecord, frozen=True, array_like=True, tag="lost", gc=False):
    """Records that were dropped because there were too many since the previous batch.

    Attributes:
        count: Number of dropped records.
        blocks: Current block of each running script, by the number of the script.
    """

    count: int
    blocks: dict[int, str]


AnyRecord = (
    BlockBegan | BlockEnded | BlockWaiting | BlockInterrupted | BlockResumed | BlockSkipped | RecordsLost
)


class Trace:
    """Recorder of a trace with a bounded buffer. Not thread-safe.

    Attributes:
        is_full: True if further records are dropped until the next `take`.
        lost_count: Number of records dropped since the last `take`.

    Args:
        now: Monotonic clock in seconds.
        max_bytes: Maximum size of the records between two calls of `take`.
    """

    def __init__(self, now: Callable[[], float], max_bytes: int = MAX_BATCH_BYTES) -> None:
        self._now, self._max_bytes = now, max_bytes
        self._start_s = now()
        self._records: list[AnyRecord] = []
        self._byte_count = 0
        self.is_full = False
        self.lost_count = 0

    def restart(self) -> None:
        """Set the time of the trace to 0."""
        self._start_s = self._now()

    def time_s(self) -> float:
        """Return the time since the start in seconds, rounded to microseconds."""
        return round(self._now() - self._start_s, 6)

    def began(self, script: int, block: str) -> None:
        """Record the begin of a block.

        Args:
            script: Number of the script.
            block: Id of the block.
        """
        self.add(BlockBegan(self.time_s(), script, block), len(block))

    def add(self, record: AnyRecord, text_length: int) -> None:
        """Append a record, or drop and count it if the buffer is full.

        Args:
            record: Record.
            text_length: Number of characters of its texts.
        """
        self._byte_count += _estimated_bytes(text_length)
        if self._byte_count > self._max_bytes:
            self.is_full = True
            self.lost_count += 1
        else:
            self._records.append(record)

    def take(self, blocks: Mapping[int, str]) -> tuple[AnyRecord, ...]:
        """Return the records since the last call; the last one is `RecordsLost` if records were dropped.

        Args:
            blocks: Current block of each running script, by the number of the script.
        """
        records, self._records = self._records, []
        if self.lost_count:
            records.append(RecordsLost(self.time_s(), self.lost_count, dict(blocks)))
        self._byte_count, self.is_full, self.lost_count = 0, False, 0
        return tuple(records)


def _estimated_bytes(text_length: int) -> int:
    return _RECORD_BYTES + _BYTES_PER_CHARACTER * text_length


class RunningBlocks:
    """Current block of each script, read from a trace; a failed or stopped script remains at its block.

    Attributes:
        begun: Ids of all blocks that have begun.
        failure: End of the first block that failed, or None.
    """

    def __init__(self) -> None:
        self.begun: frozenset[str] = frozenset()
        self.failure: BlockEnded | None = None
        self._blocks: dict[int, str] = {}

    @property
    def blocks(self) -> tuple[str, ...]:
        """Ids of the current blocks, in the order in which their scripts were started."""
        return tuple(dict.fromkeys(block for _script, block in sorted(self._blocks.items())))

    def apply(self, records: Iterable[AnyRecord]) -> None:
        """Apply the next records of the trace."""
        begun = set()
        for record in records:
            if isinstance(record, BlockBegan):
                self._blocks[record.script] = record.block
                begun.add(record.block)
            elif isinstance(record, BlockEnded):
                if record.cause in ("", "canceled"):
                    self._blocks.pop(record.script, None)
                elif record.cause == "failed" and self.failure is None:
                    self.failure = record
            elif isinstance(record, RecordsLost):
                self._blocks = dict(record.blocks)
                begun.update(record.blocks.values())
        if not begun <= self.begun:
            self.begun |= begun
