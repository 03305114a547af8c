"""Start time of a message's age. Performs no input or output.

If the clocks of publisher and receiver agree, the age starts at the message's time stamp, which includes
transmission and the time it was latched; otherwise at its arrival. The wall clock is read once, at arrival,
so that later clock changes don't affect ages.
"""

from __future__ import annotations

from nep.messages.message import Message
from nep.programs.blackboard.entries import AgeBy

MAX_AHEAD_S = 0.1
"""Maximum time that a stamp may be in the future, in seconds; beyond, the publisher's clock is wrong."""
MAX_BEHIND_S = 10.0
"""Maximum age of a stamp at arrival in seconds, unless the message is latched; beyond, the clock is wrong."""
_NS_PER_S = 1e9


def age_start(message: Message, now: float, wall_ns: int) -> tuple[float, AgeBy]:
    """Return the start of a message's age (on the clock of `now`), and its source: "stamp" or "arrival"."""
    if message.stamp_ns is None:
        return now, "arrival"
    on_the_way_s = (wall_ns - message.stamp_ns) / _NS_PER_S
    if on_the_way_s < -MAX_AHEAD_S or (on_the_way_s > MAX_BEHIND_S and not message.is_latched):
        return now, "arrival"
    return now - max(0.0, on_the_way_s), "stamp"
