"""Motion protection: which topics move a robot, and which programs may publish there.

`moving` determines whether a topic moves a robot, and which one, from descriptions, types and subscribers.
`guard` reads the current descriptions for programs without a window, and denies publishing unless it was
allowed. Commands, drivers and Studio's permission dialog are in `app`.
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
