"""Stop of robots: which programs must reply, and what their replies prove. Performs no I/O.

A robot is proven to have stopped when its own program, and every other program that receives its commands and
publishes its replies, has confirmed the same Stop. Replies of other programs never count.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from app.robots.client.dialects import ClientDialect, dialect_of, new_id
from app.robots.client.inbox import PendingMessages
from app.robots.client.limits import (
    LATE_REPLY_TIMEOUT_S,
    MAX_LATE_STOPS,
    MAX_NAMED_LISTENERS,
    MAX_SERVING_PROGRAMS,
    MAX_STOP_REPLY_BYTES,
    MAX_STOP_TOPICS,
)
from app.robots.client.reply import RobotReply
from app.robots.client.stop_report import RobotStop
from app.robots.description.model import Robot, RobotTopics
from app.robots.identity import (
    Identity,
    first_announcer,
    identity_of,
    publisher_nodes,
    stop_error_text,
    subscriber_nodes,
)
from nep.errors import NepError
from nep.i18n import ngettext
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

MIN_DISPLAYED_WAIT_MS = 20.0
"""Minimum time until the robot was connected that is mentioned in the result, in milliseconds."""
MAX_STOP_IDS = 10_000
_UNKNOWN_PROGRAM = ""
"""Placeholder for the program of a robot that the graph does not list yet; no node has this id."""
_MAX_FOREIGN_REPLIES = 4


@dataclass(frozen=True)
class StopTarget:
    """Robot to be stopped.

    Attributes:
        identity: Program of the robot; None for the first program that announced the robot.
        earlier_programs: Earlier programs with the robot's name that may still be running and move the robot.
        earlier_topics: Topics of earlier descriptions.
        is_expected: False if the reply is not awaited. The Stop is then sent in case the robot still
            receives commands.
    """

    robot: Robot
    identity: Identity | None = None
    earlier_programs: tuple[Identity, ...] = ()
    earlier_topics: tuple[RobotTopics, ...] = ()
    is_expected: bool = True

    @property
    def dialect(self) -> ClientDialect:
        """Dialect of the robot."""
        return dialect_of(self.robot)

    @property
    def topic_sets(self) -> tuple[RobotTopics, ...]:
        """Topics for the Stop: topics of the current description, then topics of earlier descriptions."""
        return tuple(dict.fromkeys((self.robot.topics, *self.earlier_topics)))[:MAX_STOP_TOPICS]

    @cached_property
    def reply_topics(self) -> frozenset[str]:
        """Topics of the robot's replies."""
        return frozenset(topic_set.reply for topic_set in self.topic_sets)


@dataclass(eq=False)
class StopRequest:
    """Stop of one robot, and the replies of the programs that serve it.

    Attributes:
        error: Reason why the Stop could not be sent, or "".
        replies: Reply of each program that serves the robot, by node; None while pending. Empty until
            the programs are known.
        program_names: Names of the programs other than the robot's own, by node.
        foreign_replies: Undecoded replies of programs that, as far as known, do not serve the robot.
        delivered_topics: Topics on which the command was sent while the robot was connected.
        delivered_s: Time of the first of these messages (monotonic seconds).
        is_over: True after the report; later replies are late.
    """

    target: StopTarget
    id: str
    sent_s: float
    error: str = ""
    replies: dict[str, RobotStop | None] = field(default_factory=dict)
    program_names: dict[str, str] = field(default_factory=dict)
    foreign_replies: dict[str, PendingMessages] = field(default_factory=dict)
    delivered_topics: set[RobotTopics] = field(default_factory=set)
    delivered_s: float | None = None
    is_over: bool = False

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.target.robot.name

    @property
    def is_settled(self) -> bool:
        """True if no further reply is awaited."""
        return bool(self.error) or self.has_all_replies

    @property
    def has_all_replies(self) -> bool:
        """True if all programs have replied."""
        return bool(self.replies) and None not in self.replies.values()

    @property
    def is_confirmed(self) -> bool:
        """True if all programs have confirmed that the robot has stopped."""
        return bool(self.replies) and all(each and each.is_confirmed for each in self.replies.values())

    @property
    def is_proven(self) -> bool:
        """True if all programs that can confirm the Stop have done so, and at least one can."""
        can_confirm = [each for each in self.replies.values() if each is None or each.can_confirm]
        return bool(can_confirm) and all(each is not None and each.is_confirmed for each in can_confirm)

    @property
    def is_refused(self) -> bool:
        """True if a program reported that the robot has not stopped."""
        return any(each is not None and each.has_failed for each in self.replies.values())

    @property
    def needs_programs(self) -> bool:
        """True while the robot's own program is unknown."""
        return not self.replies or _UNKNOWN_PROGRAM in self.replies

    def record_sent(self, topics: RobotTopics, now: float) -> None:
        """Record that the robot was connected when the command was sent on its command topic.

        Args:
            topics: Topics of the robot.
            now: Current time in seconds.
        """
        self.delivered_topics.add(topics)
        if self.delivered_s is None:
            self.delivered_s = now

    def update_programs(self, view: GraphView, now: float, own_node: str = "") -> list[RobotStop]:
        """Add the programs that serve the robot according to a graph; they received the Stop too.

        Replies that arrived before the graph listed their program are applied, and their results returned.

        Args:
            view: Graph queried after the Stop was sent.
            now: Current time in seconds.
            own_node: Id of the client's own node, which never replies.
        """
        programs = self._serving_programs(view, own_node)
        for node, reply in self.replies.items():
            is_new_server = reply is not None and not reply.can_confirm and programs.get(node, reply) is None
            if node != _UNKNOWN_PROGRAM and not is_new_server:
                programs[node] = reply
        self.replies = programs
        results = [
            self.receive(node, message, now)
            for node in list(self.foreign_replies)
            if node in programs
            for message in self.foreign_replies.pop(node).pop_all()
        ]
        return [result for result in results if result is not None]

    def _serving_programs(self, view: GraphView, own_node: str) -> dict[str, RobotStop | None]:
        # The programs that must reply, by node: the robot's own, then others that serve it. Programs that
        # receive its commands but can't reply are named.
        target = self.target
        if not target.dialect.is_identified:
            # Such a robot never replies; a robot that could not be reached is not among them.
            return {} if self.error else {"": RobotStop(self.name, False, None, can_confirm=False)}
        identity = target.identity or first_announcer(view, target.robot.topics.description)
        robot_node = identity.node_id if identity is not None else _UNKNOWN_PROGRAM
        replies: dict[str, RobotStop | None] = {robot_node: None}
        replying_nodes = {
            node for topic_set in target.topic_sets for node in publisher_nodes(view, topic_set.reply)
        }
        receivers = dict.fromkeys(
            node for topic_set in target.topic_sets for node in subscriber_nodes(view, topic_set.command)
        )
        other_nodes = [node for node in receivers if node not in (robot_node, own_node)]
        for node in [node for node in other_nodes if node in replying_nodes][:MAX_SERVING_PROGRAMS]:
            self.program_names[node] = identity_of(view, node).node or node
            replies[node] = None
        earlier_nodes = {earlier.node_id for earlier in target.earlier_programs}  # required in any case
        listening_nodes = [node for node in other_nodes if node not in replying_nodes | earlier_nodes]
        programs = [identity_of(view, node).node or node for node in listening_nodes[:MAX_NAMED_LISTENERS]]
        if len(listening_nodes) > MAX_NAMED_LISTENERS:
            programs = [
                ngettext("{count} program", "{count} programs", len(listening_nodes)).format(
                    count=len(listening_nodes)
                )
            ]
        for node, program in zip(listening_nodes, programs, strict=False):
            replies[node] = RobotStop(self.name, False, None, can_confirm=False, program=program)
        for earlier in target.earlier_programs:
            if earlier.node_id not in replies:
                self.program_names[earlier.node_id] = earlier.node or earlier.node_id
                replies[earlier.node_id] = None
        return replies

    def receive(self, node: str, message: Message, now: float) -> RobotStop | None:
        """Apply a message on a reply topic; return the new result of its program, or None if none changed.

        A refusal may be followed by a confirmation; any other reply is final. Messages of programs that do
        not serve the robot are stored without decoding them.

        Args:
            node: Id of the node that sent the message.
            message: Message on a reply topic.
            now: Monotonic seconds.
        """
        if node not in self.replies:
            if node in self.foreign_replies or len(self.foreign_replies) < MAX_SERVING_PROGRAMS:
                self.foreign_replies.setdefault(
                    node, PendingMessages(per_publisher=_MAX_FOREIGN_REPLIES, publishers=1)
                ).add(message)
            return None
        reply = self._parse(message)
        if reply is None or reply.state not in ("succeeded", "failed"):
            return None
        previous, has_stopped = self.replies[node], reply.state == "succeeded"
        if previous is not None and previous.can_confirm and (previous.is_confirmed or not has_stopped):
            return None
        waited_ms = 0.0 if self.delivered_s is None else (self.delivered_s - self.sent_s) * 1000
        result = self.replies[node] = RobotStop(
            self.name,
            has_stopped,
            (now - self.sent_s) * 1000,
            error="" if has_stopped else stop_error_text(self.name, reply.fields.get("error")),
            has_failed=not has_stopped,
            program=self.program_names.get(node, ""),
            node=node,
            waited_ms=waited_ms if waited_ms > MIN_DISPLAYED_WAIT_MS else 0.0,
        )
        return result

    def _parse(self, message: Message) -> RobotReply | None:
        # None unless the message is a reply to this Stop.
        if message.size_bytes > MAX_STOP_REPLY_BYTES:
            return None
        try:
            reply = self.target.dialect.read(message.payload)
        except (NepError, RecursionError):
            return None
        return reply if reply is not None and reply.op == "stop" and reply.id == self.id else None

    def new_replies(self, reported: set[tuple[str, str]]) -> list[tuple[str, RobotStop]]:
        """Return new replies as pairs of node and result.

        Args:
            reported: Pairs of Stop id and node whose replies have already been reported.
        """
        replies, is_waiting = self.replies.items(), None in self.replies.values()
        unreported = [
            (node, each) for node, each in replies if each is not None and (self.id, node) not in reported
        ]
        return [(node, replace(each, is_waiting=is_waiting)) for node, each in unreported]

    def results(self, connection_problem: str = "") -> list[RobotStop]:
        """Return the result of each program. Programs without a reply are unproven.

        Args:
            connection_problem: Reason why the robot can't have received the Stop, or "".
        """
        no_reply = RobotStop(
            self.name,
            False,
            None,
            error=self.error or connection_problem,
            is_pending=bool(connection_problem),
        )
        if not self.replies:
            return [no_reply]
        return [
            each or replace(no_reply, program=self.program_names.get(node, ""))
            for node, each in self.replies.items()
        ]

    def impostors(self) -> list[str]:
        """Return the nodes that replied to this Stop although they do not serve the robot.

        Clears the `foreign_replies`.
        """
        return [
            node
            for node, pending in self.foreign_replies.items()
            if any(self._parse(message) is not None for message in pending.pop_all())
        ]


class PendingStops:
    """Stops that programs may still reply to. Performs no I/O; not thread-safe.

    Args:
        own_node: Id of the client's own node.
    """

    def __init__(self, own_node: str = "") -> None:
        self._own_node = own_node
        self._requests: dict[str, StopRequest] = {}
        self._ids: dict[str, None] = {}

    @property
    def requests(self) -> Sequence[StopRequest]:
        """Stops in order of their start, including those that wait for late replies."""
        return tuple(self._requests.values())

    def is_own(self, id: str) -> bool:
        """Return True if a Stop with this id was started here, also if it is not pending any more."""
        return id in self._ids

    def start(self, target: StopTarget, view: GraphView | None, now: float) -> StopRequest:
        """Start a Stop; the caller sends its command (`ClientDialect.stop`) with the id of the request.

        Args:
            target: Robot to stop.
            view: Newest graph, or None if there is none yet.
            now: Time in monotonic seconds.
        """
        self._evict_expired(now)
        request = StopRequest(target, new_id("stop"), now)
        self._requests[request.id] = request
        self._ids[request.id] = None
        if len(self._ids) > MAX_STOP_IDS:
            del self._ids[next(iter(self._ids))]
        if view is not None and target.dialect.is_identified:
            request.update_programs(view, now, self._own_node)
        return request

    def update(
        self, view: GraphView, now: float, requests: Iterable[StopRequest] | None = None
    ) -> list[tuple[StopRequest, RobotStop]]:
        """Add the programs of a graph that was queried after the Stops were sent.

        Args:
            view: Graph.
            now: Time in monotonic seconds.
            requests: Pending Stops. Default: those whose robot's program is unknown.

        Returns:
            Results that changed, because replies of the programs had arrived before.
        """
        if requests is None:
            pending = self._requests.values()
            requests = [each for each in pending if each.target.dialect.is_identified and each.needs_programs]
        return [
            (request, result)
            for request in requests
            for result in request.update_programs(view, now, self._own_node)
        ]

    def is_awaited(self, message: Message) -> bool:
        """Return True if a message may be a reply to a pending Stop."""
        return message.size_bytes <= MAX_STOP_REPLY_BYTES and any(
            message.topic in request.target.reply_topics for request in self._requests.values()
        )

    def receive(self, node: str, message: Message, now: float) -> list[tuple[StopRequest, RobotStop]]:
        """Apply a message on a reply topic; return the results that changed.

        Args:
            node: Id of the node that sent the message.
            message: Message.
            now: Time in monotonic seconds.
        """
        return [
            (request, result)
            for request in self._requests.values()
            if message.topic in request.target.reply_topics
            and (result := request.receive(node, message, now)) is not None
        ]

    def discard(self, names: Iterable[str] | None = None) -> None:
        """Discard Stops that wait for late replies only.

        Args:
            names: Names of the robots; None to discard all Stops of all robots.
        """
        if names is None:
            self._requests.clear()
            return
        discarded = set(names)
        self._requests = {
            id: request
            for id, request in self._requests.items()
            if not request.is_over or request.name not in discarded
        }

    def late_requests(self, now: float) -> list[StopRequest]:
        """Return the Stops that are over and whose late replies are still accepted."""
        return [
            request
            for request in self._requests.values()
            if request.is_over and now - request.sent_s <= LATE_REPLY_TIMEOUT_S
        ]

    def _evict_expired(self, now: float) -> None:
        ended_ids = [id for id, request in self._requests.items() if request.is_over]
        for index, id in enumerate(ended_ids):
            request = self._requests[id]
            if (
                request.is_confirmed
                or index < len(ended_ids) - MAX_LATE_STOPS
                or now - request.sent_s > LATE_REPLY_TIMEOUT_S
            ):
                del self._requests[id]


def unproven_robots(requests: Iterable[StopRequest]) -> Mapping[str, StopRequest]:
    """Return the robots whose newest Stop is not proven, with this Stop.

    Args:
        requests: Stops in order of their start.
    """
    newest = {request.name: request for request in requests}
    return {name: request for name, request in newest.items() if not request.is_proven}
