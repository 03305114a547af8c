"""Robots as every program can see them: which topics move one, and who may publish there.

`moving` answers "does publishing on this topic move a robot, and which?" from descriptions, types and
subscribers. `guard` reads the live descriptions for programs without a window, and refuses what nobody has
allowed. Commands, drivers and Studio's question to a person are in `app`.
"""

from nep.programs.robots.guard import MotionGuard
from nep.programs.robots.moving import (
    COMMAND_TYPE,
    DESCRIPTION_TYPE,
    RIZE_COMMANDS,
    MovingTopics,
    RobotControls,
    controls_in,
    moving_topics,
)

__all__ = [
    "COMMAND_TYPE",
    "DESCRIPTION_TYPE",
    "RIZE_COMMANDS",
    "MotionGuard",
    "MovingTopics",
    "RobotControls",
    "controls_in",
    "moving_topics",
]
