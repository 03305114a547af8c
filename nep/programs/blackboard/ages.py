"""Start of a message's age. Pure.

The time stamp is used if the publisher's clock agrees with ours, so that transmission time and time kept as
latched count; else the arrival. The wall clock is read once, at arrival: later clock changes don't affect
ages.
"""

from __future__ import annotations

from nep.messages.message import Message
from nep.programs.blackboard.entries import AgeBy

__all__ = ["AHEAD_S", "BEHIND_S", "beginning_of"]

AHEAD_S = 0.1
"""A stamp further in the future comes from a wrong clock."""
BEHIND_S = 10.0
"""An older stamp comes from a wrong clock, unless the message is latched."""
_NS = 1e9


def beginning_of(message: Message, now: float, wall_ns: int) -> tuple[float, AgeBy]:
    """Return when the message's age began (on the clock of `now`), and which source was used."""
    if message.stamp_ns is None:
        return now, "arrival"
    on_the_way_s = (wall_ns - message.stamp_ns) / _NS
    if on_the_way_s < -AHEAD_S or (on_the_way_s > BEHIND_S and not message.is_latched):
        return now, "arrival"
    return now - max(0.0, on_the_way_s), "stamp"
