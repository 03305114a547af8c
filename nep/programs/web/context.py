"""What the parts of a page share: its node, its send queue, its thread, and how it is told of problems."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import ParamSpec, TypeVar

from nep.nodes.node import Node
from nep.programs.robots.guard import MotionGuard
from nep.programs.web.operations import LEVELS, Level, OperationId
from nep.programs.web.outgoing import EncodingOptions, operation_frames
from nep.programs.web.send_queue import SendQueue

__all__ = ["ConnectedPage", "PageContext", "Refusal", "WebCounts"]

_P = ParamSpec("_P")
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class ConnectedPage:
    """A page or program that is connected: its node, address, origin, and topics.

    `id` is given to `WebServer.disconnect`; `origin` is "" for programs; `since_s` is by `time.time`.
    """

    id: int
    name: str
    address: str
    origin: str
    since_s: float
    subscribed: tuple[str, ...] = ()
    published: tuple[str, ...] = ()
    dropped_count: int = 0


@dataclass(frozen=True, slots=True)
class Refusal:
    """A connection or an operation that was refused.

    `who` is the page's origin, or its address; `origin` is not "" where allowing that origin would help.
    """

    time_s: float
    who: str
    reason: str
    origin: str = ""


@dataclass
class WebCounts:
    """What a server has done since it was started. Written in its event loop's thread."""

    opened: int = 0
    """Connections that were let in."""
    turned_away: int = 0
    """Connections that were not: of another origin, without the token, or too many."""
    operations: int = 0
    rejected: int = 0
    """Operations that could not be carried out; each was answered by a status."""
    motions_refused: int = 0
    """Messages that would have moved a robot."""
    sent: int = 0
    dropped: int = 0
    """Messages that pages were too slow for."""

    def as_map(self) -> Mapping[str, int]:
        """The counts by their names."""
        return asdict(self)


class PageContext:
    """See the module."""

    def __init__(
        self, node: Node, queue: SendQueue, thread: Executor, guard: MotionGuard, counts: WebCounts
    ) -> None:
        self.node = node
        self.queue = queue
        self.guard = guard
        self.counts = counts
        self.level: Level = "error"
        self._thread = thread

    async def in_thread(self, function: Callable[_P, _T], *args: _P.args, **named: _P.kwargs) -> _T:
        """Call what waits for the network in the page's own thread; calls keep their order."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, lambda: function(*args, **named))

    def tell(self, level: Level, sentence: str, id_: OperationId = None) -> None:
        """Send a status, unless the page wants none of this level."""
        if LEVELS.index(level) < LEVELS.index(self.level):
            return
        status: dict[str, object] = {"op": "status", "level": level, "msg": sentence}
        if id_ is not None:
            status["id"] = id_
        self.queue.put(operation_frames(status, EncodingOptions()))
