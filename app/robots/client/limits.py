"""Time limits and bounds of everything that commands robots."""

from __future__ import annotations

from collections.abc import Iterable

from app.robots.description.model import Robot

# ---- actions

FIRST_REPLY_TIMEOUT_S = 3.0
"""Maximum time in seconds until a robot accepts or rejects a command."""
MAX_MISSED_HEARTBEATS, MIN_SILENCE_S = 4, 2.0
DEFAULT_ACTION_TIMEOUT_S = 60.0
"""Time limit in seconds of a program's action whose description has none."""
ACTION_MARGIN_S = 2.0
"""Time in seconds beyond an action's time limit, in which the robot should report the end itself.

Drivers report it up to 1 s after the limit (`_GRACE_S` in `app.robots.driver.tasks`).
"""
PAUSE_TIMEOUT_S = 3.0
"""Timeout in seconds for an action cancelled by a pause; robots built with the kit reply within 1 s."""
COMMAND_CHECK_INTERVAL_S = 0.25
"""Interval in seconds at which a program checks a pending command for time limits and a silent robot."""
FIRST_VALUE_TIMEOUT_S = 2.0
"""Maximum time in seconds for which a program waits for the first value of a sensor."""
SENSOR_SILENCE_TIMEOUT_S = 3.0
"""Minimum time in seconds without a value after which a sensor counts as silent."""
HEARTBEAT_INTERVAL_S = 0.2
"""Interval in seconds of the heartbeats to robots, which stop when they no longer receive any."""

# ---- Stop

STOP_TIMEOUT_S = 1.0
"""Default time limit of a Stop in seconds. A robot's description may require a longer time."""
STOP_MARGIN_S = 0.5
MAX_STOP_TIMEOUT_S = 10.0
LATE_REPLY_TIMEOUT_S = 120.0
"""Time in seconds after a Stop during which late replies are accepted."""
MAX_LATE_STOPS = 64
MAX_STOP_REPLY_BYTES = 65_536
"""Maximum size in bytes of a reply to a Stop; larger messages are ignored."""
MAX_SERVING_PROGRAMS = 32
"""Maximum number of programs of one robot whose replies to a Stop are awaited."""
MAX_NAMED_LISTENERS = 4
"""Maximum number of programs that only subscribe to a robot's commands and are included in a report."""
MAX_STOP_TOPICS = 32
"""Maximum number of command topics of one robot. Current topics take precedence over earlier ones."""

# ---- replies and announcements

MAX_PENDING_PUBLISHERS, MAX_PENDING_PER_PUBLISHER = 64, 32
"""Maximum number of publishers that the graph does not list yet and whose replies are held, and of replies
of one publisher, on one topic."""
MAX_ROBOTS = 200
"""Maximum number of announced robots."""

# ---- graph and discovery

GRAPH_TIMEOUT_S = 0.3
"""Time limit in seconds of a graph query during a Stop."""
STOP_LOOKUP_INTERVAL_S, PROGRAM_LOOKUP_INTERVAL_S = 0.1, 0.2
"""Minimum interval in seconds between graph queries that look up the publisher of a reply."""
CONNECTION_CHECK_INTERVAL_S = 0.02
"""Interval in seconds at which a Stop checks whether a robot has been connected."""
ROBOT_WAIT_S = 10.0
"""Default of the maximum time in seconds for which the command line waits for the robots of a behaviour."""
DISCOVERY_TIMEOUT_S = 3.0
"""Maximum time in seconds for the descriptions of all announced robots."""
LATE_DISCOVERY_INTERVAL_S = 1.0
"""Interval in seconds at which the command line looks for robots that were announced during a run."""
DISCOVERY_POLL_INTERVAL_S = 0.1


def max_silence_s(robot: Robot) -> float | None:
    """Return the time in seconds after which a robot with a running action counts as unresponsive.

    Returns None for robots that send no heartbeats.
    """
    if not robot.heartbeat_interval_s:
        return None
    return max(MIN_SILENCE_S, MAX_MISSED_HEARTBEATS * robot.heartbeat_interval_s)


def stop_timeout_s(robots: Iterable[Robot], max_timeout_s: float | None = None) -> float:
    """Return the time limit in seconds for a Stop, which exceeds the time limits of the robots' drivers.

    Args:
        robots: Robots to stop.
        max_timeout_s: Maximum of the result; default `MAX_STOP_TIMEOUT_S`.
    """
    needed_s = max((robot.safe_stop.within_s + STOP_MARGIN_S for robot in robots), default=0.0)
    limit_s = MAX_STOP_TIMEOUT_S if max_timeout_s is None else max_timeout_s
    return min(limit_s, max(STOP_TIMEOUT_S, needed_s))
