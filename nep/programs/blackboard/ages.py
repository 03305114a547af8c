"""Computation of the time at which a message's age starts. Performs no input or output.

If the clocks of publisher and receiver agree, the age starts at the message's time stamp, so that it includes
the transmission and the time for which the message was latched. Otherwise the age starts at the arrival. The
wall clock is read once, at arrival, so that later clock changes don't affect ages.
"""

from __future__ import annotations

from nep.messages.message import Message
from nep.programs.blackboard.entries import AgeBy

MAX_AHEAD_S = 0.1
"""Maximum time in seconds that a stamp may be in the future before the publisher's clock counts as wrong."""
MAX_BEHIND_S = 10.0
"""Maximum age in seconds at arrival before the publisher's clock counts as wrong.

Latched messages may be older.
"""
_NS_PER_S = 1e9


def age_start(message: Message, now: float, wall_ns: int) -> tuple[float, AgeBy]:
    """Return the time at which a message's age starts.

    Args:
        message: Message that has just arrived.
        now: Current time on the blackboard's clock (s).
        wall_ns: Current time in ns since 1970.

    Returns:
        The start on the blackboard's clock, and its source: "stamp" or "arrival".
    """
    if message.stamp_ns is None:
        return now, "arrival"
    latency_s = (wall_ns - message.stamp_ns) / _NS_PER_S
    if latency_s < -MAX_AHEAD_S or (latency_s > MAX_BEHIND_S and not message.is_latched):
        return now, "arrival"
    return now - max(0.0, latency_s), "stamp"
