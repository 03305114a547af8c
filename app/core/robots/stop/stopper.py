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
from dataclasses import dataclass

from app.core.faults import error_text
from app.core.robots.stop.channels import StopChannel, StopLine, StopNode
from app.robots.client import limits
from app.robots.client.dialects import dialect_of, new_id
from app.robots.client.inbox import ReplyInbox, Senders
from app.robots.client.stop import PendingStops, StopRequest, StopTarget
from app.robots.client.stop_report import RobotStop, StopReport
from app.robots.description.description import Robot, RobotTopics
from app.robots.identity import identity_of, subscriber_nodes
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

_log = logging.getLogger("studio")
NO_NETWORK = lazy("there is no connection to the network yet")

OnLate = Callable[[StopReport], object]
LateReplies = list[tuple[OnLate, StopReport]]


@dataclass(frozen=True)
class _Delivery:
    """Connections of a pending Stop.

    Attributes:
        on_late: Called with the results of all programs after each reply after the timeout, or None.
        program_key: Key of a program whose further commands the robot rejects, or None.
    """

    line: StopLine
    on_late: OnLate | None
    program_key: str | None


class RobotStopper:
    """Connections to all robots, used to stop them. Thread-safe."""

    def __init__(
        self,
        node: StopNode,
        clock: Callable[[], float] = time.monotonic,
        max_timeout_s: float | None = None,
    ) -> None:
        # `max_timeout_s` limits the wait for replies. Robots are added by `set_robots`.
        self._max_timeout_s = max_timeout_s
        self._node = node
        self._clock = clock
        self._sender = f"stopper-{uuid.uuid4().hex[:8]}"
        self._changed = threading.Condition()
        self._is_closed = False
        self._opening_lock = threading.Lock()  # held while opening connections
        self._opener_threads: list[threading.Thread] = []
        self._lines: dict[str, StopLine] = {}
        self._stops = PendingStops(node.id)
        self._deliveries: dict[str, _Delivery] = {}
        """Connections of each pending Stop, by its id."""
        self._view: GraphView | None = None
        self._subscribed_nodes: dict[
            str, frozenset[str]
        ] = {}  # subscribed nodes by command topic, of this view
        self._graph_queried_s = 0.0
        self._senders = Senders()
        self._inbox = ReplyInbox(self._senders)

    def update_graph(self, view: GraphView) -> None:
        """Apply a new graph, which determines the programs that serve each robot and must confirm a Stop."""
        with self._changed:
            self._view, self._subscribed_nodes = view, {}
            targets = [line.target for line in self._lines.values()]
            self._senders.update(
                view, {topic_set.reply for target in targets for topic_set in target.topic_sets}
            )
            now = self._clock()
            results = self._stops.update(view, now)
            for node, message in self._inbox.pop_listed():
                results += self._stops.receive(node, message, now)
            late_replies = self._late_replies_locked(results)
            self._changed.notify_all()
        for notify, report in late_replies:
            notify(report)

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
            late_requests = self._stops.late_requests(self._clock())
        for request in late_requests:
            self._deliver(request)

    def discard_late(self, names: Iterable[str]) -> None:
        """Discard pending Stops of robots that have stopped according to the user."""
        with self._changed:
            self._stops.discard(names)

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
            self._send(line, new_id("stop"), program_key)

    def stop_all(
        self,
        names: Iterable[str] | None = None,
        timeout_s: float | None = None,
        on_answer: Callable[[RobotStop], object] | None = None,
        program_key: str | None = None,
        on_late: OnLate | None = None,
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
            on_late: Called in another thread (of the node or of `update_graph`) with the results of all
                programs of a robot when one of them replies after the timeout, or confirms the Stop after
                that.
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
                self._send(line, new_id("stop"), program_key)
        self._retry_missing_channels(requests)
        if timeout_s is None:
            timeout_s = limits.stop_timeout_s((line.target.robot for line in lines), self._max_timeout_s)
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
            self._query_graph_if_needed()
            undelivered = [request for request in requests if not self._deliver(request)]
            with self._changed:
                remaining_s = deadline_s - self._clock()
                pause_s = min(remaining_s, limits.STOP_LOOKUP_INTERVAL_S) if self._inbox else remaining_s
                pause_s = min(pause_s, limits.CONNECTION_CHECK_INTERVAL_S) if undelivered else pause_s
                self._changed.wait_for(
                    lambda: self._is_closed or self._has_new_replies(requests, reported), max(0.0, pause_s)
                )
                new_results = [
                    (request, node, result)
                    for request in requests
                    for node, result in request.new_replies(reported)
                ]
            for request, node, result in new_results:
                reported.add((request.id, node))
                if on_answer is not None:
                    on_answer(result)
            is_over = self._is_closed or self._clock() >= deadline_s
            if is_over or all(request.is_settled for request in requests):
                return reported

    def close(self) -> None:
        """Disconnect from all robots without stopping them. Waits for replies end."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self.set_robots(())
        for thread in self._opener_threads:
            thread.join(timeout=5)
        with self._changed:
            self._stops.discard()
            self._deliveries.clear()

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
        dialect = dialect_of(robot)
        publisher = self._node.new_pub(topics.command, dialect.command_type, batch=False)
        if not dialect.is_identified:
            return StopChannel(topics.command, publisher, None)
        try:
            subscriber = self._node.new_sub(topics.reply, dialect.reply_type, sink=self._on_replies)
            return StopChannel(topics.command, publisher, subscriber)
        except NepError:
            publisher.close()
            raise

    def _retry_missing_channels(self, requests: Sequence[StopRequest]) -> None:
        # Retries failed connections in a thread, so that the Stop of other robots is not delayed.
        with self._changed:
            incomplete = [
                (request, delivery)
                for request in requests
                if (delivery := self._deliveries.get(request.id)) and not delivery.line.is_complete
            ]
        if not incomplete:
            return

        def open_channels() -> None:
            for request, delivery in incomplete:
                line = delivery.line
                previous_topics = set(line.channels)
                with self._opening_lock:
                    self._open_missing_channels(line)
                new_topics = line.channels.keys() - previous_topics
                error = (
                    self._send(line, request.id, delivery.program_key, new_topics)
                    if new_topics
                    else line.send_problem
                )
                with self._changed:
                    request.error = error if not previous_topics else request.error
                    self._changed.notify_all()

        for request, delivery in incomplete:
            request.error = "" if not delivery.line.channels else request.error
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

    def _start_request(self, line: StopLine, program_key: str | None, on_late: OnLate | None) -> StopRequest:
        with self._changed:
            request = self._stops.start(line.target, self._view, self._clock())
            pending_ids = {each.id for each in self._stops.requests}
            self._deliveries = {id: each for id, each in self._deliveries.items() if id in pending_ids}
            self._deliveries[request.id] = _Delivery(line, on_late, program_key)
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
            delivery = self._deliveries.get(request.id)
            if delivery is None or request.has_all_replies or not request.target.dialect.is_identified:
                return True
            new_topics = [
                topics
                for topics, channel in dict(delivery.line.channels).items()
                if topics not in request.delivered_topics
                and self._is_connected_locked(delivery.line, channel)
            ]
            for topics in new_topics:
                request.record_sent(topics, self._clock())
        if new_topics:
            self._send(delivery.line, request.id, delivery.program_key, new_topics)
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
        command = line.target.dialect.stop(robot, id, self._sender, program_key)
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
        return bool(self._inbox) and self._clock() - self._graph_queried_s >= limits.STOP_LOOKUP_INTERVAL_S

    def _query_graph_if_needed(self) -> None:
        # Queries the graph while there is none, or while the publisher of a reply is unknown.
        with self._changed:
            now = self._clock()
            is_due = self._view is None or (
                bool(self._inbox) and now - self._graph_queried_s >= limits.STOP_LOOKUP_INTERVAL_S
            )
            if is_due:
                self._graph_queried_s = now
        if is_due:
            self._refresh_view()

    def _add_new_programs(self, requests: Sequence[StopRequest]) -> None:
        # Programs newer than the last graph received the Stop too. Without any graph, only robots whose
        # programs can't be told apart are settled; the others wait for the first one.
        self._refresh_view()
        with self._changed:
            view = self._view
            if view is None:
                view = GraphView(0, 0)
                requests = [each for each in requests if not each.target.dialect.is_identified]
            self._stops.update(view, self._clock(), requests)

    def _refresh_view(self) -> None:
        # Without a reply of the master the previous graph stays valid.
        with suppress(NepError):
            self.update_graph(self._node.graph(limits.GRAPH_TIMEOUT_S))

    def _on_replies(self, messages: Sequence[Message]) -> None:
        # Checks the sender first: only messages of programs that must answer are decoded.
        results: list[tuple[StopRequest, RobotStop]] = []
        with self._changed:
            for message in messages:
                if not self._stops.is_awaited(message):
                    continue
                node = self._inbox.sender_of(message)
                if node is not None:
                    results += self._stops.receive(node, message, self._clock())
            late_replies = self._late_replies_locked(results)
            self._changed.notify_all()
        for notify, report in late_replies:
            notify(report)

    def _late_replies_locked(self, results: Sequence[tuple[StopRequest, RobotStop]]) -> LateReplies:
        # Returns late results with their callbacks, which the caller invokes after releasing the lock.
        late_requests = {request.id: (request, result) for request, result in results if request.is_over}
        late_replies: LateReplies = []
        for request, result in late_requests.values():
            delivery = self._deliveries.get(request.id)
            if delivery is not None and delivery.on_late is not None:
                report = StopReport(tuple(self._results_locked(request)), result.elapsed_ms or 0.0)
                late_replies.append((delivery.on_late, report))
        return late_replies

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
            results = {request.id: self._results_locked(request) for request in requests}
            unreported = [
                result
                for request in requests
                for node, result in zip(request.replies or {"": None}, results[request.id], strict=True)
                if (request.id, node) not in reported
            ]
            view = self._view or GraphView(0, 0)
            impostors = [
                (request.name, identity_of(view, node).node or node)
                for request in requests
                for node in request.impostors()
            ]
        for result in unreported:
            if on_answer is not None:
                on_answer(result)
        robots = tuple(result for each in results.values() for result in each)
        return StopReport(robots, elapsed_ms, tuple(dict.fromkeys(impostors)))

    def _results_locked(self, request: StopRequest) -> list[RobotStop]:
        delivery = self._deliveries.get(request.id)
        return request.results("" if delivery is None else delivery.line.connection_problem)


def stop_and_report(
    stopper: RobotStopper | None,
    names: tuple[str, ...],
    *,
    on_late: OnLate,
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
