"""Leases: renewal schedule, and nodes whose renewal is late or whose lease has expired."""

from __future__ import annotations

from nep.masters.registry import RegisteredNode, Registry
from nep.protocol.requests import RENEW_INTERVAL_S

LEASE_DURATION_S = 3.0
"""Lease in seconds of a node that renews every second; longer intervals extend it accordingly."""
_LATE_AFTER_S = 0.4
"""Delay of a renewal in seconds after which the node is probed."""
_MAX_RENEWALS_PER_S = 125
"""Maximum number of renewals per second of all nodes; with more nodes the interval grows."""
_MAX_RENEW_INTERVAL_S = 5.0
"""Maximum renewal interval in seconds."""
_SLOT_WIDTH_S = 0.1
"""Width of a time slot in seconds.

In large graphs, renewals are scheduled in slots, because waking up the master costs more than a
renewal.
"""


class Leases:
    """Leases of registered nodes, except managed nodes, whose end is reported by the gateway.

    Args:
        registry: Registry of the nodes.
        lease_s: Silence in seconds after which a node that renews every second is unregistered.
    """

    def __init__(self, registry: Registry, lease_s: float) -> None:
        self._registry = registry
        self._grace_s = lease_s - RENEW_INTERVAL_S
        self._renew_interval_s = RENEW_INTERVAL_S
        self._paced_revision = 0
        """Revision of the registry for which the interval was computed."""
        self._slot_size = 0
        self._slots: dict[int, int] = {}
        """Number of nodes per future slot."""

    def update_renew_interval(self, now: float) -> None:
        """Compute the renewal interval, which each node receives with the reply to its next renewal."""
        self._slots = {slot: count for slot, count in self._slots.items() if slot * _SLOT_WIDTH_S > now}
        if self._paced_revision == self._registry.revision:
            return
        self._paced_revision = self._registry.revision
        nodes = sum(not member.is_managed for member in self._registry.members.values())
        self._renew_interval_s = min(
            _MAX_RENEW_INTERVAL_S, max(RENEW_INTERVAL_S, nodes / _MAX_RENEWALS_PER_S)
        )
        self._slot_size = 1 + int(nodes * _SLOT_WIDTH_S / self._renew_interval_s)

    def renew(self, member: RegisteredNode, now: float) -> float:
        """Record a renewal; return the seconds until the next one."""
        member.renewed_at, member.renew_interval_s = now, RENEW_INTERVAL_S
        if self._renew_interval_s > RENEW_INTERVAL_S and not member.is_managed:
            slot = self._free_slot(now)
            self._slots[slot] = self._slots.get(slot, 0) + 1
            member.renew_interval_s = slot * _SLOT_WIDTH_S - now
        return member.renew_interval_s

    def _free_slot(self, now: float) -> int:
        # Uses the latest slot, or an earlier one if it is full; at least a second from now.
        last, first = (
            round((now + self._renew_interval_s) / _SLOT_WIDTH_S),
            int((now + RENEW_INTERVAL_S) / _SLOT_WIDTH_S) + 1,
        )
        slots = range(last, min(first, last - 1), -1)
        for slot in slots:
            if self._slots.get(slot, 0) < self._slot_size:
                return slot
        return min(slots, key=lambda slot: self._slots.get(slot, 0))

    def is_late(self, member: RegisteredNode, now: float) -> bool:
        """Return True if the node has missed a renewal."""
        return not member.is_managed and member.renewed_at + member.renew_interval_s <= now - _LATE_AFTER_S

    def overdue_node_ids(self, now: float) -> list[str]:
        """Return the ids of the nodes that have missed a renewal."""
        return self._node_ids_overdue_by(now, _LATE_AFTER_S)

    def expired_node_ids(self, now: float) -> list[str]:
        """Return the ids of the nodes whose lease has expired."""
        return self._node_ids_overdue_by(now, self._grace_s)

    def _node_ids_overdue_by(self, now: float, by_s: float) -> list[str]:
        latest = now - by_s
        return [
            node_id
            for node_id, member in self._registry.members.items()
            if member.renewed_at + member.renew_interval_s <= latest and not member.is_managed
        ]
