"""Proven Stop: each robot receives the command, and its own program confirms or the robot is reported.

Publishers are opened in advance, because connecting at the moment of a Stop may take too long. A failed
connection is retried; until it succeeds, the robot is reported.
"""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial

from app.core.faults import error_text
from app.core.robots.stop.channels import StopChannel, StopLine, StopNode, StopTarget
from app.core.robots.stop.report import RobotStop, StopReport
from app.core.robots.stop.request import StopRequest
from app.robots import rize
from app.robots.description.description import Robot, RobotTopics
from app.robots.identity import (
    Senders,
    first_announcer,
    identity_of,
    publisher_nodes,
    stop_error_text,
    subscriber_nodes,
)
from app.robots.message_buffer import PendingMessages
from nep.errors import NepError
from nep.i18n import _, lazy, ngettext
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

_log = logging.getLogger("studio")
RIZE = "rize"
NO_NETWORK = lazy("there is no connection to the network yet")
LATE_REPLY_TIMEOUT_S = 120.0
"""Time in seconds after a Stop during which late replies are accepted."""
MAX_LATE_REQUESTS = 64
MAX_SERVING_PROGRAMS = 32
"""Maximum number of programs of one robot whose replies are awaited."""
MAX_NAMED_LISTENERS = 4
"""Maximum number of programs that only subscribe to a robot's commands and are included in a report."""
POLL_INTERVAL_S = 0.02
"""Interval in seconds at which the state of a connection is checked."""
GRAPH_POLL_INTERVAL_S = 0.1
"""Minimum interval in seconds between graph queries while the publisher of a reply is unknown."""
GRAPH_TIMEOUT_S = 0.3
_UNKNOWN_PROGRAM = "nobody"
"""Placeholder for the program of a robot that the graph does not list yet."""

STOP_TIMEOUT_S = 1.0
"""Default time limit of a Stop in seconds. A robot's description may require a longer time."""
TIMEOUT_MARGIN_S = 0.5
MAX_STOP_TIMEOUT_S = 10.0


def stop_timeout_s(robots: Iterable[Robot], max_timeout_s: float = MAX_STOP_TIMEOUT_S) -> float:
    """Return the time limit in seconds for a Stop, which exceeds the time limits of the robots' drivers.

    Args:
        robots: Robots to stop.
        max_timeout_s: Maximum of the result.
    """
    needed_s = max((robot.safe_stop.within_s + TIMEOUT_MARGIN_S for robot in robots), default=0.0)
    return min(max_timeout_s, max(STOP_TIMEOUT_S, needed_s))


class RobotStopper:
    """Connections to all robots, used to stop them. Thread-safe."""

    def __init__(
        self,
        node: StopNode,
        clock: Callable[[], float] = time.monotonic,
        max_timeout_s: float = MAX_STOP_TIMEOUT_S,
    ) -> None:
        # `max_timeout_s` limits the wait for replies. Robots are added by `set_robots`.
        self._max_timeout_s = max_timeout_s
        self._node = node
        self._clock = clock
        self._sender = f"stopper-{uuid.uuid4().hex[:8]}"
        self._changed = threading.Condition()
        self._opening_lock = threading.Lock()  # held while opening connections
        self._opener_threads: list[threading.Thread] = []
        self._lines: dict[str, StopLine] = {}
        self._requests: dict[str, StopRequest] = {}
        self._view: GraphView | None = None
        self._subscribed_nodes: dict[
            str, frozenset[str]
        ] = {}  # subscribed nodes by command topic, of this view
        self._graph_queried_s = 0.0
        self._senders = Senders()

    def update_graph(self, view: GraphView) -> None:
        """Apply a new graph, which determines the programs that serve each robot and must confirm a Stop."""
        with self._changed:
            self._view, self._subscribed_nodes = view, {}
            targets = [line.target for line in self._lines.values()]
            self._senders.update(
                view, {topic_set.reply for target in targets for topic_set in target.topic_sets}
            )
            late_replies = [
                reply
                for request in self._requests.values()
                for reply in self._apply_held_replies_locked(request)
            ]
            self._changed.notify_all()
        for notify, reply in late_replies:
            notify(reply)

    def set_expected(self, targets: Iterable[StopTarget]) -> None:
        """Set the robots to stop without connecting to new ones, so that this doesn't block.

        `set_robots` connects; a Stop waits for that.
        """
        with self._changed:
            for target in targets:
                self._lines.setdefault(target.robot.name, StopLine(target)).target = target

    def set_robots(self, robots: Iterable[Robot | StopTarget]) -> None:
        """Connect to these robots and disconnect from all others.

        Failed connections are listed in `problems` and retried at the next call.
        """
        targets = (each if isinstance(each, StopTarget) else StopTarget(each) for each in robots)
        targets_by_name = {target.robot.name: target for target in targets}
        removed: list[StopChannel] = []
        with self._changed:
            for name in self._lines.keys() - targets_by_name.keys():
                removed += self._lines.pop(name).channels.values()
            for name, target in targets_by_name.items():
                line = self._lines.setdefault(name, StopLine(target))
                removed += [
                    line.channels.pop(topics) for topics in line.channels.keys() - set(target.topic_sets)
                ]
                line.target = target
            lines = list(self._lines.values())
        for channel in removed:
            channel.close()
        with self._opening_lock:
            for line in lines:
                self._open_missing_channels(line)
        with self._changed:
            view = self._view
        if view is not None:
            self.update_graph(view)

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots whose replies are awaited and to which all connections are open."""
        with self._changed:
            lines = [line for line in self._lines.values() if line.target.is_expected and line.is_complete]
            return tuple(line.name for line in lines)

    def is_reachable(self, name: str) -> bool:
        """Return True if the robot's program is connected, so that a Stop sent now would arrive."""
        with self._changed:
            line = self._lines.get(name)
            channel = None if line is None else line.channels.get(line.target.robot.topics)
            return line is not None and channel is not None and self._is_connected_locked(line, channel)

    def deliver(self) -> None:
        """Send pending Stops to robots that have been connected since. Called at each tick.

        A Stop is pending for at most `LATE_REPLY_TIMEOUT_S` seconds.
        """
        with self._changed:
            now = self._clock()
            pending_requests = [
                request
                for request in self._requests.values()
                if request.is_over and now - request.sent_s <= LATE_REPLY_TIMEOUT_S
            ]
        for request in pending_requests:
            self._deliver(request)

    def discard_late(self, names: Iterable[str]) -> None:
        """Discard pending Stops of robots that have stopped according to the user."""
        stopped_names = set(names)
        with self._changed:
            for id in [
                id for id, each in self._requests.items() if each.is_over and each.line.name in stopped_names
            ]:
                del self._requests[id]

    @property
    def problems(self) -> Mapping[str, str]:
        """Reason why a robot can't be stopped, by the robot's name."""
        with self._changed:
            lines = [line for line in self._lines.values() if line.error and line.target.is_expected]
            return {line.name: line.error for line in lines}

    def send_stop(self, names: Iterable[str] | None = None, program_key: str | None = None) -> None:
        """Send a Stop without waiting for replies.

        Robots that don't support ``program_key`` (RIZE) need another Stop after the program has ended.

        Args:
            names: Names of the robots; None for all robots whose replies are awaited.
            program_key: Key of a program (`app.robots.identity`) whose further commands the robots reject.
        """
        for line in self._select_lines(names):
            self._send(line, _new_id(), program_key)

    def stop_all(
        self,
        names: Iterable[str] | None = None,
        timeout_s: float | None = None,
        on_answer: Callable[[RobotStop], object] | None = None,
        program_key: str | None = None,
        on_late: Callable[[RobotStop], object] | None = None,
        is_for_all: bool = False,
    ) -> StopReport:
        """Stop robots and wait until each has replied or timed out.

        Args:
            names: Names of the robots; None for all whose replies are awaited. Robots that can't be
                reached are included in the report.
            timeout_s: Maximum time to wait in seconds. Default: the time that the descriptions require,
                at least one second.
            on_answer: Called in this thread for each reply, and at the end for each robot without a
                reply.
            program_key: Key of a program whose further commands the robots reject (see `send_stop`).
            on_late: Called in another thread (of the node or of `update_graph`) when a robot replies
                after the timeout, or confirms the Stop after that.
            is_for_all: True to send the Stop to robots whose reply is not awaited as well.

        Returns:
            Results of all robots.
        """
        names = None if names is None else tuple(names)
        start_time_s = self._clock()
        lines = self._select_lines(names)
        requests = [self._start_request(line, program_key, on_late) for line in lines]
        if is_for_all:
            for line in self._unexpected_lines():
                self._send(line, _new_id(), program_key)
        self._retry_missing_channels(requests)
        if timeout_s is None:
            timeout_s = stop_timeout_s((line.target.robot for line in lines), self._max_timeout_s)
        if requests:
            self._add_new_programs(requests)
        reported = self._wait_for_replies(requests, start_time_s + timeout_s, on_answer)
        elapsed_ms = (self._clock() - start_time_s) * 1000
        return self._create_report(requests, reported, elapsed_ms, on_answer).with_unreached(names or ())

    def _wait_for_replies(
        self,
        requests: Sequence[StopRequest],
        deadline_s: float,
        on_answer: Callable[[RobotStop], object] | None,
    ) -> set[tuple[str, str]]:
        # Waits until all requests are settled, or the deadline; returns the reported (request, node) pairs.
        reported: set[tuple[str, str]] = set()
        while True:
            self._query_graph_if_needed(requests)
            undelivered = [request for request in requests if not self._deliver(request)]
            with self._changed:
                remaining_s = deadline_s - self._clock()
                pause_s = (
                    min(remaining_s, GRAPH_POLL_INTERVAL_S)
                    if any(request.unknown_replies for request in requests)
                    else remaining_s
                )
                pause_s = min(pause_s, POLL_INTERVAL_S) if undelivered else pause_s
                self._changed.wait_for(lambda: self._has_new_replies(requests, reported), max(0.0, pause_s))
                new_results = [
                    (request, node, result)
                    for request in requests
                    for node, result in request.new_replies(reported)
                ]
            for request, node, result in new_results:
                reported.add((request.id, node))
                if on_answer is not None:
                    on_answer(result)
            if all(request.is_settled for request in requests) or self._clock() >= deadline_s:
                return reported

    def close(self) -> None:
        """Disconnect from all robots without stopping them."""
        self.set_robots(())
        for thread in self._opener_threads:
            thread.join(timeout=5)
        with self._changed:
            self._requests.clear()

    # ---- connections

    def _open_missing_channels(self, line: StopLine) -> None:
        # Opens missing connections; a failure becomes the line's error. Call with `_opening_lock` held.
        error = ""
        for topics in line.target.topic_sets:
            with self._changed:
                is_open = topics in line.channels or self._lines.get(line.name) is not line
            if is_open:
                continue
            try:
                channel = self._connect(line.target.robot, topics)
            except NepError as failure:
                error = f"{failure}"
                continue
            with self._changed:
                is_needed = self._lines.get(line.name) is line and topics in line.target.topic_sets
                if is_needed:
                    line.channels[topics] = channel
            if not is_needed:
                channel.close()
        with self._changed:
            line.error = error

    def _connect(self, robot: Robot, topics: RobotTopics) -> StopChannel:
        if robot.dialect == RIZE:
            return StopChannel(topics.command, self._node.new_pub(topics.command, "json", batch=False), None)
        publisher = self._node.new_pub(topics.command, "robot/command", batch=False)
        try:
            subscriber = self._node.new_sub(topics.reply, "robot/answer", sink=self._on_replies)
            return StopChannel(topics.command, publisher, subscriber)
        except NepError:
            publisher.close()
            raise

    def _retry_missing_channels(self, requests: Sequence[StopRequest]) -> None:
        # Retries failed connections in a thread, so that the Stop of other robots is not delayed.
        incomplete_requests = [request for request in requests if not request.line.is_complete]
        if not incomplete_requests:
            return

        def open_channels() -> None:
            for request in incomplete_requests:
                previous_topics = set(request.line.channels)
                with self._opening_lock:
                    self._open_missing_channels(request.line)
                new_topics = request.line.channels.keys() - previous_topics
                error = (
                    self._send(request.line, request.id, request.program_key, new_topics)
                    if new_topics
                    else request.line.send_problem
                )
                with self._changed:
                    request.error = error if not previous_topics else request.error
                    self._changed.notify_all()

        for request in incomplete_requests:
            request.error = "" if not request.line.channels else request.error
        self._opener_threads = [thread for thread in self._opener_threads if thread.is_alive()]
        self._opener_threads.append(
            threading.Thread(target=open_channels, name="studio-stop-line", daemon=True)
        )
        self._opener_threads[-1].start()

    def _select_lines(self, names: Iterable[str] | None) -> list[StopLine]:
        with self._changed:
            if names is None:
                return [line for line in self._lines.values() if line.target.is_expected]
            return [self._lines[name] for name in dict.fromkeys(names) if name in self._lines]

    def _start_request(
        self, line: StopLine, program_key: str | None, on_late: Callable[[RobotStop], object] | None
    ) -> StopRequest:
        request = StopRequest(line, _new_id(), self._clock(), on_late, program_key)
        with self._changed:
            self._evict_expired()
            self._requests[request.id] = request
            if self._view is not None and line.target.robot.dialect != RIZE:
                request.replies |= self._serving_programs(request)
            for topics, channel in line.channels.items():
                if self._is_connected_locked(line, channel):
                    request.record_sent(topics, request.sent_s)
        request.error = self._send(line, request.id, program_key)
        return request

    def _unexpected_lines(self) -> list[StopLine]:
        with self._changed:
            return [line for line in self._lines.values() if not line.target.is_expected]

    def _is_connected_locked(self, line: StopLine, channel: StopChannel) -> bool:
        # Call with `_changed` held.
        subscribed_nodes = self._subscribed_nodes.get(channel.topic)
        if subscribed_nodes is None:
            subscribed_nodes = frozenset(subscriber_nodes(self._view or GraphView(0, 0), channel.topic))
            self._subscribed_nodes[channel.topic] = subscribed_nodes
        return channel.is_connected(line.target, subscribed_nodes)

    def _deliver(self, request: StopRequest) -> bool:
        # Sends the command on newly connected topics; returns whether nothing is left to deliver.
        with self._changed:
            if request.has_all_replies or request.line.target.robot.dialect == RIZE:
                return True
            channels = dict(request.line.channels)
            new_topics = [
                topics
                for topics, channel in channels.items()
                if topics not in request.delivered_topics and self._is_connected_locked(request.line, channel)
            ]
            for topics in new_topics:
                request.record_sent(topics, self._clock())
        if new_topics:
            self._send(request.line, request.id, request.program_key, new_topics)
        return bool(request.delivered_topics or request.error)

    def _send(
        self,
        line: StopLine,
        id: str,
        program_key: str | None,
        topic_sets: Iterable[RobotTopics] | None = None,
    ) -> str:
        # Returns the reason if the Stop could be sent on no topic, else an empty string.
        robot = line.target.robot
        stop_action = robot.safe_stop.action
        if robot.dialect == RIZE:
            command = rize.to_command(robot, stop_action, {}, id)
        else:
            command = {"id": id, "op": "stop", "from": self._sender, "action": stop_action, "input": {}}
            if program_key is not None:
                command["ends"] = program_key
        with self._changed:
            channels = [
                channel
                for topics, channel in line.channels.items()
                if topic_sets is None or topics in topic_sets
            ]
        is_sent, error = False, line.send_problem
        for channel in channels:
            try:
                channel.publisher.publish(command)
                is_sent = True
            except NepError as failure:
                error = _("Stop can't be sent to {robot}: {why}").format(robot=robot.name, why=failure)
        return "" if is_sent else error

    # ---- replies

    def _has_new_replies(self, requests: Sequence[StopRequest], reported: set[tuple[str, str]]) -> bool:
        if any(each.new_replies(reported) for each in requests) or all(each.is_settled for each in requests):
            return True
        return (
            any(each.unknown_replies for each in requests)
            and self._clock() - self._graph_queried_s >= GRAPH_POLL_INTERVAL_S
        )

    def _query_graph_if_needed(self, requests: Sequence[StopRequest]) -> None:
        # Queries the graph while the programs of a robot or the publisher of a reply are unknown.
        with self._changed:
            is_waiting = self._view is None or any(request.unknown_replies for request in requests)
            now = self._clock()
            is_due = is_waiting and (
                self._view is None or now - self._graph_queried_s >= GRAPH_POLL_INTERVAL_S
            )
            if is_due:
                self._graph_queried_s = now
        if is_due:
            self._refresh_view()
        with self._changed:
            for request in requests:
                if not request.replies:
                    request.replies |= self._serving_programs(request)
                    self._apply_held_replies_locked(request)  # not late: the Stop was sent just now

    def _add_new_programs(self, requests: Sequence[StopRequest]) -> None:
        # Programs newer than the last graph received the Stop too.
        self._refresh_view()
        with self._changed:
            for request in requests:
                known_replies = {
                    node: reply for node, reply in request.replies.items() if node != _UNKNOWN_PROGRAM
                }
                request.replies = self._serving_programs(request) | known_replies

    def _refresh_view(self) -> None:
        # Without a reply of the master the previous graph stays valid.
        with suppress(NepError):
            self.update_graph(self._node.graph(GRAPH_TIMEOUT_S))

    def _serving_programs(self, request: StopRequest) -> dict[str, RobotStop | None]:
        # The programs that must reply, by node: the robot's own, then others that serve it. Programs that
        # receive its commands but can't reply are named.
        target, view = request.line.target, self._view or GraphView(0, 0)
        if target.robot.dialect == RIZE:
            # RIZE never replies; a robot that could not be reached is not among them.
            return {} if request.error else {"": RobotStop(request.line.name, False, None, can_confirm=False)}
        identity = target.identity or first_announcer(view, target.robot.topics.description)
        own_node = identity.node_id if identity is not None else _UNKNOWN_PROGRAM
        replies: dict[str, RobotStop | None] = {own_node: None}
        replying_nodes = {
            node for topic_set in target.topic_sets for node in publisher_nodes(view, topic_set.reply)
        }
        receivers = dict.fromkeys(
            node for topic_set in target.topic_sets for node in subscriber_nodes(view, topic_set.command)
        )
        other_nodes = [node for node in receivers if node not in (own_node, self._node.id)]
        for node in [node for node in other_nodes if node in replying_nodes][:MAX_SERVING_PROGRAMS]:
            request.program_names[node] = identity_of(view, node).node or node
            replies[node] = None
        listening_nodes = [node for node in other_nodes if node not in replying_nodes]
        programs = [identity_of(view, node).node or node for node in listening_nodes[:MAX_NAMED_LISTENERS]]
        if len(listening_nodes) > MAX_NAMED_LISTENERS:
            programs = [
                ngettext("{count} program", "{count} programs", len(listening_nodes)).format(
                    count=len(listening_nodes)
                )
            ]
        for node, program in zip(listening_nodes, programs, strict=False):
            replies[node] = RobotStop(target.robot.name, False, None, can_confirm=False, program=program)
        for earlier in target.earlier_programs:
            if earlier.node_id not in replies:
                request.program_names[earlier.node_id] = earlier.node or earlier.node_id
                replies[earlier.node_id] = None
        return replies

    def _on_replies(self, messages: Sequence[Message]) -> None:
        # Checks the sender first: only messages of programs that must answer are decoded.
        late_replies: list[tuple[Callable[[RobotStop], object], RobotStop]] = []
        with self._changed:
            for message in messages:
                node = self._senders.node_of(message)
                for request in self._requests.values():
                    if message.topic in request.line.reply_topics:
                        late_replies += self._apply_reply_locked(request, node, message)
            self._changed.notify_all()
        for notify, result in late_replies:
            notify(result)

    def _apply_held_replies_locked(
        self, request: StopRequest
    ) -> list[tuple[Callable[[RobotStop], object], RobotStop]]:
        # Processes held replies whose publishers are known now; returns late ones with their callbacks, which
        # the caller invokes after releasing the lock. Replies that are still unknown are discarded: their
        # publisher has not registered, or the master is missing, and then nothing can be proven.
        pending = request.unknown_replies.pop_all()
        attributed = [
            (node, message) for message in pending if (node := self._senders.node_of(message)) is not None
        ]
        return [
            late_reply
            for node, message in attributed
            for late_reply in self._apply_reply_locked(request, node, message)
        ]

    def _apply_reply_locked(
        self, request: StopRequest, node: str | None, message: Message
    ) -> list[tuple[Callable[[RobotStop], object], RobotStop]]:
        # Applies a reply of a program that must reply; returns the callback if it is late.
        if node is None or not request.replies:
            request.unknown_replies.add(message)
            return []
        if node not in request.replies:
            if node in request.foreign_replies or len(request.foreign_replies) < MAX_SERVING_PROGRAMS:
                request.foreign_replies.setdefault(node, PendingMessages(publishers=1)).add(message)
            return []
        name = request.line.name
        has_changed = request.accept(node, message, self._clock(), partial(stop_error_text, name))
        reply = request.replies[node]
        if not has_changed or reply is None or not request.is_over or request.on_late is None:
            return []
        return [(request.on_late, reply)]

    def _create_report(
        self,
        requests: Sequence[StopRequest],
        reported: set[tuple[str, str]],
        elapsed_ms: float,
        on_answer: Callable[[RobotStop], object] | None,
    ) -> StopReport:
        with self._changed:
            for request in requests:
                request.is_over = True
            results = [result for request in requests for result in request.results()]
            unreported = [
                result
                for request in requests
                for node, result in zip(request.replies or {"": None}, request.results(), strict=True)
                if (request.id, node) not in reported
            ]
            view = self._view or GraphView(0, 0)
            impostors = [
                (request.line.name, identity_of(view, node).node or node)
                for request in requests
                for node in request.impostors()
            ]
        for result in unreported:
            if on_answer is not None:
                on_answer(result)
        return StopReport(tuple(results), elapsed_ms, tuple(dict.fromkeys(impostors)))

    def _evict_expired(self) -> None:
        # Discards Stops whose late replies are no longer accepted.
        now = self._clock()
        ended_ids = [id for id, each in self._requests.items() if each.is_over]
        for index, id in enumerate(ended_ids):
            each = self._requests[id]
            if (
                each.is_confirmed
                or index < len(ended_ids) - MAX_LATE_REQUESTS
                or now - each.sent_s > LATE_REPLY_TIMEOUT_S
            ):
                del self._requests[id]


def _new_id() -> str:
    return f"stop-{uuid.uuid4().hex[:12]}"


def stop_and_report(
    stopper: RobotStopper | None,
    names: tuple[str, ...],
    *,
    on_late: Callable[[RobotStop], object],
    on_answer: Callable[[RobotStop], object] | None = None,
    program_key: str | None = None,
    is_for_all: bool = False,
) -> StopReport:
    """Stop robots and return a report, even after an unexpected error.

    Without a report, the run would remain in the state "stopping".

    Args:
        stopper: Connections to the robots; None if there are none.
        names: Names of the robots.
        on_late: See `RobotStopper.stop_all`.
        on_answer: See `RobotStopper.stop_all`.
        program_key: See `RobotStopper.stop_all`.
        is_for_all: See `RobotStopper.stop_all`.
    """
    reason = _(NO_NETWORK)
    if stopper is not None:
        try:
            return stopper.stop_all(
                names, on_answer=on_answer, program_key=program_key, on_late=on_late, is_for_all=is_for_all
            )
        except Exception as error:  # noqa: BLE001 - reported as unproven for these robots
            _log.exception("can't stop the robots")
            reason = error_text(error)
    return StopReport((), 0.0).with_unreached(names, reason)
