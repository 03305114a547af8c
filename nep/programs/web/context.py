"""What the parts of a page share: its node, its send queue, its thread, and how it is told of problems."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Literal, ParamSpec, TypeVar

from nep.nodes.node import Node
from nep.programs.robots.guard import MotionGuard
from nep.programs.web.messages.operations import LEVELS, Level, OperationId
from nep.programs.web.outgoing import EncodingOptions, operation_frames
from nep.programs.web.send_queue import SendQueue
from nep.programs.web.visitors import Device

__all__ = ["ConnectedPage", "PageContext", "PageTopic", "Protocol", "Refusal", "RefusalKind", "WebCounts"]

Protocol = Literal["rosbridge", "foxglove"]
RefusalKind = Literal["origin", "token", "robot", "limit", "kept out", "other"]
_ROBOT_REFUSAL_INTERVAL_S = 10.0
_MAX_REMEMBERED_ROBOTS = 50

_P = ParamSpec("_P")
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class PageTopic:
    """A topic that a page publishes or subscribes to.

    `at_most_per_s` is the limit that the page asked for (``throttle_rate``), None without one. `rate` and
    `bytes_per_s` are averages of the last two seconds, of what was sent to the page or received from it.
    `dropped_count` counts the messages that the page was too slow for, not those beyond its limit.
    """

    topic: str
    is_published: bool
    at_most_per_s: float | None = None
    rate: float = 0.0
    bytes_per_s: float = 0.0
    sent_count: int = 0
    dropped_count: int = 0


@dataclass(frozen=True, slots=True)
class ConnectedPage:
    """A page or program that is connected: its node, address, origin, and topics.

    `id` is given to `WebServer.disconnect`; `origin` is "" for programs; `since_s` is by `time.time`.
    `name` is that of its node, whose ``language`` in the graph is "web". `client` is the program, such as
    "Chrome" or "roslibpy", "" if it is not known. `title` is the file name of the page if it sends that
    (``ws://HOST:PORT/?title=buttons.html``, or a Referer), else the host of its origin, else `name`. Both
    are the client's own words: escaped and bounded, but not verified.
    """

    id: int
    name: str
    address: str
    origin: str
    since_s: float
    client: str = ""
    protocol: Protocol = "rosbridge"
    title: str = ""
    topics: tuple[PageTopic, ...] = ()
    dropped_count: int = 0
    device: Device = ""
    """Kind of device as far as the User-Agent tells; tablets often claim to be computers."""

    @property
    def subscribed(self) -> tuple[str, ...]:
        """Names of the topics that it subscribes to."""
        return tuple(each.topic for each in self.topics if not each.is_published)

    @property
    def published(self) -> tuple[str, ...]:
        """Names of the topics that it publishes."""
        return tuple(each.topic for each in self.topics if each.is_published)


@dataclass(frozen=True, slots=True)
class Refusal:
    """A connection that was refused, or a message of a page that would have moved a robot (kind "robot").

    `who` is the page's origin, or its address; `origin` is not "" where allowing that origin would help.
    `robot` is the name of the robot that the page asked to move, or the topic of a robot without a known
    name. The same page and robot appear at most once in ten seconds.
    """

    time_s: float
    who: str
    reason: str
    origin: str = ""
    kind: RefusalKind = "other"
    robot: str = ""


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
        self,
        node: Node,
        queue: SendQueue,
        thread: Executor,
        guard: MotionGuard,
        counts: WebCounts,
        *,
        on_robot_refused: Callable[[str, str], object] = lambda _robot, _reason: None,
        send_status: Callable[[Level, str], object] | None = None,
    ) -> None:
        """Create it.

        Args:
            node: Node of the page.
            queue: Messages that wait for the page.
            thread: Thread for what waits for the network.
            guard: Decides what the page may publish.
            counts: Counts of the server.
            on_robot_refused: Called with a robot that the page may not move, and the reason.
            send_status: Sends a status in a protocol other than rosbridge.
        """
        self.node = node
        self.queue = queue
        self.guard = guard
        self.counts = counts
        self.level: Level = "error"
        self._thread = thread
        self._on_robot_refused = on_robot_refused
        self._send_status = send_status
        self._refused_at: dict[str, float] = {}
        self._refused_lock = threading.Lock()

    async def in_thread(self, function: Callable[_P, _T], *args: _P.args, **named: _P.kwargs) -> _T:
        """Call what waits for the network in the page's own thread; calls keep their order."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, lambda: function(*args, **named))

    def motion_refusal(self, topic: str, msg_type: str) -> str:
        """Return why the page may not publish on a topic, and report it; "" when it may. Thread-safe."""
        refusal = self.guard.refusal(topic, msg_type)
        if refusal:
            for robot in self.guard.refused_robots(topic, msg_type):
                self._report_refused(robot, refusal)
        return refusal

    def _report_refused(self, robot: str, reason: str) -> None:
        now = time.monotonic()
        with self._refused_lock:
            if now - self._refused_at.get(robot, float("-inf")) < _ROBOT_REFUSAL_INTERVAL_S:
                return
            self._refused_at.pop(robot, None)
            self._refused_at[robot] = now
            while len(self._refused_at) > _MAX_REMEMBERED_ROBOTS:
                del self._refused_at[next(iter(self._refused_at))]
        self._on_robot_refused(robot, reason)

    def send_status(self, level: Level, sentence: str, id_: OperationId = None) -> None:
        """Send a status, unless the page wants none of this level."""
        if LEVELS.index(level) < LEVELS.index(self.level):
            return
        if self._send_status is not None:
            self._send_status(level, sentence)
            return
        status: dict[str, object] = {"op": "status", "level": level, "msg": sentence}
        if id_ is not None:
            status["id"] = id_
        self.queue.put(operation_frames(status, EncodingOptions()))
