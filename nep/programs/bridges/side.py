"""One side of a bridge: its node, and the thread that maintains its subscribers and publishers."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from functools import partial
from typing import Protocol

from nep.errors import ClosedError, NepError
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.nodes.subscriber import Subscriber
from nep.programs.bridges.configuration import SideConfiguration, SideName
from nep.programs.bridges.other_bridges import HEARTBEAT_S
from nep.programs.bridges.route import Route
from nep.programs.robots.guard import MotionGuard
from nep.protocol.graph_view import BRIDGES_TOPIC, GraphView

_STATUS_TYPE = "nep/bridge"
_logger = logging.getLogger("nep")
_GRAPH_POLL_S, _EARLY_POLL_S = 1.0, 0.05
_REQUEST_TIMEOUT_S = 1.0
"""Time limit of requests to the master in seconds."""


class SideOwner(Protocol):
    """Interface through which a side uses its bridge."""

    own_nodes: frozenset[str]

    @property
    def routes(self) -> tuple[Route, ...]:
        """All routes in both directions."""

    def on_graph(self, side: BridgeSide, view: GraphView) -> None:
        """Create and remove the routes of a side, given its new graph."""

    def status(self) -> dict[str, object]:
        """Return the status to publish."""

    def publishes_status_on(self, side: BridgeSide, view: GraphView) -> bool:
        """Return True if the bridge publishes its status, and detects other bridges, on a side."""

    def on_status(self, side: SideName, message: Message) -> None:
        """Process a status received on a side, possibly the bridge's own."""


class BridgeSide:
    """Side of a bridge, which creates subscribers and publishers of routes once its network is available.

    The constructor raises `NepError` if the back end is not installed.

    Args:
        name: Name of the side.
        configuration: Back end and master of the side.
        node_name: Name of the node.
        allow_moving: Names of robots that may be moved; None for no motion guard.
    """

    def __init__(
        self,
        name: SideName,
        configuration: SideConfiguration,
        node_name: str,
        allow_moving: Collection[str] | None = None,
    ) -> None:
        self.name = name
        self.configuration = configuration
        self.view: GraphView | None = None
        self.problem = ""
        """Reason why the network is unavailable; "" if it is available or was not queried yet."""
        self.poll_count = 0
        """Number of successful graph queries."""
        self.node = Node(
            node_name, configuration.backend.name, master=configuration.master, wait_s=_REQUEST_TIMEOUT_S
        )
        self.guard = None if allow_moving is None else MotionGuard(self.node, allow_moving)
        self._wake_event = threading.Event()
        self._is_closing = False
        self._thread: threading.Thread | None = None
        self._poll_at = 0.0
        self._published_status: object = None
        self._published_at = float("-inf")
        self._status_publisher: Publisher | None = None
        self._bridges_subscriber: Subscriber | None = None

    @property
    def is_guard_ready(self) -> bool:
        """True if the descriptions of all current robots have been read, or there is no guard."""
        if self.guard is None or self.guard.is_settled:
            return True
        if self.view is not None:
            self.guard.update_graph(self.view)  # descriptions may have arrived since the last poll
        return self.guard.is_settled

    def start(self, owner: SideOwner) -> None:
        """Start the thread."""
        run = partial(self._run, owner)
        self._thread = threading.Thread(target=run, name=self.node.name, daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Wake the thread because a route needs a subscriber or publisher."""
        self._wake_event.set()

    def begin_close(self) -> None:
        """Start to close: subscribers and publishers are no longer created."""
        self._is_closing = True
        self._wake_event.set()

    def join(self, timeout_s: float) -> None:
        """Wait until the thread ends, for at most `timeout_s` seconds."""
        if self._thread is not None:
            self._thread.join(max(0.0, timeout_s))

    # ---- in the side's thread

    def _run(self, owner: SideOwner) -> None:
        while not self._is_closing:
            self._wake_event.clear()
            now = time.monotonic()
            undecided_routes = self._undecided_routes(owner)
            is_due = now >= self._poll_at or (
                bool(undecided_routes) and now >= self._poll_at - _GRAPH_POLL_S + _EARLY_POLL_S
            )
            if is_due:
                self._poll_graph(owner)
                self._poll_at = time.monotonic() + _GRAPH_POLL_S
            if self.view is not None:
                self._update_routes(owner, self.view, undecided_routes, is_due=is_due)
                if is_due and owner.publishes_status_on(self, self.view):
                    self._subscribe_to_bridges(owner)
                    self._publish_status({**owner.status(), "side": self.name})
            has_undecided = self.view is not None and self._undecided_routes(owner)
            poll_at = self._poll_at - (_GRAPH_POLL_S - _EARLY_POLL_S if has_undecided else 0.0)
            self._wake_event.wait(max(0.0, poll_at - time.monotonic()))

    def _undecided_routes(self, owner: SideOwner) -> list[Route]:
        # Their type depends on the current publishers, so the graph is polled first.
        routes = (each for each in owner.routes if each.end.side == self.name)
        return [each for each in routes if each.needs_type and self.name not in each.connection_problems]

    def _poll_graph(self, owner: SideOwner) -> None:
        try:
            view = self.node.graph(_REQUEST_TIMEOUT_S)
        except ClosedError:
            return
        except Exception as error:  # noqa: BLE001 - third-party back ends may raise anything
            reason = _error_text(error)
            if reason != self.problem:
                self.problem = reason
                _logger.warning(
                    "waiting for side %s of the bridge, %s: %s",
                    self.name,
                    self.configuration.network,
                    reason,
                )
            self.view = None
            return
        if self.problem:
            self.problem = ""
            _logger.warning("side %s of the bridge, %s, is connected", self.name, self.configuration.network)
        if self.guard is not None:
            self.guard.update_graph(view)
        self.view = view
        self.poll_count += 1
        owner.on_graph(self, view)
        for route in owner.routes:
            if route.origin.side == self.name:
                route.close_stale_publishers(view, time.monotonic())

    def _update_routes(
        self, owner: SideOwner, view: GraphView, undecided_routes: Sequence[Route], *, is_due: bool
    ) -> None:
        # Failed routes are retried with the next poll. The first message of an undecided route arrived before
        # the last poll; other routes wait for the next one.
        for route in owner.routes:
            if self._is_closing:
                return
            if self.name in route.connection_problems and not is_due:
                continue
            if route.origin.side == self.name:
                self._try_update(route, partial(route.subscribe, self.node, view, owner.own_nodes))
            elif route.needs_publisher and (
                not route.needs_type or (is_due and self._can_decide_type(route, undecided_routes))
            ):
                self._try_update(route, partial(route.open_publishers, self.node, view, owner.own_nodes))

    def _can_decide_type(self, route: Route, undecided_routes: Sequence[Route]) -> bool:
        return route in undecided_routes or self.name in route.connection_problems

    def _try_update(self, route: Route, update: Callable[[], None]) -> None:
        try:
            update()
        except ClosedError:
            return
        except Exception as error:  # noqa: BLE001 - see `_poll_graph`
            reason = _error_text(error)
            if reason != route.connection_problems.get(self.name):
                route.connection_problems[self.name] = reason
                _logger.warning(
                    "'%s' on side %s is not forwarded to '%s' yet: %s",
                    route.origin.topic,
                    route.origin.side,
                    route.end.topic,
                    reason,
                )
            return
        route.connection_problems.pop(self.name, None)

    def _subscribe_to_bridges(self, owner: SideOwner) -> None:
        def on_messages(messages: Sequence[Message]) -> None:
            for message in messages:
                owner.on_status(self.name, message)

        if self._bridges_subscriber is None and not self._is_closing:
            with suppress(NepError):  # retried with the next poll
                self._bridges_subscriber = self.node.new_sub(BRIDGES_TOPIC, _STATUS_TYPE, sink=on_messages)

    def _publish_status(self, status: dict[str, object]) -> None:
        now = time.monotonic()
        if self._is_closing or (status == self._published_status and now - self._published_at < HEARTBEAT_S):
            return
        with suppress(NepError):  # see `_subscribe_to_bridges`
            if self._status_publisher is None:
                self._status_publisher = self.node.new_pub(BRIDGES_TOPIC, _STATUS_TYPE, latched=True)
            self._status_publisher.publish(status)
            self._published_status, self._published_at = status, now


def _error_text(error: Exception) -> str:
    return str(error) if isinstance(error, NepError | ValueError) else f"{type(error).__name__}: {error}"
