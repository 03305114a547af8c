"""Selection of the targets of a Stop. Performs no I/O.

Targets are robots that are connected, that may be moving, or that were connected, and robots that
Studio does not list because of the limit of the list or an invalid description. Unlisted robots are
reached on the command topics in the graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from app.core.robots.robot_link import RobotLink
from app.core.robots.stop.moved_robots import MovedRobots
from app.robots.client.dialects import REPLY_TYPE
from app.robots.client.stop import StopTarget
from app.robots.description.description import Robot, RobotTopics, SafeStop, topic_of
from app.robots.identity import identity_of, publisher_nodes, subscriber_nodes
from nep.programs.robots.moving import COMMAND_TYPE
from nep.protocol.graph_view import GraphView

MAX_UNLISTED = 256
"""Maximum number of unlisted robots that a Stop is sent to; further robots are reported as not reached."""
MAX_ABSENT = 64
"""Maximum number of disconnected robots that a Stop is sent to because they replied earlier."""
_DEFAULT_SAFE_STOP = SafeStop(
    "stop", None, 0.0, stops_on_program_end=True, stops_on_disconnect=True, can_confirm=True
)


def targets_of(
    links: Iterable[RobotLink], moved_robots: MovedRobots, unlisted: Sequence[StopTarget]
) -> tuple[StopTarget, ...]:
    """Return the targets of a Stop.

    Replies of disconnected robots that are not moving are not awaited; those that never replied are
    omitted.

    Args:
        links: Listed robots.
        moved_robots: Record of the robots that may be moving.
        unlisted: Targets for robots that are not listed.
    """
    expected, absent = [], []
    for link in links:
        is_expected = link.is_connected or link.name in moved_robots
        earlier_programs = moved_robots.other_programs(link.name, link.identity)
        target = StopTarget(link.robot, link.identity, earlier_programs, link.earlier_topics, is_expected)
        if is_expected:
            expected.append(target)
        elif link.has_confirmed_stop or link.last_reply_s is not None:
            absent.append(target)
    names = {target.robot.name for target in expected}
    other_targets = [target for target in unlisted if target.robot.name not in names]
    unknown_targets = [_unknown_target(topic) for topic in moved_robots.names if "/" in topic]
    return (*expected, *unknown_targets, *absent[:MAX_ABSENT], *other_targets[:MAX_UNLISTED])


def _unknown_target(topic: str) -> StopTarget:
    # Target for a command topic that moved a robot without a description.
    base = topic.rpartition("/")[0]
    return StopTarget(_placeholder_robot(topic, RobotTopics(f"{base}/description", topic, f"{base}/answer")))


def _placeholder_robot(name: str, topics: RobotTopics) -> Robot:
    return Robot(name, "", name, False, "native", (), (), (), _DEFAULT_SAFE_STOP, (), topics, {})


def unlisted_targets(
    view: GraphView, topics: Iterable[str], *, is_expected: bool = True
) -> tuple[StopTarget, ...]:
    """Return the targets for robots with these description topics.

    Robots whose command topic has no subscriber are omitted, because there is nothing to stop.

    Args:
        view: Current graph.
        topics: Topics of descriptions.
        is_expected: True if the replies are awaited.
    """
    descriptions = [topic for topic in topics if topic_of(_name_of(topic), "description") == topic]
    if not descriptions:
        return ()
    subscribed_topics, published_topics = (
        _topics_by_node(view, COMMAND_TYPE),
        _topics_by_node(view, REPLY_TYPE),
    )
    targets = []
    for topic in descriptions:
        name, nodes = _name_of(topic), publisher_nodes(view, topic)
        node = nodes[0] if nodes else ""
        command_topic = topic_of(name, "command")
        extra_topics = [each for each in subscribed_topics.get(node, ()) if each != command_topic]
        command_topics = [*([command_topic] if subscriber_nodes(view, command_topic) else []), *extra_topics]
        reply_topics = published_topics.get(node, ())
        reply_topic = topic_of(name, "answer")
        reply_topic = reply_topic if reply_topic in reply_topics or not reply_topics else reply_topics[0]
        topic_sets = [RobotTopics(topic, command, reply_topic) for command in command_topics]
        if topic_sets:
            identity = identity_of(view, node) if node else None
            earlier_topics = tuple(topic_sets[1:])
            targets.append(
                StopTarget(
                    _placeholder_robot(name, topic_sets[0]),
                    identity,
                    earlier_topics=earlier_topics,
                    is_expected=is_expected,
                )
            )
    return tuple(targets)


def _name_of(topic: str) -> str:
    return topic.removesuffix("/description").strip("/")


def _topics_by_node(view: GraphView, msg_type: str) -> Mapping[str, list[str]]:
    # Topics of a type that each node subscribes to (commands) or publishes (replies).
    topics_by_node: dict[str, list[str]] = {}
    for topic, info in view.topics.items():
        if info.msg_type == msg_type:
            nodes = (
                subscriber_nodes(view, topic) if msg_type == COMMAND_TYPE else publisher_nodes(view, topic)
            )
            for node in nodes:
                topics_by_node.setdefault(node, []).append(topic)
    return topics_by_node
