"""Guard of programs without a window: they move no robot that nobody has allowed them to move.

It subscribes to the descriptions of all robots on the network. The claim "virtual" of a description is not
believed here, because only the program that started a virtual robot can verify it (docs/trust.md).
"""

from __future__ import annotations

import shlex
import threading
import time
from collections.abc import Collection, Sequence

from nep.errors import NepError
from nep.i18n import _, listed
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.programs.robots.moving import (
    DESCRIPTION_TYPE,
    MovingTopics,
    RobotControls,
    controls_in,
    described_name,
    description_topics,
    moving_topics,
    original_robots,
)
from nep.protocol.graph_view import GraphView
from nep.text import escaped, shortened

__all__ = ["MotionGuard", "refusal_words"]

MAX_DESCRIPTIONS = 200
MAX_DESCRIPTION_BYTES = 1_000_000
_MAX_CLAIMANTS = 8
_MAX_WAITING_BYTES = 16 * 2**20
_MAX_CACHED = 10_000
_MAX_NAME_SHOWN, _MAX_NAMES_SHOWN = 100, 5
_POLL_S = 0.05
_GRAPH_TIMEOUT_S = 0.5


class MotionGuard:
    """Decide whether a program may publish on a topic. Thread-safe.

    Call `see` with each new graph; `refusal` is a dictionary look-up until something has changed. Before the
    first graph nothing is known about robots, and only the message type and RIZE's topic decide.
    """

    def __init__(
        self, node: Node, allowed: Collection[str] = (), *, own_nodes: Collection[str] | None = None
    ) -> None:
        """Guard what `node` publishes.

        Args:
            node: Subscribes to the robots' descriptions.
            allowed: Names of robots that may be moved. A topic stands for whatever robot it moves.
            own_nodes: Ids of the program's own nodes; without it only that of `node`.
        """
        self._node = node
        self._allowed = frozenset(allowed)
        self._own_nodes = frozenset((node.id,) if own_nodes is None else own_nodes)
        self._lock = threading.RLock()
        self._received_lock = threading.Lock()  # never held while subscribing, which may wait for the sink
        self._subscribers: dict[str, Subscriber] = {}
        self._received: dict[tuple[str, int | None], Message] = {}
        """Descriptions that wait to be read, the newest of each publisher."""
        self._controls: dict[str, dict[int | None, RobotControls]] = {}
        """By description topic what each publisher described last in a readable form."""
        self._moving = MovingTopics()
        self._view: GraphView | None = None
        self._is_dirty = False
        self._cache: dict[tuple[str, str], str] = {}

    @property
    def moving(self) -> MovingTopics:
        """The topics that move robots now."""
        return self._moving

    @property
    def is_settled(self) -> bool:
        """Whether a graph was seen and every description in it was read."""
        with self._lock:
            return self._view is not None and not self._is_dirty and not self._unread(self._view)

    def see(self, view: GraphView) -> None:
        """Take over a new graph; costs little when nobody came or went and no description arrived."""
        with self._lock:
            before = self._view
            if before is not None and (before.epoch, before.revision) == (view.epoch, view.revision):
                if not self._is_dirty:
                    return
            else:
                self._view = view if self._subscribe(view) else None  # else it is tried again
            self._rebuild(view)

    def look(self) -> None:
        """Ask the master who is there and take that over; what was known stays while it does not answer."""
        try:
            view = self._node.graph(_GRAPH_TIMEOUT_S)
        except NepError:
            return
        self.see(view)

    def settle(self, timeout_s: float) -> bool:
        """Wait until all descriptions that are there were read, `timeout_s` at most; whether they were."""
        until = time.monotonic() + timeout_s
        while True:
            self.look()
            if self.is_settled or time.monotonic() >= until:
                return self.is_settled
            threading.Event().wait(_POLL_S)

    def set_allowed(self, names: Collection[str]) -> None:
        """Replace the robots (or topics) that may be moved; applies to the next call of `refusal`."""
        with self._lock:
            self._allowed = frozenset(names)
            self._cache = {}

    def refused_robots(self, topic: str, msg_type: str = "") -> tuple[str, ...]:
        """Return the robots for which `refusal` refuses a topic; the topic itself for an unknown robot."""
        with self._lock:
            return _not_allowed(topic, self._moving.moved_by(topic, msg_type), self._allowed)

    def refusal(self, topic: str, msg_type: str = "") -> str:
        """Return why nothing may be published on a topic, with the option that allows it; "" when it may."""
        key = topic, msg_type
        said = self._cache.get(key)
        if said is None:
            with self._lock:
                said = refusal_words(topic, self._moving.moved_by(topic, msg_type), self._allowed)
                if len(self._cache) >= _MAX_CACHED:
                    self._cache.clear()
                self._cache[key] = said
        return said

    def close(self) -> None:
        """Unsubscribe from the descriptions; what was known stays."""
        with self._lock:
            subscribers, self._subscribers = list(self._subscribers.values()), {}
        for each in subscribers:
            each.close()

    # ---- descriptions

    def _subscribe(self, view: GraphView) -> bool:
        """Subscribe to descriptions; whether all are subscribed.

        One that has gone stays known: its program may only have slept.
        """
        for topic in sorted(description_topics(view) - self._subscribers.keys()):
            if len(self._subscribers) >= MAX_DESCRIPTIONS:
                gone = next((each for each in self._subscribers if each not in view.topics), None)
                if gone is None:
                    return True  # those that are left out count as not read
                self._subscribers.pop(gone).close()
                self._controls.pop(gone, None)
            try:
                made = self._node.new_sub(topic, DESCRIPTION_TYPE, sink=self._receive, wildcards=False)
            except NepError:
                return False
            self._subscribers[topic] = made
        return True

    def _receive(self, messages: Sequence[Message]) -> None:
        with self._received_lock:
            for message in messages:
                key = message.topic, message.publisher
                self._received.pop(key, None)
                if len(message.data) <= MAX_DESCRIPTION_BYTES:
                    self._received[key] = message
            while sum(len(each.data) for each in self._received.values()) > _MAX_WAITING_BYTES:
                del self._received[next(iter(self._received))]  # its robot counts as not read
            self._is_dirty = True

    def _rebuild(self, view: GraphView) -> None:
        with self._received_lock:
            self._is_dirty = False
            received, self._received = self._received, {}
        for (topic, publisher), message in received.items():
            controls = _read(message, topic)
            if controls is not None:
                claims = self._controls.setdefault(topic, {})
                claims.pop(publisher, None)
                claims[publisher] = controls
                while len(claims) > _MAX_CLAIMANTS:
                    del claims[next(iter(claims))]
        robots = [controls for claims in self._controls.values() for controls in claims.values()]
        robots += original_robots(view)
        self._moving = moving_topics(view, robots, self._unread(view), self._own_nodes)
        self._cache = {}

    def _unread(self, view: GraphView) -> frozenset[str]:
        """The description topics with a publisher whose description could not be read so far."""

        def is_unread(topic: str) -> bool:
            read = self._controls.get(topic, {}).keys()
            return None not in read and any(each.id not in read for each in view.topics[topic].publishers)

        return frozenset(filter(is_unread, description_topics(view)))


def _read(message: Message, topic: str) -> RobotControls | None:
    """The robot that a message describes; everybody's word counts here, because it only protects."""
    try:
        return controls_in(message.payload, described_name(topic))
    except Exception:  # noqa: BLE001 - a stranger wrote it; what its program hears is protected
        return None


def _not_allowed(topic: str, robots: Sequence[str], allowed: Collection[str]) -> tuple[str, ...]:
    return () if topic in allowed else tuple(name for name in robots if name not in allowed)


def refusal_words(topic: str, robots: Sequence[str], allowed: Collection[str]) -> str:
    """Return the sentence that names the robots and the option that allows it; "" when all are allowed."""
    missing = list(_not_allowed(topic, robots, allowed))
    if not missing:
        return ""
    shown = shortened(escaped(topic), _MAX_NAME_SHOWN)
    names = [shortened(escaped(name), _MAX_NAME_SHOWN) for name in missing]
    is_named = missing != [topic] and len(names) <= _MAX_NAMES_SHOWN
    options = " ".join(f"--allow-moving {shlex.quote(each)}" for each in (names if is_named else [shown]))
    if missing == [topic]:
        said = _("'{topic}' moves a robot; add {options} when nobody is in its way")
        return said.format(topic=shown, options=options)
    robots = names[:_MAX_NAMES_SHOWN] + ["…"] * (len(names) > _MAX_NAMES_SHOWN)
    said = _("'{topic}' moves {robots}; add {options} when nobody is in the way")
    return said.format(topic=shown, robots=listed(robots), options=options)
