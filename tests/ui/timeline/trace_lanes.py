"""Lanes of a program's trace: one lane per script, with a bar for each block."""

from __future__ import annotations

from collections.abc import Iterable

from app.blocks.runtime.trace import AnyRecord, BlockBegan, BlockEnded, BlockWaiting, RecordsLost
from app.core.timeline.lanes import (
    BarLayer,
    FlagLayer,
    LaneFigure,
    LaneLayer,
    Mark,
    Notch,
    NotchLayer,
    OutlineLayer,
    TimelineContent,
    TimelineLane,
)


def ns(time_s: float) -> int:
    return round(time_s * 1e9)


class _ScriptLane:
    """Blocks and waits of a script."""

    def __init__(self) -> None:
        self.bars, self.waits = list[Mark](), list[Mark]()
        self._block: tuple[str, int] | None = None
        self._wait: tuple[str, int] | None = None

    def begin(self, block: str, at_ns: int) -> None:
        self.end(at_ns)
        self._block = (block, at_ns)

    def wait(self, cause: str, at_ns: int) -> None:
        self._wait = (cause, at_ns)

    def end(self, at_ns: int, failure: str = "") -> None:
        if self._block is not None:
            block, start_ns = self._block
            status, icon = ("error", "circle-x") if failure else ("ok", "circle-check")
            self.bars.append(
                Mark(start_ns, at_ns, block, f"block {block}", "blocks", status, failure, icon, key=block)
            )
        if self._wait is not None:
            self.waits.append(Mark(self._wait[1], at_ns, self._wait[0], status="warn"))
        self._block = self._wait = None

    def layers(self, losses: list[Notch]) -> tuple[LaneLayer, ...]:
        return BarLayer(self.bars), OutlineLayer(self.waits), NotchLayer(losses, "{} records lost".format)


def trace_content(records: Iterable[AnyRecord]) -> TimelineContent:
    """Return the lanes of a trace."""
    scripts: dict[int, _ScriptLane] = {}
    losses, ends = list[Notch](), list[Mark]()
    for record in records:
        at_ns = ns(record.time_s)
        match record:
            case BlockBegan():
                scripts.setdefault(record.script, _ScriptLane()).begin(record.block, at_ns)
            case BlockWaiting():
                scripts[record.script].wait(record.cause, at_ns)
            case BlockEnded():
                scripts[record.script].end(at_ns, record.text)
                ends.append(Mark(at_ns, at_ns, f"script {record.script} ended"))
            case RecordsLost():
                losses.append(Notch(at_ns, record.count))
    lanes = []
    for number, lane in sorted(scripts.items()):
        figures = (LaneFigure(f"{len(lane.bars)}"),)
        layers = lane.layers(losses)
        lanes.append(TimelineLane(f"script-{number}", f"Script {number}", "blocks", layers, figures))
    return TimelineContent((TimelineLane("ends", "Ends", "flag", (FlagLayer(ends),)),), lanes, ("Blocks",))
