"""Clock offsets of nodes on other computers, as reported in renewals."""

from __future__ import annotations

import time
from collections.abc import Callable

from nep.masters.registry import NodeClock, RegisteredNode, Registry
from nep.messages.clocks import drift_ns, is_plausible_clock

ClockDifferences = dict[str, tuple[int, int]]
"""Clock differences by node id: (offset, uncertainty) in nanoseconds.

The offset is added to a time of that node to get a time of the receiver's clock.
"""
_MASTER_CLOCK = NodeClock(0, 0, None)


class Clocks:
    """Clock offsets of the nodes in a registry.

    All times (`now`) are monotonic, in seconds.

    Args:
        registry: Registry of the nodes.
        computer: Id of the master's computer, or "" if unknown.
    """

    def __init__(self, registry: Registry, computer: str) -> None:
        self._registry = registry
        self._computer = computer

    def is_local(self, member: RegisteredNode) -> bool:
        """Return True if the node runs on the master's computer and so shares its clock."""
        return bool(self._computer) and member.node.computer == self._computer

    def store(self, member: RegisteredNode, clock: tuple[int, ...] | None, now: float) -> None:
        """Store the clock offset and uncertainty that a node reports.

        Args:
            member: The node.
            clock: Offset and uncertainty in nanoseconds; empty if not measured yet, None if the node
                doesn't compare clocks. Implausible values are treated as unknown.
            now: Current time.
        """
        if clock is not None and self.is_local(member):
            member.clock = _MASTER_CLOCK
        elif clock is not None and len(clock) == 2 and is_plausible_clock(*clock):
            member.clock = NodeClock(*clock, now)
        else:
            member.clock = None

    def differences(self, member: RegisteredNode, now: float) -> ClockDifferences:
        """Return the known clock differences to remote nodes that the node receives from, by node id.

        Each value is (offset, uncertainty) in nanoseconds: the clock of the node is the other node's
        clock plus the offset. The result is empty if the node's own clock is unknown.
        """
        own_clock = member.clock
        if own_clock is None:
            return {}
        differences: ClockDifferences = {}
        for other in self._registry.remote_nodes_of(member):
            if other.clock is not None:
                uncertainty_ns = _uncertainty_ns(own_clock, now) + _uncertainty_ns(other.clock, now)
                differences[other.node.id] = other.clock.offset_ns - own_clock.offset_ns, uncertainty_ns
        return differences

    def renewal_timestamps(
        self, member: RegisteredNode, received_ns: int, wall_clock_ns: Callable[[], int] | None = None
    ) -> tuple[int, ...]:
        """Return the times to include in the reply to a renewal, with which the node compares its clock.

        Args:
            member: The node.
            received_ns: Time at which the renewal was received, in nanoseconds since 1970.
            wall_clock_ns: Returns the current time in nanoseconds since 1970. Default: `time.time_ns`.

        Returns:
            Times of receipt and reply; empty if the node shares the master's clock.
        """
        return () if self.is_local(member) else (received_ns, (wall_clock_ns or time.time_ns)())


def _uncertainty_ns(clock: NodeClock, now: float) -> int:
    drift_since_report_ns = 0 if clock.reported_at is None else drift_ns((now - clock.reported_at) * 1e9)
    return clock.uncertainty_ns + drift_since_report_ns
