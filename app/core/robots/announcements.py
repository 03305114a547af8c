"""Announcements of robots. The first program that announces a name owns it.

Announcements of other programs under the same name are ignored and reported as claims. Another program
can become the owner only after the master has removed the announcement of the previous one. Robots of
RIZE announce nothing; nodes that subscribe to ``robot_action`` count as such robots.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from app.core.network.mailbox import Batch
from app.core.network.watches import Watch, Watches
from app.errors import DescriptionError
from app.robots import rize
from app.robots.description.description import Robot, parse_announcement
from app.robots.identity import (
    DESCRIPTION_TYPE,
    Identity,
    Senders,
    description_topic_problem,
    identity_of,
    publisher_nodes,
)
from nep.errors import NepError
from nep.i18n import _, format_list, ngettext
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

MAX_ROBOTS = 200
MAX_CLAIMANTS = 8
MAX_OWNERS = 4
"""Maximum number of previous owners of a name whose descriptions are stored, in case they return."""
MAX_CPU_SHARE = 0.2
"""Maximum average share of the main thread's time that is spent on parsing descriptions."""
MAX_PARSE_BUDGET_S = 1.0
"""Maximum time in seconds for parsing after an idle period, for example for all robots of a room."""

NATIVE_GENERATIONS = frozenset({"native", "gateway"})
NODE_NAME_SUFFIXES = ("_driver", "_robot", "_node")


@dataclass(frozen=True, slots=True)
class Claim:
    """Rejected announcement of a name that another program owns.

    Attributes:
        title: Problem in one sentence.
        detail: Consequence.
    """

    title: str
    detail: str


@dataclass(slots=True)
class _Announcement:
    """Topic of a description, its owner, and the newest description of each publisher.

    The descriptions of all owners are stored even while the graph doesn't list them: a latched message
    is received only once, and a suspended program resumes on the same connection.

    Attributes:
        owners: Nodes that have owned the topic, newest first.
        messages: Newest description of each publisher.
        rank: Number of topics that the same node announced before this one.
    """

    watch: Watch | None = None
    owner: Identity | None = None
    owners: tuple[str, ...] = ()
    messages: dict[int, Message] = field(default_factory=dict)
    parsed_message: Message | None = None
    robot: Robot | None = None
    claim: Claim | None = None
    is_unreadable: bool = False
    rank: int = 0
    other_owners: tuple[Identity, ...] = ()


class Announcements:
    """Robot descriptions received from the network, and the programs that own them. Not thread-safe."""

    def __init__(
        self,
        watches: Watches,
        senders: Senders,
        clock: Callable[[], float] = time.monotonic,
        is_proven: Callable[[str], bool] = lambda _topic: False,
    ) -> None:
        # A robot whose topic `is_proven` (it has answered, or may move) is never evicted.
        self._is_proven = is_proven
        self._watches, self._senders, self._clock = watches, senders, clock
        self._parse_budget_s, self._budget_updated_s = MAX_PARSE_BUDGET_S, clock()
        self._waiting: set[str] = set()
        self._topics: dict[str, _Announcement] = {}
        self.left_out: tuple[str, ...] = ()
        """Description topics of robots beyond `MAX_ROBOTS`."""

    def is_announced(self, topic: str) -> bool:
        """Return True if a robot is announced on this topic."""
        known = self._topics.get(topic)
        return known is not None and known.watch is not None

    @property
    def robots(self) -> Iterator[tuple[str, Robot, Identity]]:
        """Announced robots as tuples of topic, description and owner."""
        for topic, known in self._topics.items():
            if known.watch is not None and known.robot is not None and known.owner is not None:
                yield topic, known.robot, known.owner

    @property
    def unreadable_topics(self) -> tuple[str, ...]:
        """Topics whose descriptions are invalid."""
        return tuple(
            topic for topic, known in self._topics.items() if known.is_unreadable and known.robot is None
        )

    @property
    def claims(self) -> Mapping[str, Claim]:
        """Rejected announcements by id."""
        found = {}
        for topic, known in self._topics.items():
            if known.watch is None:
                continue
            if known.other_owners and known.owner is not None:
                name = known.robot.name if known.robot is not None else topic
                found[topic] = Claim(
                    _("{count} programs announce themselves as {robot}.").format(
                        count=len(known.other_owners) + 1, robot=name
                    ),
                    _("{first} was first and is used; {others} is ignored. Close all but one.").format(
                        first=known.owner.display_name,
                        others=format_list(
                            [twin.display_name for twin in known.other_owners[:MAX_CLAIMANTS]]
                        ),
                    ),
                )
            elif known.claim is not None:
                found[topic] = known.claim
        if self.left_out:
            title = ngettext(
                "{count} more robot is on the network; Studio shows at most {most}.",
                "{count} more robots are on the network; Studio shows at most {most}.",
                len(self.left_out),
            ).format(count=len(self.left_out), most=MAX_ROBOTS)
            found["robots"] = Claim(title, _("Find out which program announces them, and close it."))
        return found

    def update(self, view: GraphView) -> None:
        """Apply a new graph, which determines the announced robots and their owners."""
        there = {
            topic: nodes
            for topic, info in view.topics.items()
            if info.msg_type == DESCRIPTION_TYPE and (nodes := publisher_nodes(view, topic))
        }
        self._senders.update(view, there)
        for topic, known in self._topics.items():
            if topic not in there:
                self._mark_vanished(known)
        left_out: list[str] = []
        for place, topic in _fair_topic_order(there):
            nodes = there[topic]
            begun = self._topics.get(topic) or self._add_topic(topic, place, left_out)
            if begun is None:
                left_out.append(topic)
                continue
            known, begun.rank = begun, place
            if known.watch is None:
                known.watch = self._watches.open([topic])
            if known.owner is None or known.owner.node_id not in nodes:
                known.owner, known.robot, known.parsed_message = identity_of(view, nodes[0]), None, None
                known.claim = None
                known.owners = tuple(dict.fromkeys((nodes[0], *known.owners)))[:MAX_OWNERS]
            others = (node for node in nodes if node != known.owner.node_id)
            known.other_owners = tuple(identity_of(view, node) for node in others)
            ids = {publisher.id for publisher in view.topics[topic].publishers}
            known.messages = {
                id: message
                for id, message in known.messages.items()
                if id in ids or self._senders.node_of(message) in known.owners
            }
            self._waiting.add(topic)
        self.left_out = tuple(left_out)
        self._parse_pending()

    def add(self, batches: Mapping[str, Batch]) -> bool:
        """Add received descriptions; return True if a description, possibly an earlier one, was parsed."""
        for topic in batches.keys() & self._topics.keys():
            known = self._topics[topic]
            for message in batches[topic].messages:
                if message.publisher is not None:
                    known.messages.pop(message.publisher, None)  # so that the newest is last
                    known.messages[message.publisher] = message
            while len(known.messages) > MAX_CLAIMANTS:
                self._evict_one(known)
            self._waiting.add(topic)
        return self._parse_pending()

    # -- private ---------------------------------------------------------------------------------------------

    def _add_topic(self, topic: str, place: int, left_out: list[str]) -> _Announcement | None:
        # None when there are too many. Vanished topics are evicted first, then those of nodes that announce
        # more robots than this one.
        if len(self._topics) >= MAX_ROBOTS:
            strangers = [name for name in self._topics if not self._is_proven(name)]
            gone = next((name for name in strangers if self._topics[name].watch is None), None)
            last = max(strangers, key=lambda name: self._topics[name].rank, default=None)
            if gone is None and last is not None and self._topics[last].rank > place:
                gone = last
                left_out.append(last)
            if gone is None:
                return None
            self._mark_vanished(self._topics.pop(gone))
        return self._topics.setdefault(topic, _Announcement())

    def _mark_vanished(self, known: _Announcement) -> None:
        # The owner and its description are kept: after a restart of the master or a suspension it returns
        # over the same connection.
        if known.watch is not None:
            known.watch.close()
        known.watch, known.robot, known.parsed_message, known.other_owners = None, None, None, ()
        known.messages = {id: told for id, told in known.messages.items() if self._is_from_owner(known, told)}

    def _evict_one(self, known: _Announcement) -> None:
        # Evicts another publisher's description; those of the robot's programs last.
        for owners in (known.owners, known.owners[:1]):
            for id, told in known.messages.items():
                if self._senders.node_of(told) not in owners:
                    del known.messages[id]
                    return
        del known.messages[next(iter(known.messages))]

    def _is_from_owner(self, known: _Announcement, message: Message) -> bool:
        return known.owner is not None and self._senders.node_of(message) == known.owner.node_id

    def _parse_pending(self) -> bool:
        # New robots first, then the shortest description. The time is limited, so that a program that keeps
        # changing a long description can't block the window and its Stop.
        now = self._clock()
        self._parse_budget_s = min(
            MAX_PARSE_BUDGET_S, self._parse_budget_s + (now - self._budget_updated_s) * MAX_CPU_SHARE
        )
        self._budget_updated_s = now
        wait = {
            topic: newest for topic in self._waiting if (newest := self._unparsed_message(topic)) is not None
        }
        self._waiting = set(wait)

        def sort_key(each: tuple[str, Message]) -> tuple[bool, int]:
            return self._topics[each[0]].parsed_message is not None, len(each[1].data)

        for topic, newest in sorted(wait.items(), key=sort_key):
            if self._parse_budget_s <= 0:
                break
            began = self._clock()
            self._parse(topic, newest)
            self._parse_budget_s -= self._clock() - began
            self._waiting.discard(topic)
        return len(self._waiting) < len(wait)

    def _unparsed_message(self, topic: str) -> Message | None:
        # None if the newest description of the robot's own program has been parsed.
        known = self._topics.get(topic)
        if known is None or known.watch is None:
            return None
        newest = next(
            (told for told in reversed(known.messages.values()) if self._is_from_owner(known, told)), None
        )
        return None if newest is known.parsed_message else newest

    def _parse(self, topic: str, newest: Message) -> None:
        known = self._topics[topic]
        known.parsed_message, known.claim, known.is_unreadable = newest, None, False
        try:
            robot = parse_announcement(newest)
        except NepError:
            return  # reported by the session's alert `message:<topic>`; the previous description stays valid
        except DescriptionError as error:
            sentence = f"{error.sentence[:1].upper()}{error.sentence[1:]}."
            whose = known.owner.display_name if known.owner is not None else topic
            words = (
                _("{program} sent this invalid description; fix its driver.")
                if known.robot is None
                else _(
                    "{program} sent this invalid description; fix its driver. "
                    "The previous description is used."
                )
            )
            known.claim, known.is_unreadable = Claim(sentence, words.format(program=whose)), True
            return
        wrong = description_topic_problem(robot, topic)
        known.robot = robot if wrong is None else None
        if wrong is not None:
            known.claim = Claim(f"{wrong}.", _("Find out what this program is, and close it."))


def _fair_topic_order(there: Mapping[str, Sequence[str]]) -> list[tuple[int, str]]:
    # Sorted so that the first topic of each node comes before the second topic of any node.
    counts: Counter[str] = Counter()
    placed = []
    for topic, nodes in there.items():
        placed.append((counts[nodes[0]], topic))
        counts[nodes[0]] += 1
    return sorted(placed, key=lambda each: each[0])


class RizeNames:
    """Names of the connected robots of RIZE, taken from their ready messages or else from their nodes."""

    def __init__(self) -> None:
        self._told: dict[str, None] = {}

    def add(self, name: str) -> None:
        """Add the name in a ready message received on ``rize_event``."""
        self._told.setdefault(name)
        if len(self._told) > MAX_ROBOTS:
            del self._told[next(iter(self._told))]

    def names_in(self, view: GraphView, native: Collection[str] = ()) -> set[str]:
        """Return the names of the RIZE robots in a graph.

        Args:
            view: Current graph.
            native: Names of robots with a description, which also send ready messages on
                ``rize_event``.
        """
        candidates = [name for name in self._told if name not in native]
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


def _match_name(node: str, told: Collection[str]) -> str:
    stem = node
    for suffix in NODE_NAME_SUFFIXES:
        stem = stem.removesuffix(suffix)
    same = {stem.lower(), node.lower()}
    return next((name for name in told if name.lower() in same), stem or node)
