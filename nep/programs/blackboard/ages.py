"""From when a message's age counts. Pure.

By its stamp where the publisher's clock and ours agree, so that time on the way, and in a publisher that
keeps it for late subscribers, counts; else by its arrival. The wall clock is read once, when it arrives:
whatever becomes of it later changes no age.
"""

from __future__ import annotations

from nep.messages.message import Message
from nep.programs.blackboard.entries import AgeBy

__all__ = ["AHEAD_S", "BEHIND_S", "beginning_of"]

AHEAD_S = 0.1
"""A message of the future, by more than this, has the stamp of a clock that is wrong."""
BEHIND_S = 10.0
"""So has one that is older when it comes, unless its publisher keeps messages."""
_NS = 1e9


def beginning_of(message: Message, now: float, wall_ns: int) -> tuple[float, AgeBy]:
    """When its age began, by the clock that says it is `now`, and what says so."""
    if message.stamp_ns is None:
        return now, "arrival"
    on_the_way_s = (wall_ns - message.stamp_ns) / _NS
    if on_the_way_s < -AHEAD_S or (on_the_way_s > BEHIND_S and not message.is_latched):
        return now, "arrival"
    return now - max(0.0, on_the_way_s), "stamp"
