"""How many robots that went away are remembered. Any program can announce robots under new names forever."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from app.core.robots.announcements import MOST_ROBOTS
from app.core.robots.robot_link import RobotLink

MAX_ABSENT = MOST_ROBOTS
"""All robots of a room may go away at once, when its access point fails."""


def excess_absent(links: Iterable[RobotLink], in_use: Collection[str]) -> Sequence[RobotLink]:
    """Return the robots to forget: those away beyond `MAX_ABSENT`.

    Robots that never answered come first, then those that are away longest. Robots ``in_use``, robots that
    have ever proven a Stop, and robots whose Stop is pending or failed are neither counted nor returned.
    """
    absent = [link for link in links if not link.connected and not _is_kept(link) and link.name not in in_use]
    excess = len(absent) - MAX_ABSENT
    if excess <= 0:
        return ()
    return sorted(absent, key=lambda link: (link.answered_s is not None, link.gone_s or 0.0))[:excess]


def _is_kept(link: RobotLink) -> bool:
    return link.has_proven_stop or link.stop_began_s is not None or bool(link.not_stopped)
