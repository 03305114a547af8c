"""What the fleet asks about the programs of robots."""

from __future__ import annotations

from typing import Protocol

from app.robots.identity import Identity


class RobotProcesses(Protocol):
    """What is needed to know about the processes of robots."""

    def is_ours(self, identity: Identity) -> bool:
        """Whether this program is a virtual robot of this person."""

    def has_ended(self, identity: Identity) -> bool:
        """Whether it is sure that this program runs no more."""


class AllVirtual:
    """Believes every robot that says that it is virtual (what tests need)."""

    def is_ours(self, identity: Identity) -> bool:  # noqa: ARG002
        """All are."""
        return True

    def has_ended(self, identity: Identity) -> bool:  # noqa: ARG002
        """Nobody knows."""
        return False
