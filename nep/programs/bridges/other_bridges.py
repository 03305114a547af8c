"""Detection of other bridges between the same two networks, by their status on `BRIDGES_TOPIC`.

A bridge whose status is received on both sides connects the same networks, whatever their names. If both
bridges forward a topic in the same direction, each message arrives twice. If they forward a topic in opposite
directions and neither network carries trails, messages would loop; then the bridge with the greater id stops
forwarding that topic.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from nep.programs.bridges.configuration import SIDES, SideName

HEARTBEAT_S = 5.0
"""Maximum interval between two status messages of a bridge in seconds."""
_EXPIRY_S = 3 * HEARTBEAT_S
_MAX_BRIDGES = 64
_MAX_ID_LENGTH = 100
_MAX_ROUTES = 1000

RouteKey = tuple[SideName, str, str]
"""Route of a bridge: (side of the origin, topic on that side, topic on the other side)."""


class OtherBridge(NamedTuple):
    """Other bridge between the same networks.

    Attributes:
        id: Id of the bridge.
        name: Name of the bridge.
        routes: Routes of the bridge, with the names that our bridge gives to the sides.
    """

    id: str
    name: str
    routes: frozenset[RouteKey]


class _Status(NamedTuple):
    """Status of a bridge received on one of our sides.

    Attributes:
        received_at: Time of arrival (monotonic, s).
        name: Name of the bridge.
        side: The other bridge's name ("a" or "b") of the side on which the status was published.
        routes: Routes of the bridge, with the names that it gives to the sides.
    """

    received_at: float
    name: str
    side: str
    routes: frozenset[tuple[str, str, str]]


class OtherBridges:
    """Tracker of other bridges. Thread-safe.

    Args:
        own_id: Id of this bridge, whose own status is ignored.
    """

    def __init__(self, own_id: str) -> None:
        self._own_id = own_id
        self._lock = threading.Lock()
        self._statuses: dict[SideName, OrderedDict[str, _Status]] = {side: OrderedDict() for side in SIDES}

    def add_status(self, side: SideName, status: object, now: float) -> None:
        """Process a status received on a side of this bridge. An invalid status is ignored."""
        if not isinstance(status, Mapping):
            return
        id_, name, other_side = (status.get(key) for key in ("id", "bridge", "side"))
        if not (isinstance(id_, str) and isinstance(name, str) and other_side in SIDES):
            return
        if id_ == self._own_id or len(id_) > _MAX_ID_LENGTH:
            return
        with self._lock:
            statuses = self._statuses[side]
            statuses.pop(id_, None)
            statuses[id_] = _Status(
                now, name[:_MAX_ID_LENGTH], str(other_side), frozenset(_parse_routes(status.get("routes")))
            )
            while len(statuses) > _MAX_BRIDGES:
                statuses.popitem(last=False)

    def parallel_bridges(self, now: float) -> list[OtherBridge]:
        """Return the bridges whose status was received recently on both sides."""
        with self._lock:
            statuses_a, statuses_b = ({**self._statuses[side]} for side in SIDES)
        bridges = []
        for id_, a in statuses_a.items():
            b = statuses_b.get(id_)
            if b is None or a.side == b.side or now - min(a.received_at, b.received_at) > _EXPIRY_S:
                continue
            sides: dict[str, SideName] = {a.side: "a", b.side: "b"}
            routes = frozenset((sides[origin], topic, end_topic) for origin, topic, end_topic in a.routes)
            bridges.append(OtherBridge(id_, a.name, routes))
        return bridges


def _parse_routes(routes: object) -> Iterator[tuple[str, str, str]]:
    for route in routes[:_MAX_ROUTES] if isinstance(routes, list) else ():
        if not isinstance(route, Mapping):
            continue
        origin, end = route.get("from"), route.get("to")
        if isinstance(origin, Mapping) and isinstance(end, Mapping):
            side, topic, end_topic = origin.get("side"), origin.get("topic"), end.get("topic")
            if side in SIDES and isinstance(topic, str) and isinstance(end_topic, str):
                yield str(side), topic, end_topic
