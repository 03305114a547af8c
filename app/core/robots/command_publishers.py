"""Publishers for commands to robots, opened and closed in the thread of the message source."""

from __future__ import annotations

from collections.abc import Callable

from app.core.robots.robot_link import RobotLink
from nep.i18n import _
from nep.nodes.node import Node
from nep.programs.robots.moving import COMMAND_TYPE

Submit = Callable[[str, Callable[[Node], None]], None]
"""Runs a job with the node in the source's thread, in order. The text describes the job."""


class CommandPublishers:
    """Opens and closes the publishers for commands to robots.

    Not thread-safe: use it from the window's thread.
    """

    def __init__(self, submit: Submit) -> None:
        self._submit = submit

    def open(self, link: RobotLink) -> None:
        """Open the publishers for a robot's command and world topics, unless that was already started."""
        topics = link.robot.topics
        if link.publisher is not None or link.is_opening:
            return
        link.is_opening = True

        def open_them(node: Node) -> None:
            native = link.robot.dialect == "native"
            try:
                if link.robot.topics != topics:
                    return  # the description changed; the next graph opens the new topics
                world = node.new_pub(topics.world, "json") if topics.world is not None else None
                link.world = world
                link.publisher = node.new_pub(topics.command, COMMAND_TYPE if native else "json", batch=False)
            finally:
                link.is_opening = False

        self._submit(_("connect to {robot}").format(robot=link.name), open_them)

    def close_outdated(self, link: RobotLink) -> None:
        """Close the publishers for topics that the robot's description no longer contains."""
        old = [publisher for publisher in (link.publisher, link.world) if publisher is not None]
        link.publisher = link.world = None

        def close_them(_node: Node) -> None:
            for publisher in old:
                publisher.close()

        if old:
            self._submit(_("close the old publishers of {robot}").format(robot=link.name), close_them)

    def close(self, link: RobotLink) -> None:
        """Close the publishers for a robot that is discarded, including those that are being opened."""
        if link.is_opening or link.publisher is not None or link.world is not None:
            self._submit("", lambda _node: close_publishers(link))


def close_publishers(link: RobotLink) -> None:
    """Close the publishers of a robot now."""
    for publisher in (link.publisher, link.world):
        if publisher is not None:
            publisher.close()
    link.publisher = link.world = None
