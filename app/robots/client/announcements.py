"""Announcements of robots. The first program that announces a name owns it.

Announcements of other programs under the same name are ignored and reported as claims. Another program
can become the owner only after the master has removed the announcement of the previous one. Robots of
RIZE announce nothing; nodes that subscribe to ``robot_action`` count as such robots.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.errors import DescriptionError
from app.robots.client import rize
from app.robots.client.inbox import Senders
from app.robots.client.limits import MAX_ROBOTS
from app.robots.description.description import Robot, parse_announcement
from app.robots.identity import (
    DESCRIPTION_TYPE,
    NATIVE_GENERATIONS,
    Identity,
    description_topic_problem,
    identity_of,
    publisher_nodes,
    topic_conflict,
)
from nep.errors import NepError
from nep.i18n import _, format_list, ngettext
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

MAX_CLAIMANTS = 8
MAX_OWNERS = 4
"""Maximum number of previous owners of a name whose descriptions are stored, in case they return."""
MAX_CPU_SHARE = 0.2
"""Maximum average share of the main thread's time that is spent on parsing descriptions."""
MAX_PARSE_BUDGET_S = 1.0
"""Maximum time in seconds for parsing after an idle period, for example for all robots of a room."""

NODE_NAME_SUFFIXES = ("_driver", "_robot", "_node")


class TopicWatch(Protocol):
    """Subscription to a topic."""

    def close(self) -> None:
        """End the subscription."""
        ...


class TopicWatches(Protocol):
    """Owner of the subscriptions to descriptions; implemented by `app.core.network.watches.Watches`."""

    def open(self, topics: Sequence[str], /) -> TopicWatch:
        """Subscribe to topics."""
        ...


class ReceivedMessages(Protocol):
    """Messages of one topic; implemented by `app.core.network.mailbox.Batch`."""

    @property
    def messages(self) -> Sequence[Message]:
        """Messages in order of arrival."""
        ...


@dataclass(frozen=True, slots=True)
class Claim:
    """Rejected announcement of a name that another program owns.

    Attributes:
        title: Problem in one sentence.
        detail: Consequence.
    """

    title: str
    detail: str

    @property
    def sentence(self) -> str:
        """Problem and consequence."""
        return f"{self.title} {self.detail}"


def foreign_topic_claim(robot: Robot, robots: Iterable[Robot]) -> Claim | None:
    """Return a claim if the description of a robot names topics of another robot, else None.

    Args:
        robot: Announced robot.
        robots: All known robots; `robot` itself is ignored.
    """
    problem = topic_conflict(robot, robots)
    if problem is None:
        return None
    return Claim(
        f"{problem}.",
        _("{robot} is ignored. Find out what this program is, and close it.").format(robot=robot.name),
    )


@dataclass(slots=True)
class _Announcement:
    """Topic of a description, its owner, and the newest description of each publisher.

    The descriptions of all owners are stored even while the graph doesn't list them: a latched message
    is received only once, and a suspended program resumes on the same connection.

    Attributes:
        owners: Nodes that have owned the topic, newest first.
        messages: Newest description of each publisher.
        rank: Number of topics that the same node announced before this one.
        decode_error: Reason why the newest message can't be decoded, or "".
    """

    watch: TopicWatch | None = None
    owner: Identity | None = None
    owners: tuple[str, ...] = ()
    messages: dict[int, Message] = field(default_factory=dict)
    parsed_message: Message | None = None
    robot: Robot | None = None
    claim: Claim | None = None
    is_unreadable: bool = False
    rank: int = 0
    other_owners: tuple[Identity, ...] = ()
    decode_error: str = ""


class Announcements:
    """Robot descriptions received from the network, and the programs that own them. Not thread-safe."""

    def __init__(
        self,
        watches: TopicWatches,
        senders: Senders,
        clock: Callable[[], float] = time.monotonic,
        is_proven: Callable[[str], bool] = lambda _topic: False,
    ) -> None:
        # A robot whose topic `is_proven` (it has answered, or may move) is never evicted.
        self._is_proven = is_proven
        self._watches, self._senders, self._clock = watches, senders, clock
        self._parse_budget_s, self._budget_updated_s = MAX_PARSE_BUDGET_S, clock()
        self._pending_topics: set[str] = set()
        self._topics: dict[str, _Announcement] = {}
        self.omitted_topics: tuple[str, ...] = ()
        """Description topics of robots beyond `MAX_ROBOTS`."""

    def is_announced(self, topic: str) -> bool:
        """Return True if a robot is announced on this topic."""
        announcement = self._topics.get(topic)
        return announcement is not None and announcement.watch is not None

    @property
    def robots(self) -> Iterator[tuple[str, Robot, Identity]]:
        """Announced robots as tuples of topic, description and owner."""
        for topic, announcement in self._topics.items():
            if (
                announcement.watch is not None
                and announcement.robot is not None
                and announcement.owner is not None
            ):
                yield topic, announcement.robot, announcement.owner

    @property
    def unreadable_topics(self) -> tuple[str, ...]:
        """Topics whose descriptions are invalid."""
        return tuple(
            topic
            for topic, announcement in self._topics.items()
            if announcement.is_unreadable and announcement.robot is None
        )

    @property
    def unread_topics(self) -> tuple[str, ...]:
        """Topics of announced robots whose descriptions have not been received yet."""
        return tuple(
            topic
            for topic, announcement in self._topics.items()
            if announcement.watch is not None and announcement.parsed_message is None
        )

    @property
    def decode_errors(self) -> Mapping[str, str]:
        """Reasons why messages can't be decoded, by topic."""
        return {
            topic: announcement.decode_error
            for topic, announcement in self._topics.items()
            if announcement.decode_error
        }

    @property
    def claims(self) -> Mapping[str, Claim]:
        """Problems with announcements, by topic: rejected ones, and robots with several programs.

        If more robots are announced than Studio shows, the key "robots" has a problem too.
        """
        claims_by_id = {}
        for topic, announcement in self._topics.items():
            if announcement.watch is None:
                continue
            if announcement.other_owners and announcement.owner is not None:
                name = announcement.robot.name if announcement.robot is not None else topic
                claims_by_id[topic] = Claim(
                    _("{count} programs announce themselves as {robot}.").format(
                        count=len(announcement.other_owners) + 1, robot=name
                    ),
                    _(
                        "{first} announced the robot first and is used. Ignored: {others}. Close the "
                        "programs that you don't need."
                    ).format(
                        first=announcement.owner.display_name,
                        others=format_list(
                            [other.display_name for other in announcement.other_owners[:MAX_CLAIMANTS]]
                        ),
                    ),
                )
            elif announcement.claim is not None:
                claims_by_id[topic] = announcement.claim
        if self.omitted_topics:
            title = ngettext(
                "{count} more robot is on the network; Studio shows at most {most}.",
                "{count} more robots are on the network; Studio shows at most {most}.",
                len(self.omitted_topics),
            ).format(count=len(self.omitted_topics), most=MAX_ROBOTS)
            claims_by_id["robots"] = Claim(title, _("Find out which program announces them, and close it."))
        return claims_by_id

    def update(self, view: GraphView) -> None:
        """Apply a new graph, which determines the announced robots and their owners."""
        nodes_by_topic = {
            topic: nodes
            for topic, info in view.topics.items()
            if info.msg_type == DESCRIPTION_TYPE and (nodes := publisher_nodes(view, topic))
        }
        self._senders.update(view, nodes_by_topic)
        for topic, announcement in self._topics.items():
            if topic not in nodes_by_topic:
                self._mark_vanished(announcement)
        omitted_topics: list[str] = []
        for rank, topic in _fair_topic_order(nodes_by_topic):
            nodes = nodes_by_topic[topic]
            added = self._topics.get(topic) or self._add_topic(topic, rank, omitted_topics)
            if added is None:
                omitted_topics.append(topic)
                continue
            announcement, added.rank = added, rank
            if announcement.watch is None:
                announcement.watch = self._watches.open([topic])
            if announcement.owner is None or announcement.owner.node_id not in nodes:
                announcement.owner, announcement.robot, announcement.parsed_message = (
                    identity_of(view, nodes[0]),
                    None,
                    None,
                )
                announcement.claim, announcement.decode_error = None, ""
                announcement.owners = tuple(dict.fromkeys((nodes[0], *announcement.owners)))[:MAX_OWNERS]
            other_nodes = (node for node in nodes if node != announcement.owner.node_id)
            announcement.other_owners = tuple(identity_of(view, node) for node in other_nodes)
            ids = {publisher.id for publisher in view.topics[topic].publishers}
            announcement.messages = {
                id: message
                for id, message in announcement.messages.items()
                if id in ids or self._senders.node_of(message) in announcement.owners
            }
            self._pending_topics.add(topic)
        self.omitted_topics = tuple(omitted_topics)
        self._parse_pending()

    def add(self, batches: Mapping[str, ReceivedMessages]) -> bool:
        """Add received descriptions; return True if a description, possibly an earlier one, was parsed."""
        for topic in batches.keys() & self._topics.keys():
            announcement = self._topics[topic]
            for message in batches[topic].messages:
                if message.publisher is not None:
                    announcement.messages.pop(message.publisher, None)  # so that the newest is last
                    announcement.messages[message.publisher] = message
            while len(announcement.messages) > MAX_CLAIMANTS:
                self._evict_one(announcement)
            self._pending_topics.add(topic)
        return self._parse_pending()

    # -- private ---------------------------------------------------------------------------------------------

    def _add_topic(self, topic: str, rank: int, omitted_topics: list[str]) -> _Announcement | None:
        # None when there are too many. Vanished topics are evicted first, then those of nodes that announce
        # more robots than this one.
        if len(self._topics) >= MAX_ROBOTS:
            unproven_topics = [name for name in self._topics if not self._is_proven(name)]
            evicted_topic = next((name for name in unproven_topics if self._topics[name].watch is None), None)
            last_topic = max(unproven_topics, key=lambda name: self._topics[name].rank, default=None)
            if evicted_topic is None and last_topic is not None and self._topics[last_topic].rank > rank:
                evicted_topic = last_topic
                omitted_topics.append(last_topic)
            if evicted_topic is None:
                return None
            self._mark_vanished(self._topics.pop(evicted_topic))
        return self._topics.setdefault(topic, _Announcement())

    def _mark_vanished(self, announcement: _Announcement) -> None:
        # The owner and its description are kept: after a restart of the master or a suspension it returns
        # over the same connection.
        if announcement.watch is not None:
            announcement.watch.close()
        announcement.watch, announcement.robot, announcement.parsed_message, announcement.other_owners = (
            None,
            None,
            None,
            (),
        )
        announcement.messages = {
            id: message
            for id, message in announcement.messages.items()
            if self._is_from_owner(announcement, message)
        }

    def _evict_one(self, announcement: _Announcement) -> None:
        # Evicts another publisher's description; those of the robot's programs last.
        for owners in (announcement.owners, announcement.owners[:1]):
            for id, message in announcement.messages.items():
                if self._senders.node_of(message) not in owners:
                    del announcement.messages[id]
                    return
        del announcement.messages[next(iter(announcement.messages))]

    def _is_from_owner(self, announcement: _Announcement, message: Message) -> bool:
        return announcement.owner is not None and self._senders.node_of(message) == announcement.owner.node_id

    def _parse_pending(self) -> bool:
        # New robots first, then the shortest description. The time is limited, so that a program that keeps
        # changing a long description can't block the window and its Stop.
        now = self._clock()
        self._parse_budget_s = min(
            MAX_PARSE_BUDGET_S, self._parse_budget_s + (now - self._budget_updated_s) * MAX_CPU_SHARE
        )
        self._budget_updated_s = now
        pending = {
            topic: newest
            for topic in self._pending_topics
            if (newest := self._unparsed_message(topic)) is not None
        }
        self._pending_topics = set(pending)

        def sort_key(item: tuple[str, Message]) -> tuple[bool, int]:
            return self._topics[item[0]].parsed_message is not None, len(item[1].data)

        for topic, newest in sorted(pending.items(), key=sort_key):
            if self._parse_budget_s <= 0:
                break
            start_time_s = self._clock()
            self._parse(topic, newest)
            self._parse_budget_s -= self._clock() - start_time_s
            self._pending_topics.discard(topic)
        return len(self._pending_topics) < len(pending)

    def _unparsed_message(self, topic: str) -> Message | None:
        # None if the newest description of the robot's own program has been parsed.
        announcement = self._topics.get(topic)
        if announcement is None or announcement.watch is None:
            return None
        newest = next(
            (
                message
                for message in reversed(announcement.messages.values())
                if self._is_from_owner(announcement, message)
            ),
            None,
        )
        return None if newest is announcement.parsed_message else newest

    def _parse(self, topic: str, newest: Message) -> None:
        announcement = self._topics[topic]
        announcement.parsed_message, announcement.claim, announcement.is_unreadable = newest, None, False
        announcement.decode_error = ""
        try:
            robot = parse_announcement(newest)
        except NepError as error:
            announcement.decode_error = f"{error}"
            return  # reported by the session's alert `message:<topic>`; the previous description stays valid
        except DescriptionError as error:
            title = f"{error.sentence[:1].upper()}{error.sentence[1:]}."
            program = announcement.owner.display_name if announcement.owner is not None else topic
            template = (
                _("{program} sent this invalid description; fix its driver.")
                if announcement.robot is None
                else _(
                    "{program} sent this invalid description; fix its driver. "
                    "The previous description is used."
                )
            )
            announcement.claim, announcement.is_unreadable = (
                Claim(title, template.format(program=program)),
                True,
            )
            return
        problem = description_topic_problem(robot, topic)
        announcement.robot = robot if problem is None else None
        if problem is not None:
            announcement.claim = Claim(f"{problem}.", _("Find out what this program is, and close it."))


def _fair_topic_order(nodes_by_topic: Mapping[str, Sequence[str]]) -> list[tuple[int, str]]:
    # Sorted so that the first topic of each node comes before the second topic of any node.
    counts: Counter[str] = Counter()
    ranked = []
    for topic, nodes in nodes_by_topic.items():
        ranked.append((counts[nodes[0]], topic))
        counts[nodes[0]] += 1
    return sorted(ranked, key=lambda each: each[0])


class RizeNames:
    """Names of the connected robots of RIZE, taken from their ready messages or else from their nodes."""

    def __init__(self) -> None:
        self._announced_names: dict[str, None] = {}

    def add(self, name: str) -> None:
        """Add the name in a ready message received on ``rize_event``."""
        self._announced_names.setdefault(name)
        if len(self._announced_names) > MAX_ROBOTS:
            del self._announced_names[next(iter(self._announced_names))]

    def names_in(self, view: GraphView, native: Collection[str] = ()) -> set[str]:
        """Return the names of the RIZE robots in a graph.

        Args:
            view: Current graph.
            native: Names of robots with a description, which also send ready messages on
                ``rize_event``.
        """
        candidates = [name for name in self._announced_names if name not in native]
        info = view.topics.get(rize.COMMANDS)
        ids = {subscriber.node_id for subscriber in info.subscribers} if info is not None else set()
        nodes = [
            view.nodes[id].name
            for id in ids
            if id in view.nodes and view.nodes[id].generation not in NATIVE_GENERATIONS
        ]
        if len(nodes) == 1 and len(candidates) == 1:
            return {candidates[0]}
        return {_match_name(node, candidates) for node in nodes}


def _match_name(node: str, names: Collection[str]) -> str:
    stem = node
    for suffix in NODE_NAME_SUFFIXES:
        stem = stem.removesuffix(suffix)
    accepted_names = {stem.lower(), node.lower()}
    return next((name for name in names if name.lower() in accepted_names), stem or node)
