"""Topics that move robots, determined from descriptions, types and subscribers. Performs no I/O.

All code that publishes on behalf of a person or a program calls `MovingTopics.robots_moved_by`: alarms,
`nep play`, `nep bridge`, `nep web`, behaviours, and in Studio the Publish panel and replays.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

from nep.errors import BadTopicError
from nep.protocol.graph_view import GraphView
from nep.protocol.topic_pattern import is_pattern, matches
from nep.protocol.wire import check_topic

DESCRIPTION_TYPE = "robot/description"
COMMAND_TYPE = "robot/command"
REPLY_TYPE = "robot/answer"
RIZE_COMMAND_TOPIC = "robot_action"
"""Topic for commands to all RIZE robots, to which robots of the driver kit also subscribe."""
_CONTROL_KEYS = ("command", "world")
_DESCRIPTION_SUFFIX, _ANSWER_SUFFIX = "/description", "/answer"
_HREF_SCHEME = "nep:"
_ORIGINAL_GENERATIONS = frozenset({"A", "B"})
_COMMAND_NAMES = frozenset({"command", "cmd_vel"})
_MAX_TOPICS = 100
_MAX_NAME_LENGTH = 256


@dataclass(frozen=True, slots=True)
class RobotControls:
    """Topics that control one robot.

    Attributes:
        name: Name of the robot.
        topics: Topics or patterns on which messages move the robot or change its world.
    """

    name: str
    topics: frozenset[str]


class MovingTopics:
    """Snapshot of the topics that move robots. Immutable, hence thread-safe.

    Args:
        robots: Robots and the topics that move them.
        unidentified: Topics or patterns that move robots of unknown names.
        matches_command_names: True to also include topics named like commands (``.../command``,
            ``.../cmd_vel``). For recordings, which may lack the robot's description.
    """

    __slots__ = ("_all_names", "_matches_command_names", "_patterns", "_robots_by_topic", "_unidentified")

    def __init__(
        self,
        robots: Iterable[RobotControls] = (),
        *,
        unidentified: Iterable[str] = (),
        matches_command_names: bool = False,
    ) -> None:
        robot_controls = tuple(robots)
        robots_by_topic: dict[str, dict[str, None]] = {}
        for robot in robot_controls:
            for topic in robot.topics:
                robots_by_topic.setdefault(topic, {})[robot.name] = None
        self._robots_by_topic = {topic: tuple(names) for topic, names in robots_by_topic.items()}
        self._unidentified = frozenset(unidentified)
        self._patterns = tuple(
            topic for topic in {*self._robots_by_topic, *self._unidentified} if is_pattern(topic)
        )
        self._all_names = tuple(dict.fromkeys(robot.name for robot in robot_controls))
        self._matches_command_names = matches_command_names

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of all identified robots."""
        return self._all_names

    @property
    def topics(self) -> dict[str, tuple[str, ...]]:
        """Names of the identified robots by the topic or pattern that moves them."""
        robots_by_topic = dict(self._robots_by_topic)
        if self._all_names:
            robots_by_topic[RIZE_COMMAND_TOPIC] = self._all_names
        return robots_by_topic

    def robots_on(self, topic: str) -> tuple[str, ...]:
        """Return the names of the identified robots that messages on a topic move."""
        if topic == RIZE_COMMAND_TOPIC:
            return self._all_names
        names = dict.fromkeys(self._robots_by_topic.get(topic, ()))
        for pattern in self._patterns:
            if matches(pattern, topic):
                names |= dict.fromkeys(self._robots_by_topic.get(pattern, ()))
        return tuple(names)

    def robots_moved_by(self, topic: str, msg_type: str = "") -> tuple[str, ...]:
        """Return the names of the robots that messages on a topic move; empty if there are none.

        If a robot of unknown name is moved (because of the type ``robot/command``, RIZE's topic, or
        subscribers in the graph), the topic is returned in place of its name.

        Args:
            topic: Topic to publish on.
            msg_type: Message type to publish with, if known.
        """
        return self.robots_on(topic) or ((topic,) if self._is_unidentified(topic, msg_type) else ())

    def _is_unidentified(self, topic: str, msg_type: str) -> bool:
        return (
            topic == RIZE_COMMAND_TOPIC
            or msg_type == COMMAND_TYPE
            or topic in self._unidentified
            or (self._matches_command_names and topic.rpartition("/")[2] in _COMMAND_NAMES)
            or any(each in self._unidentified and matches(each, topic) for each in self._patterns)
        )


def parse_controls(description: object, fallback_name: str = "") -> RobotControls | None:
    """Parse the name and the controlling topics in a robot's description.

    The rest of the description is not validated, so that an invalid description still protects its
    robot.

    Args:
        description: Decoded message of the type ``robot/description``.
        fallback_name: Name for a description without a valid title.

    Returns:
        The controls, or None if the description isn't a map, or has no name or no valid topic.
    """
    if not isinstance(description, Mapping):
        return None
    title = description.get("title")
    name = title if isinstance(title, str) and title and len(title) <= _MAX_NAME_LENGTH else fallback_name
    topics = set[str]()
    for topic in _controlling_topics(description):
        with suppress(BadTopicError):  # publishing there is impossible
            topics.add(check_topic(topic))
        if len(topics) >= _MAX_TOPICS:
            break
    return RobotControls(name, frozenset(topics)) if name and topics else None


def _controlling_topics(description: Mapping[object, object]) -> Iterator[str]:
    topics_by_key = description.get("rb:topics")
    if isinstance(topics_by_key, Mapping):
        yield from (
            topic for key in _CONTROL_KEYS if isinstance(topic := topics_by_key.get(key), str) and topic
        )
    actions = description.get("actions")
    for action in actions.values() if isinstance(actions, Mapping) else ():
        forms = action.get("forms") if isinstance(action, Mapping) else None
        for form in forms if isinstance(forms, list | tuple) else ():
            href = form.get("href") if isinstance(form, Mapping) else None
            if isinstance(href, str) and href.startswith(_HREF_SCHEME) and href != _HREF_SCHEME:
                yield href.removeprefix(_HREF_SCHEME)


def description_topics(view: GraphView) -> frozenset[str]:
    """Return the topics on which robot descriptions are currently published."""
    return frozenset(
        topic for topic, info in view.topics.items() if info.msg_type == DESCRIPTION_TYPE and info.publishers
    )


def robot_name_of(topic: str) -> str:
    """Return the robot's name according to its description topic.

    For example, the name is ``Rover`` for ``/Rover/description``.
    """
    return topic.strip("/").removesuffix(_DESCRIPTION_SUFFIX) or topic


def moving_topics(
    view: GraphView,
    robots: Iterable[RobotControls],
    unread: Collection[str] = (),
    own_nodes: Collection[str] = (),
) -> MovingTopics:
    """Combine the robots known from their descriptions with robots found in the graph.

    Args:
        view: Current graph.
        robots: Robots whose descriptions were read.
        unread: Description topics that were not read yet. All topics to which their programs subscribe
            count as moving, as do the default topics of a robot.
        own_nodes: Ids of the caller's nodes, whose subscriptions are ignored.
    """
    all_robots = [*robots, *_unread_robots(view, unread, own_nodes)]
    command_topics = [
        (info.name, info.subscribers) for info in view.topics.values() if info.msg_type == COMMAND_TYPE
    ]
    command_topics += [
        (info.name, info.subscribers) for info in view.patterns.values() if info.msg_type == COMMAND_TYPE
    ]
    unidentified = (
        name
        for name, subscribers in command_topics
        if any(each.node_id not in own_nodes for each in subscribers)
    )
    return MovingTopics(all_robots, unidentified=unidentified)


def _unread_robots(
    view: GraphView, unread: Collection[str], own_nodes: Collection[str]
) -> Iterator[RobotControls]:
    # A driver of the kit publishes its answer topic first, then subscribes to commands, and publishes its
    # description last: a publisher of answers without a description is about to announce a robot.
    described_node_ids = {id for topic in description_topics(view) for id in _publisher_node_ids(view, topic)}
    programs: list[tuple[str, set[str]]] = [
        (topic.removesuffix(_DESCRIPTION_SUFFIX), _publisher_node_ids(view, topic)) for topic in unread
    ]
    programs += [
        (topic.removesuffix(_ANSWER_SUFFIX), node_ids)
        for topic, info in view.topics.items()
        if info.msg_type == REPLY_TYPE and (node_ids := _publisher_node_ids(view, topic) - described_node_ids)
    ]
    subscriptions = _subscriptions(view) if programs else {}
    for prefix, node_ids in programs:
        topics = {f"{prefix}/{key}" for key in _CONTROL_KEYS}
        for node_id in node_ids.difference(own_nodes):
            topics |= subscriptions.get(node_id, set())
        yield RobotControls(prefix.strip("/") or prefix, frozenset(topics))


def _publisher_node_ids(view: GraphView, topic: str) -> set[str]:
    info = view.topics.get(topic)
    return {each.node_id for each in info.publishers} if info is not None else set()


def _subscriptions(view: GraphView) -> dict[str, set[str]]:
    topics_by_node: dict[str, set[str]] = {}
    subscriptions = [(info.name, info.subscribers) for info in view.topics.values()]
    subscriptions += [(info.name, info.subscribers) for info in view.patterns.values()]
    for name, subscribers in subscriptions:
        for subscriber in subscribers:
            topics_by_node.setdefault(subscriber.node_id, set()).add(name)
    return topics_by_node


def original_robots(view: GraphView) -> Iterator[RobotControls]:
    """Yield robots without a description: programs of the original NEP that subscribe to RIZE commands."""
    info = view.topics.get(RIZE_COMMAND_TOPIC)
    for subscriber in info.subscribers if info is not None else ():
        node = view.nodes.get(subscriber.node_id)
        if node is not None and node.generation in _ORIGINAL_GENERATIONS:
            yield RobotControls(node.name, frozenset({RIZE_COMMAND_TOPIC}))
