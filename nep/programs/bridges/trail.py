"""Loop prevention for bridges: each message carries the list of networks through which it has passed.

A bridge stores this trail in the message's extension under the key "bridge": `{"networks": [...], "bridges":
[...]}`, with the networks in order and the ids of all bridges. For back ends without extensions, `LoopGuard`
recognizes returning messages.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from hashlib import blake2b
from typing import NamedTuple

TRAIL_KEY = "bridge"
MAX_HOPS = 16
"""Maximum number of bridges that forward a message; a longer chain counts as a loop."""
ECHO_WINDOW_S = 5.0
"""Time in seconds within which a sent message is recognized when it returns."""
_MAX_ID_LENGTH = 400
_MAX_ECHOES = 4096


class Trail(NamedTuple):
    """Networks and bridges through which a message has passed, in order."""

    networks: tuple[str, ...] = ()
    bridges: tuple[str, ...] = ()

    def may_forward(self, network: str, bridge: str) -> bool:
        """Return True if a bridge may forward the message into a network without causing a loop.

        Args:
            network: Id of the network.
            bridge: Id of the bridge.
        """
        return network not in self.networks and bridge not in self.bridges and len(self.bridges) < MAX_HOPS

    def with_hop(self, origin: str, network: str, bridge: str) -> Trail:
        """Return the trail of the message after a bridge has forwarded it.

        Args:
            origin: Id of the network from which the message came.
            network: Id of the network into which it was forwarded.
            bridge: Id of the bridge.
        """
        visited = self.networks if origin in self.networks else (*self.networks, origin)
        return Trail((*visited, network), (*self.bridges, bridge))

    def to_plain(self) -> dict[str, object]:
        """Return the trail as a JSON-serializable dict for the extension."""
        return {"networks": list(self.networks), "bridges": list(self.bridges)}


def read_trail(extension: Mapping[str, object]) -> Trail:
    """Parse the trail in an extension; a missing or invalid trail is empty."""
    value = extension.get(TRAIL_KEY)
    if not isinstance(value, Mapping):
        return Trail()
    return Trail(_parse_ids(value.get("networks")), _parse_ids(value.get("bridges")))


def _parse_ids(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        return ()
    return tuple(
        each for each in value[: MAX_HOPS + 2] if isinstance(each, str) and len(each) <= _MAX_ID_LENGTH
    )


class LoopGuard:
    """Detector of returning messages, for a topic of a network that doesn't identify publishers. Thread-safe.

    A returning message carries no sign of its origin, so it is recognized by its bytes, once for each time
    it was sent, within `ECHO_WINDOW_S`. An equal message of another publisher is mistaken for an echo only
    if the echo itself is missing.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sent_counts: OrderedDict[bytes, tuple[int, float]] = OrderedDict()
        self._is_enabled = True

    def disable(self) -> None:
        """Disable the guard, because the network identifies publishers."""
        if self._is_enabled:
            self._is_enabled = False
            with self._lock:
                self._sent_counts.clear()

    def record_sent(self, data: bytes | memoryview, now: float) -> None:
        """Record the bytes of a message that is being sent.

        Args:
            data: Encoded payload.
            now: Monotonic time in seconds.
        """
        if self._is_enabled:
            key = _digest(data)
            with self._lock:
                count, _at = self._sent_counts.pop(key, (0, 0.0))
                self._sent_counts[key] = count + 1, now
                while len(self._sent_counts) > _MAX_ECHOES:
                    self._sent_counts.popitem(last=False)

    def is_echo(self, data: bytes | memoryview, now: float) -> bool:
        """Return True if a received message is the echo of a sent one; the record is then removed.

        Args:
            data: Encoded payload.
            now: Monotonic time in seconds.
        """
        key = _digest(data)
        with self._lock:
            count, sent_at = self._sent_counts.pop(key, (0, 0.0))
            if not count or now - sent_at > ECHO_WINDOW_S:
                return False
            if count > 1:
                self._sent_counts[key] = count - 1, sent_at
            return True


def _digest(data: bytes | memoryview) -> bytes:
    return blake2b(data, digest_size=16).digest()
