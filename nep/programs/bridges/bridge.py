"""`Bridge`: two nodes and the routes between them."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import asdict
from typing import TYPE_CHECKING

from nep.errors import DecodeError, NepError
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.programs.bridges.configuration import (
    SIDES,
    BridgeConfiguration,
    BridgeTopic,
    SideName,
    check_topic_names,
)
from nep.programs.bridges.other_bridges import OtherBridges, RouteKey
from nep.programs.bridges.pacer import Pacer
from nep.programs.bridges.route import Route, RouteEnd
from nep.programs.bridges.side import BridgeSide
from nep.programs.bridges.topic_types import published_type
from nep.programs.bridges.trail import LoopGuard
from nep.protocol.graph_view import GraphView

if TYPE_CHECKING:
    from typing_extensions import Self


MAX_ROUTES = 500
"""Number of routes in both directions beyond which patterns create no more routes."""
IDLE_TIMEOUT_S = 60.0
"""Time in seconds without a publisher after which a route that a pattern created is removed."""
_INTERNAL_PREFIX = "/nep/"
_WAIT_SLICE_S = 0.05
_FLUSH_TIMEOUT_S, _JOIN_TIMEOUT_S = 2.0, 0.2
_logger = logging.getLogger("nep")


class Bridge:
    """Bridge that forwards the configured topics until it is closed. Usable as a context manager.

    The bridge waits for networks and topics that don't exist yet. The constructor raises `NepError` for a
    back end that is not installed or does not know a message type.

    Args:
        configuration: The two networks and their topics.
        allow_moving: Names of robots that may be moved. Messages that would move other robots are dropped and
            counted as failed. None forwards everything, for programs that check messages themselves.
    """

    def __init__(
        self, configuration: BridgeConfiguration, *, allow_moving: Collection[str] | None = None
    ) -> None:
        self.configuration = configuration
        self.id = secrets.token_hex(8)
        self._own_publisher_ids: set[int] = set()
        self._loop_guards: dict[tuple[SideName, str], LoopGuard] = {}
        self._lock = threading.Lock()
        self._pacer = Pacer(f"bridge-{configuration.name}-pace")
        self._routes: tuple[Route, ...] = ()
        self._route_keys: set[tuple[SideName, str, str]] = set()
        self._is_full = False
        self._other_bridges = OtherBridges(self.id)
        self._warned_bridge_ids: set[str] = set()
        self._closed = threading.Event()
        self.own_nodes: frozenset[str] = frozenset()
        """Ids of the bridge's two nodes."""
        self.sides: dict[SideName, BridgeSide] = {}
        try:
            for name in SIDES:
                side = configuration.side(name)
                self.sides[name] = BridgeSide(name, side, configuration.node_name(name), allow_moving)
            _check_types(configuration)
            self.own_nodes = frozenset(side.node.id for side in self.sides.values())
            self._start()
        except BaseException:
            self.close(0.0)
            raise

    def _start(self) -> None:
        for topic in self.configuration.topics:
            if not topic.is_pattern:
                for origin in topic.origins:
                    self._add_route(topic, origin, topic.a.name, topic.b.name)
        for side in self.sides.values():
            side.start(self)

    @property
    def routes(self) -> tuple[Route, ...]:
        """Routes, one per topic and direction. Routes created by patterns come last."""
        return self._routes

    @property
    def is_ready(self) -> bool:
        """True if both graphs are known, and all listed topics whose type is known are subscribed."""
        return all(each.is_ready for each in self._routes) and all(
            side.view is not None for side in self.sides.values()
        )

    def wait_until_ready(self, timeout_s: float | None = None) -> bool:
        """Wait until the bridge is ready; return False if it was closed or the time limit has passed.

        Args:
            timeout_s: Time limit in seconds; None for no limit.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self.is_ready:
            if self._closed.is_set() or (deadline is not None and time.monotonic() >= deadline):
                return False
            self._closed.wait(_WAIT_SLICE_S)
        return True

    def denial_reasons(self, timeout_s: float) -> tuple[str, ...]:
        """Return the reasons why listed topics are not forwarded, because they would move robots.

        Waits at most `timeout_s` seconds until both graphs and the descriptions of their robots are known.
        """
        deadline = time.monotonic() + timeout_s
        while not all(side.is_guard_ready for side in self.sides.values()) and time.monotonic() < deadline:
            self._closed.wait(_WAIT_SLICE_S)
        reasons = (each.denial_reason for each in self._routes if not each.is_from_pattern)
        return tuple(dict.fromkeys(filter(None, reasons)))

    def status(self) -> dict[str, object]:
        """Return the configuration and message counts in the form published on `/nep/bridges`."""
        return {
            "bridge": self.configuration.name,
            "id": self.id,
            "is_ready": self.is_ready,
            "sides": [
                {
                    "side": name,
                    "backend": side.configuration.backend.name,
                    "network": side.configuration.network,
                    "problem": side.problem,
                }
                for name, side in self.sides.items()
            ],
            "routes": [
                {
                    "from": {"side": each.origin.side, "topic": each.origin.topic},
                    "to": {"side": each.end.side, "topic": each.end.topic},
                    "trouble": each.connection_problem,
                    "rival": each.rival,
                    **asdict(each.counts()),
                }
                for each in self._routes
            ],
        }

    # ---- routes

    def _add_route(self, topic: BridgeTopic, origin: SideName, a: str, b: str) -> None:
        with self._lock:
            route_key = (origin, a, b)
            if route_key in self._route_keys:
                return
            self._route_keys.add(route_key)
            route_ends = {"a": self._route_end(topic, "a", a), "b": self._route_end(topic, "b", b)}
            end: SideName = "b" if origin == "a" else "a"
            route = Route(
                route_ends[origin],
                route_ends[end],
                bridge=self.id,
                own_publishers=self._own_publisher_ids,
                wake=self.sides[end].wake,
                pacer=self._pacer,
                max_rate_hz=topic.max_rate_hz,
            )
            route.is_from_pattern = topic.is_pattern
            self._routes = (*self._routes, route)

    def _route_end(self, topic: BridgeTopic, side: SideName, name: str) -> RouteEnd:
        side_configuration, end = self.configuration.side(side), topic.end(side)
        loop_guard = self._loop_guards.setdefault((side, name), LoopGuard())
        guard = self.sides[side].guard
        return RouteEnd(
            side,
            side_configuration.network,
            side_configuration.backend,
            name,
            end.msg_type,
            end.qos,
            loop_guard,
            guard,
        )

    def on_graph(self, side: BridgeSide, view: GraphView) -> None:
        """Create routes for published topics that match a pattern, and remove idle ones.

        Called with each new graph of a side, in the side's thread.
        """
        self._check_other_bridges()
        self._close_idle_routes(side, view, time.monotonic())
        exact_topics = {each.end(side.name).name for each in self.configuration.topics if not each.is_pattern}
        for name in view.topics:
            if (
                name in exact_topics
                or name.startswith(_INTERNAL_PREFIX)
                or not published_type(view, name, self.own_nodes)
            ):
                continue
            for topic, a, b in self._matching_topics(side.name, name):
                if len(self._routes) < MAX_ROUTES:
                    self._add_route(topic, side.name, a, b)
                elif not self._is_full and (side.name, a, b) not in self._route_keys:
                    self._is_full = True
                    _logger.warning(
                        "'%s' and others are not forwarded: the patterns match more than %d topics; "
                        "make them narrower",
                        name,
                        MAX_ROUTES,
                    )

    def _close_idle_routes(self, side: BridgeSide, view: GraphView, now: float) -> None:
        for route in self._routes:
            if not route.is_from_pattern or route.origin.side != side.name:
                continue
            if published_type(view, route.origin.topic, self.own_nodes):
                route.idle_since = None
            elif route.idle_since is None:
                route.idle_since = now
            elif now - route.idle_since >= IDLE_TIMEOUT_S:
                with self._lock:
                    self._routes = tuple(each for each in self._routes if each is not route)
                    a, b = route.origin, route.end
                    if a.side == "b":
                        a, b = b, a
                    self._route_keys.discard((side.name, a.topic, b.topic))
                route.close()

    def publishes_status_on(self, side: BridgeSide, view: GraphView) -> bool:
        """Return True if the bridge publishes its status on a side.

        If both back ends share one graph, the status is published on side a only, because two publishers of
        one topic would conflict.
        """
        return side.name == "a" or (side.poll_count > 1 and self.sides["a"].node.id not in view.nodes)

    def on_status(self, side: SideName, message: Message) -> None:
        """Process the status of another bridge. Runs in a thread of the side's node."""
        with suppress(DecodeError):
            self._other_bridges.add_status(side, message.payload, time.monotonic())

    def _check_other_bridges(self) -> None:
        # Warns of duplicate messages, and stops routes that would loop.
        has_trails = any(side.backend.has_extensions for side in (self.configuration.a, self.configuration.b))
        others = self._other_bridges.parallel_bridges(time.monotonic())
        for route in self._routes:
            origin, end = route.origin, route.end
            reverse_route: RouteKey = (end.side, end.topic, origin.topic)
            rivals = [other for other in others if other.id < self.id and reverse_route in other.routes]
            route.rival = rivals[0].name if rivals and not has_trails else ""
            same_route: RouteKey = (origin.side, origin.topic, end.topic)
            for other in others:
                if {same_route, reverse_route} & other.routes and other.id not in self._warned_bridge_ids:
                    self._warned_bridge_ids.add(other.id)
                    _logger.warning(
                        "the bridge '%s' also connects '%s' and '%s': messages arrive twice or loop; "
                        "stop one of the two",
                        other.name,
                        origin.topic,
                        end.topic,
                    )

    def _matching_topics(self, side: SideName, name: str) -> Iterator[tuple[BridgeTopic, str, str]]:
        for topic in self.configuration.topics:
            if topic.is_pattern and side in topic.origins:
                part = topic.end(side).matched_part(name)
                if not part:
                    continue
                a, b = topic.a.with_part(part), topic.b.with_part(part)
                try:
                    check_topic_names(a, b)
                except NepError:
                    continue  # the name would be too long on the other side
                yield topic, a, b
                return

    # ---- closing

    def close(self, timeout_s: float = _FLUSH_TIMEOUT_S) -> None:
        """Stop forwarding and close both nodes. Idempotent.

        Args:
            timeout_s: Maximum time in seconds to deliver the messages that were already received.
        """
        deadline = time.monotonic() + timeout_s
        self._closed.set()
        for side in self.sides.values():
            side.begin_close()
        for side in self.sides.values():
            side.join(_JOIN_TIMEOUT_S)  # a thread waiting for a missing master ends later, with its node
        for route in self._routes:
            route.unsubscribe()
        self._pacer.close(max(0.1, timeout_s))
        for side in self.sides.values():
            side.node.close(max(0.0, deadline - time.monotonic()))
        for side in self.sides.values():
            side.join(max(_FLUSH_TIMEOUT_S, timeout_s))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def check_installed(configuration: BridgeConfiguration) -> None:
    """Raise `NepError` if a back end is not installed or doesn't know a message type."""
    for name in SIDES:
        side = configuration.side(name)
        with Node(configuration.node_name(name), side.backend.name, master=side.master):
            pass
    _check_types(configuration)


def _check_types(configuration: BridgeConfiguration) -> None:
    for topic in configuration.topics:
        for side in SIDES:
            msg_type = topic.end(side).msg_type
            if msg_type:
                configuration.side(side).backend.codec_for(msg_type)
