"""Objects shared by the parts of a page's connection, and public data about pages and rejections."""

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

Protocol = Literal["rosbridge", "foxglove"]
RejectionKind = Literal["origin", "token", "robot", "limit", "kept out", "other"]
_ROBOT_REJECTION_INTERVAL_S = 10.0
_MAX_REPORTED_ROBOTS = 50

_P = ParamSpec("_P")
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class PageTopic:
    """Topic that a page publishes or subscribes to.

    Attributes:
        topic: Name of the topic.
        is_published: True if the page publishes the topic, False if the page subscribes to it.
        max_rate_hz: Maximum messages per second that the page requested (``throttle_rate``), or None.
        rate_hz: Messages per second, sent to or received from the page, averaged over two seconds.
        bytes_per_s: Bytes per second, averaged in the same way.
        sent_count: Number of messages sent to the page.
        dropped_count: Number of messages dropped because the page was too slow; messages beyond the
            requested rate are not counted.
    """

    topic: str
    is_published: bool
    max_rate_hz: float | None = None
    rate_hz: float = 0.0
    bytes_per_s: float = 0.0
    sent_count: int = 0
    dropped_count: int = 0


@dataclass(frozen=True, slots=True)
class ConnectedPage:
    """Connected page or program.

    `client` and `title` are claims of the client: escaped and bounded, but not verified.

    Attributes:
        id: Id for `WebServer.disconnect`.
        name: Name of the page's node, whose ``language`` in the graph is "web".
        address: Address and port of the client.
        origin: Origin of the page; "" for programs.
        since_s: Time of the connection (s since 1970).
        client: Name of the program, such as "Chrome" or "roslibpy"; "" if unknown.
        protocol: Protocol of the connection.
        title: File name of the page if the page sends it (``ws://HOST:PORT/?title=buttons.html``, or a
            Referer), else the host of its origin, else `name`.
        topics: Topics that the page publishes or subscribes to.
        dropped_count: Number of messages dropped because the page was too slow.
        device: Kind of device according to the User-Agent header: "phone", "tablet", or "" for a computer or
            an unknown device. Many tablets claim to be computers.
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

    @property
    def subscribed_topics(self) -> tuple[str, ...]:
        """Names of the topics to which the page subscribes."""
        return tuple(each.topic for each in self.topics if not each.is_published)

    @property
    def published_topics(self) -> tuple[str, ...]:
        """Names of the topics that the page publishes."""
        return tuple(each.topic for each in self.topics if each.is_published)


@dataclass(frozen=True, slots=True)
class Rejection:
    """Rejected connection, or (kind "robot") rejected message that would have moved a robot.

    Rejected messages of a page to the same robot are listed at most once in ten seconds.

    Attributes:
        time_s: Time of the rejection (s since 1970).
        client: Origin of the page, or its address.
        reason: Reason as a sentence.
        origin: Origin of the page if allowing it would let the page connect, else "".
        kind: Kind of the rejection.
        robot: Name of the robot that the page tried to move, or the topic of a robot of unknown name.
    """

    time_s: float
    client: str
    reason: str
    origin: str = ""
    kind: RejectionKind = "other"
    robot: str = ""


@dataclass
class WebCounts:
    """Counters of a server since its start. Modified only in the thread of its event loop."""

    opened: int = 0
    """Number of accepted connections."""
    turned_away: int = 0
    """Number of rejected connections: wrong origin, no valid token, or too many connections."""
    operations: int = 0
    rejected: int = 0
    """Number of failed operations, for each of which the page received a status."""
    motions_rejected: int = 0
    """Number of rejected messages that would have moved a robot."""
    sent: int = 0
    dropped: int = 0
    """Number of messages dropped because pages were too slow."""

    def as_map(self) -> Mapping[str, int]:
        """Return the counters by name."""
        return asdict(self)


class PageContext:
    """Objects shared by the parts of one page's connection."""

    def __init__(
        self,
        node: Node,
        queue: SendQueue,
        thread: Executor,
        guard: MotionGuard,
        counts: WebCounts,
        *,
        on_robot_rejected: Callable[[str, str], object] = lambda _robot, _reason: None,
        send_status: Callable[[Level, str], object] | None = None,
    ) -> None:
        """Initialize the context.

        Args:
            node: Node of the page.
            queue: Queue of messages to be sent to the page.
            thread: Executor with a single thread, for calls that wait for the network.
            guard: Motion guard that decides on which topics the page may publish.
            counts: Counters of the server.
            on_robot_rejected: Called with the name of a robot that the page may not move, and the reason.
            send_status: Sends a status in another protocol; None for rosbridge.
        """
        self.node = node
        self.queue = queue
        self.guard = guard
        self.counts = counts
        self.level: Level = "error"
        self._thread = thread
        self._on_robot_rejected = on_robot_rejected
        self._send_status = send_status
        self._rejection_times_s: dict[str, float] = {}
        self._rejection_lock = threading.Lock()

    async def run_in_thread(self, function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Call a function in the page's thread, because the function waits for the network.

        Calls are executed in order.
        """
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, lambda: function(*args, **kwargs))

    def motion_denial_reason(self, topic: str, msg_type: str) -> str:
        """Return and report the reason why the page may not publish on a topic; "" if it may.

        Thread-safe.
        """
        reason = self.guard.denial_reason(topic, msg_type)
        if reason:
            for robot in self.guard.denied_robots(topic, msg_type):
                self._report_rejected(robot, reason)
        return reason

    def _report_rejected(self, robot: str, reason: str) -> None:
        now = time.monotonic()
        with self._rejection_lock:
            if now - self._rejection_times_s.get(robot, float("-inf")) < _ROBOT_REJECTION_INTERVAL_S:
                return
            self._rejection_times_s.pop(robot, None)
            self._rejection_times_s[robot] = now
            while len(self._rejection_times_s) > _MAX_REPORTED_ROBOTS:
                del self._rejection_times_s[next(iter(self._rejection_times_s))]
        self._on_robot_rejected(robot, reason)

    def send_status(self, level: Level, message: str, id_: OperationId = None) -> None:
        """Send a status to the page unless its level is below the level that the page requested.

        Args:
            level: Level of the status.
            message: Message for the page.
            id_: Id of the operation that caused the status, if any.
        """
        if LEVELS.index(level) < LEVELS.index(self.level):
            return
        if self._send_status is not None:
            self._send_status(level, message)
            return
        status: dict[str, object] = {"op": "status", "level": level, "msg": message}
        if id_ is not None:
            status["id"] = id_
        self.queue.put(operation_frames(status, EncodingOptions()))
