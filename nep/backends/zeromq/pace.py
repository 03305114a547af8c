"""Pace: when a node renews what it has registered."""

from __future__ import annotations

from nep.protocol.requests import RENEW_S

__all__ = ["Pace"]

_LONGEST_S = 30.0
"""A master cannot make a node wait for longer."""


class Pace:
    """Every second, unless the master says otherwise. `due_at` is by the node's own clock."""

    def __init__(self) -> None:
        self.due_at = 0.0
        self._renew_s = RENEW_S

    def renews(self, now: float) -> None:
        """It renews now; what follows if the master does not answer."""
        self.due_at = now + self._renew_s

    def told(self, renew_s: float, now: float) -> None:
        """Renew so soon; and so often while no answer comes."""
        self._renew_s = min(_LONGEST_S, max(RENEW_S, renew_s))
        self.due_at = now + self._renew_s
