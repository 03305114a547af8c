"""Trails: where a message has been, so that no bridge brings it back there.

A bridge writes the trail beside what it publishes, in the message's extension under the key "bridge":
`{"networks": [...], "bridges": [...]}`, all networks on which it has been, in this order, and the ids
of all bridges that carried it. Where a back end has no room for that, `Echoes` know what was just sent.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from hashlib import blake2b
from typing import NamedTuple

__all__ = ["TRAIL_KEY", "Echoes", "Trail", "read_trail"]

TRAIL_KEY = "bridge"
HOPS_MOST = 16
"""No message goes over more bridges: who joins that many networks in a row has made a ring."""
ECHO_S = 5.0
"""What has not come back by then does not come back."""
_WORD_MOST = 400
_ECHOES_MOST = 4096


class Trail(NamedTuple):
    """Where a message has been."""

    networks: tuple[str, ...] = ()
    bridges: tuple[str, ...] = ()

    def may_go(self, network: str, bridge: str) -> bool:
        """Whether this bridge may carry it into this network."""
        return network not in self.networks and bridge not in self.bridges and len(self.bridges) < HOPS_MOST

    def carried(self, origin: str, network: str, bridge: str) -> Trail:
        """The trail of the message that this bridge carries from `origin` into `network`."""
        been = self.networks if origin in self.networks else (*self.networks, origin)
        return Trail((*been, network), (*self.bridges, bridge))

    def to_plain(self) -> dict[str, object]:
        """Its form in an extension."""
        return {"networks": list(self.networks), "bridges": list(self.bridges)}


def read_trail(extension: Mapping[str, object]) -> Trail:
    """The trail in an extension; an empty one when there is none, or what is there is none."""
    found = extension.get(TRAIL_KEY)
    if not isinstance(found, Mapping):
        return Trail()
    return Trail(_words(found.get("networks")), _words(found.get("bridges")))


def _words(found: object) -> tuple[str, ...]:
    if not isinstance(found, list | tuple):
        return ()
    return tuple(each for each in found[: HOPS_MOST + 2] if isinstance(each, str) and len(each) <= _WORD_MOST)


class Echoes:
    """What a bridge just sent on one topic of a network that tells nobody who publishes.

    Such a message comes back without a sign of its origin. It is known by its bytes, once for each time that
    it was sent, within `ECHO_S`: so an equal message of somebody else is taken for an echo only when the echo
    itself did not come. Works in any thread.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sent: OrderedDict[bytes, tuple[int, float]] = OrderedDict()
        self._are_needed = True

    def not_needed(self) -> None:
        """The network tells who publishes: nothing has to be remembered."""
        if self._are_needed:
            self._are_needed = False
            with self._lock:
                self._sent.clear()

    def sent(self, data: bytes | memoryview, now: float) -> None:
        """It is sent now."""
        if self._are_needed:
            key = _digest(data)
            with self._lock:
                count, _at = self._sent.pop(key, (0, 0.0))
                self._sent[key] = count + 1, now
                while len(self._sent) > _ECHOES_MOST:
                    self._sent.popitem(last=False)

    def is_echo(self, data: bytes | memoryview, now: float) -> bool:
        """Whether it was sent and comes back; it is forgotten then."""
        key = _digest(data)
        with self._lock:
            count, at = self._sent.pop(key, (0, 0.0))
            if not count or now - at > ECHO_S:
                return False
            if count > 1:
                self._sent[key] = count - 1, at
            return True


def _digest(data: bytes | memoryview) -> bytes:
    return blake2b(data, digest_size=16).digest()
