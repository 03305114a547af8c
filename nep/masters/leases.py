"""Leases: when each node renews, who is late, and who has been silent for too long."""

from __future__ import annotations

from nep.masters.registry import Census, Member
from nep.protocol.requests import RENEW_S

__all__ = ["LEASE_S", "Leases"]

LEASE_S = 3.0
"""A node that renews every second and has not for so long is unlisted; others have as much longer."""
_LATE_S = 0.4
"""A node whose renewal is late by so much is probed."""
_RENEWALS_A_S = 125
"""So many renewals a second are taken from all nodes together. With more nodes each renews less often,"""
_LONGEST_RENEW_S = 5.0
"""but at least so often."""
_SLOT_S = 0.1
"""Nodes that renew less often do it together, so long after each other: waking up costs most of all."""


class Leases:
    """The leases of the nodes in `census`; managed ones have none: who manages one says when it leaves."""

    def __init__(self, census: Census, lease_s: float) -> None:
        self._census = census
        self._grace_s = lease_s - RENEW_S
        self._renew_s = RENEW_S
        self._paced_at = 0
        """The revision of the census for which this was decided."""
        self._slot_size = 0
        self._slots: dict[int, int] = {}
        """How many nodes were told to renew in each slot to come."""

    def set_pace(self, now: float) -> None:
        """Decide how often nodes renew from now on: each is told with its next renewal."""
        self._slots = {slot: told for slot, told in self._slots.items() if slot * _SLOT_S > now}
        if self._paced_at == self._census.revision:
            return
        self._paced_at = self._census.revision
        nodes = sum(not member.is_managed for member in self._census.members.values())
        self._renew_s = min(_LONGEST_RENEW_S, max(RENEW_S, nodes / _RENEWALS_A_S))
        self._slot_size = 1 + int(nodes * _SLOT_S / self._renew_s)

    def renew(self, member: Member, now: float) -> float:
        """It has renewed; in how many seconds it shall renew next."""
        member.renewed_at, member.renew_s = now, RENEW_S
        if self._renew_s > RENEW_S and not member.is_managed:
            slot = self._free_slot(now)
            self._slots[slot] = self._slots.get(slot, 0) + 1
            member.renew_s = slot * _SLOT_S - now
        return member.renew_s

    def _free_slot(self, now: float) -> int:
        """The one that is due, or an earlier one when that is full; but not sooner than in a second."""
        last, first = round((now + self._renew_s) / _SLOT_S), int((now + RENEW_S) / _SLOT_S) + 1
        slots = range(last, min(first, last - 1), -1)
        for slot in slots:
            if self._slots.get(slot, 0) < self._slot_size:
                return slot
        return min(slots, key=lambda slot: self._slots.get(slot, 0))

    def is_late(self, member: Member, now: float) -> bool:
        """Whether it missed a renewal."""
        return not member.is_managed and member.renewed_at + member.renew_s <= now - _LATE_S

    def late(self, now: float) -> list[str]:
        """The nodes that missed a renewal."""
        return self._overdue(now, _LATE_S)

    def lapsed(self, now: float) -> list[str]:
        """The nodes that are to be unlisted."""
        return self._overdue(now, self._grace_s)

    def _overdue(self, now: float, by_s: float) -> list[str]:
        latest = now - by_s
        return [
            node_id
            for node_id, member in self._census.members.items()
            if member.renewed_at + member.renew_s <= latest and not member.is_managed
        ]
