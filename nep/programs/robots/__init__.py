"""Motion protection: which topics move a robot, and which programs may publish on them.

`moving` determines the robots that a topic moves, from descriptions, types and subscribers. `guard` reads the
current descriptions for programs without a window, and denies publishing on topics that are not allowed.
Commands, drivers and Studio's permission dialog are in `app`.
"""

from nep.programs.robots.guard import MotionGuard
from nep.programs.robots.moving import (
    COMMAND_TYPE,
    DESCRIPTION_TYPE,
    RIZE_COMMAND_TOPIC,
    MovingTopics,
    RobotControls,
    moving_topics,
    parse_controls,
)

__all__ = [
    "COMMAND_TYPE",
    "DESCRIPTION_TYPE",
    "RIZE_COMMAND_TOPIC",
    "MotionGuard",
    "MovingTopics",
    "RobotControls",
    "moving_topics",
    "parse_controls",
]
