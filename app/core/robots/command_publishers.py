"""Publishers for robots' commands, opened and closed in the thread of the message source."""

from __future__ import annotations

from collections.abc import Callable

from app.core.robots.robot_link import RobotLink
from app.robots.client.dialects import dialect_of
from nep.i18n import _
from nep.nodes.node import Node

Submit = Callable[[str, Callable[[Node], None]], None]
"""Function that queues a job with the node in the source's thread. See `Source.submit`."""


class CommandPublishers:
    """Manager of the publishers for robots' commands. Not thread-safe; use it from the main thread."""

    def __init__(self, submit: Submit) -> None:
        self._submit = submit

    def open(self, link: RobotLink) -> None:
        """Open the publishers for a robot's command and world topics.

        Does nothing if they are open or being opened.
        """
        topics = link.robot.topics
        if link.publisher is not None or link.is_opening:
            return
        link.is_opening = True

        def open_job(node: Node) -> None:
            try:
                if link.robot.topics != topics:
                    return  # the description changed; the next graph opens the new topics
                world_publisher = node.new_pub(topics.world, "json") if topics.world is not None else None
                link.world_publisher = world_publisher
                command_type = dialect_of(link.robot).command_type
                link.publisher = node.new_pub(topics.command, command_type, batch=False)
            finally:
                link.is_opening = False

        self._submit(_failure_text(_("Can't connect to {robot}: {error}"), link), open_job)

    def close_outdated(self, link: RobotLink) -> None:
        """Close the publishers of a robot whose description now names other topics."""
        old = [publisher for publisher in (link.publisher, link.world_publisher) if publisher is not None]
        link.publisher = link.world_publisher = None

        def close_job(_node: Node) -> None:
            for publisher in old:
                publisher.close()

        if old:
            text = _failure_text(_("Can't close the old publishers of {robot}: {error}"), link)
            self._submit(text, close_job)

    def close(self, link: RobotLink) -> None:
        """Close the publishers of a robot that is removed, including publishers that are being opened."""
        if link.is_opening or link.publisher is not None or link.world_publisher is not None:
            self._submit("", lambda _node: close_publishers(link))


def _failure_text(template: str, link: RobotLink) -> str:
    # Template for `Source.submit`, which inserts only the error. Braces in the name are escaped.
    return template.format(robot=link.name.replace("{", "{{").replace("}", "}}"), error="{error}")


def close_publishers(link: RobotLink) -> None:
    """Close the publishers of a robot in the calling thread."""
    for publisher in (link.publisher, link.world_publisher):
        if publisher is not None:
            publisher.close()
    link.publisher = link.world_publisher = None
