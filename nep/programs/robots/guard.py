"""Motion guard of programs without a window, which may move only robots that the user allowed.

The guard subscribes to the descriptions of all robots on the network. A description's claim "virtual" is not
trusted here, because only the program that started a virtual robot can verify it (docs/trust.md).
"""

from __future__ import annotations

import shlex
import threading
import time
from collections.abc import Collection, Sequence

from nep.errors import NepError
from nep.i18n import _, format_list
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.programs.robots.moving import (
    DESCRIPTION_TYPE,
    MovingTopics,
    RobotControls,
    description_topics,
    moving_topics,
    original_robots,
    parse_controls,
    robot_name_of,
)
from nep.protocol.graph_view import GraphView
from nep.text import escaped, shortened

MAX_DESCRIPTIONS = 200
MAX_DESCRIPTION_BYTES = 1_000_000
_MAX_CLAIMANTS = 8
_MAX_QUEUED_BYTES = 16 * 2**20
_MAX_CACHED = 10_000
_MAX_NAME_LENGTH, _MAX_NAMES_SHOWN = 100, 5
_POLL_S = 0.05
_GRAPH_TIMEOUT_S = 0.5


class MotionGuard:
    """Guard that decides on which topics a program may publish. Thread-safe.

    Call `update_graph` with each new graph. `denial_reason` is a dictionary look-up unless something has
    changed. Before the first graph, no robots are known: only topics of type ``robot/command`` and RIZE's
    command topic are guarded.

    Args:
        node: Node that subscribes to the robots' descriptions.
        allowed: Names of robots that may be moved. The name of a topic allows publishing on that topic.
        own_nodes: Ids of the program's own nodes (default: the id of `node`).
    """

    def __init__(
        self, node: Node, allowed: Collection[str] = (), *, own_nodes: Collection[str] | None = None
    ) -> None:
        self._node = node
        self._allowed = frozenset(allowed)
        self._own_nodes = frozenset((node.id,) if own_nodes is None else own_nodes)
        self._lock = threading.RLock()
        self._unparsed_lock = threading.Lock()  # never held while subscribing, which may wait for the sink
        self._subscribers: dict[str, Subscriber] = {}
        self._unparsed_messages: dict[tuple[str, int | None], Message] = {}
        """Descriptions that are still to be parsed: the newest of each publisher."""
        self._controls: dict[str, dict[int | None, RobotControls]] = {}
        """Last valid description of each publisher, by description topic."""
        self._moving = MovingTopics()
        self._view: GraphView | None = None
        self._is_dirty = False
        self._cache: dict[tuple[str, str], str] = {}

    @property
    def moving_topics(self) -> MovingTopics:
        """Topics that currently move robots."""
        return self._moving

    @property
    def is_settled(self) -> bool:
        """True if a graph was processed and the descriptions of all its robots were read."""
        with self._lock:
            return self._view is not None and not self._is_dirty and not self._unread_topics(self._view)

    def update_graph(self, view: GraphView) -> None:
        """Process a new graph. Returns quickly if nothing has changed."""
        with self._lock:
            previous = self._view
            if previous is not None and (previous.epoch, previous.revision) == (view.epoch, view.revision):
                if not self._is_dirty:
                    return
            else:
                self._view = view if self._subscribe(view) else None  # retried with the next graph
            self._rebuild(view)

    def poll(self) -> None:
        """Query the graph and process it. Does nothing if the master doesn't reply."""
        try:
            view = self._node.graph(_GRAPH_TIMEOUT_S)
        except NepError:
            return
        self.update_graph(view)

    def wait_for_descriptions(self, timeout_s: float) -> bool:
        """Wait until the descriptions of all robots are read; return False after `timeout_s` seconds."""
        deadline = time.monotonic() + timeout_s
        while True:
            self.poll()
            if self.is_settled or time.monotonic() >= deadline:
                return self.is_settled
            threading.Event().wait(_POLL_S)

    def set_allowed(self, names: Collection[str]) -> None:
        """Replace the names of the robots and topics that are allowed; takes effect immediately."""
        with self._lock:
            self._allowed = frozenset(names)
            self._cache = {}

    def denied_robots(self, topic: str, msg_type: str = "") -> tuple[str, ...]:
        """Return the names of the robots that publishing would move without permission.

        A robot of unknown name is represented by the topic.

        Args:
            topic: Topic to publish on.
            msg_type: Message type to publish with, if known.
        """
        with self._lock:
            return _denied_robots(topic, self._moving.robots_moved_by(topic, msg_type), self._allowed)

    def denial_reason(self, topic: str, msg_type: str = "") -> str:
        """Return the reason why publishing is denied, with the option that allows it; "" if it is allowed.

        Args:
            topic: Topic to publish on.
            msg_type: Message type to publish with, if known.
        """
        key = topic, msg_type
        reason = self._cache.get(key)
        if reason is None:
            with self._lock:
                reason = denial_text(topic, self._moving.robots_moved_by(topic, msg_type), self._allowed)
                if len(self._cache) >= _MAX_CACHED:
                    self._cache.clear()
                self._cache[key] = reason
        return reason

    def close(self) -> None:
        """Unsubscribe from the descriptions. Robots that are already known stay protected."""
        with self._lock:
            subscribers, self._subscribers = list(self._subscribers.values()), {}
        for subscriber in subscribers:
            subscriber.close()

    # ---- descriptions

    def _subscribe(self, view: GraphView) -> bool:
        # Returns False if a subscription failed. Robots that left stay known: the computer may have been
        # suspended.
        for topic in sorted(description_topics(view) - self._subscribers.keys()):
            if len(self._subscribers) >= MAX_DESCRIPTIONS:
                departed = next((each for each in self._subscribers if each not in view.topics), None)
                if departed is None:
                    return True  # the remaining ones count as unread
                self._subscribers.pop(departed).close()
                self._controls.pop(departed, None)
            try:
                subscriber = self._node.new_sub(topic, DESCRIPTION_TYPE, sink=self._receive, wildcards=False)
            except NepError:
                return False
            self._subscribers[topic] = subscriber
        return True

    def _receive(self, messages: Sequence[Message]) -> None:
        with self._unparsed_lock:
            for message in messages:
                key = message.topic, message.publisher
                self._unparsed_messages.pop(key, None)
                if len(message.data) <= MAX_DESCRIPTION_BYTES:
                    self._unparsed_messages[key] = message
            while sum(len(each.data) for each in self._unparsed_messages.values()) > _MAX_QUEUED_BYTES:
                del self._unparsed_messages[next(iter(self._unparsed_messages))]  # its robot counts as unread
            self._is_dirty = True

    def _rebuild(self, view: GraphView) -> None:
        with self._unparsed_lock:
            self._is_dirty = False
            unparsed_messages, self._unparsed_messages = self._unparsed_messages, {}
        for (topic, publisher), message in unparsed_messages.items():
            controls = _parse_description(message, topic)
            if controls is not None:
                known_controls = self._controls.setdefault(topic, {})
                known_controls.pop(publisher, None)
                known_controls[publisher] = controls
                while len(known_controls) > _MAX_CLAIMANTS:
                    del known_controls[next(iter(known_controls))]
        robots = [
            controls for known_controls in self._controls.values() for controls in known_controls.values()
        ]
        robots += original_robots(view)
        self._moving = moving_topics(view, robots, self._unread_topics(view), self._own_nodes)
        self._cache = {}

    def _unread_topics(self, view: GraphView) -> frozenset[str]:
        def is_unread(topic: str) -> bool:
            read_ids = self._controls.get(topic, {}).keys()
            return None not in read_ids and any(
                each.id not in read_ids for each in view.topics[topic].publishers
            )

        return frozenset(filter(is_unread, description_topics(view)))


def _parse_description(message: Message, topic: str) -> RobotControls | None:
    # Every publisher's description is used, because it can only protect.
    try:
        return parse_controls(message.payload, robot_name_of(topic))
    except Exception:  # noqa: BLE001 - untrusted input; an unread robot is protected by its subscriptions
        return None


def _denied_robots(topic: str, robots: Sequence[str], allowed: Collection[str]) -> tuple[str, ...]:
    return () if topic in allowed else tuple(name for name in robots if name not in allowed)


def denial_text(topic: str, robots: Sequence[str], allowed: Collection[str]) -> str:
    """Return an error message that names the robots and the option that allows moving them.

    Args:
        topic: Topic to publish on.
        robots: Names of the robots that would move.
        allowed: Names of the robots and topics that are allowed.

    Returns:
        The message; "" if all robots are allowed.
    """
    denied_robots = list(_denied_robots(topic, robots, allowed))
    if not denied_robots:
        return ""
    topic_text = shortened(escaped(topic), _MAX_NAME_LENGTH)
    names = [shortened(escaped(name), _MAX_NAME_LENGTH) for name in denied_robots]
    is_named = denied_robots != [topic] and len(names) <= _MAX_NAMES_SHOWN
    options = " ".join(
        f"--allow-moving {shlex.quote(each)}" for each in (names if is_named else [topic_text])
    )
    if denied_robots == [topic]:
        template = _("'{topic}' moves a robot; make sure that nobody is in the way, then add {options}")
        return template.format(topic=topic_text, options=options)
    robots = names[:_MAX_NAMES_SHOWN] + ["…"] * (len(names) > _MAX_NAMES_SHOWN)
    template = _("'{topic}' moves {robots}; make sure that nobody is in the way, then add {options}")
    return template.format(topic=topic_text, robots=format_list(robots), options=options)
