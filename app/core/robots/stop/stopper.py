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
from app.core.robots.stop.lines import StopChannel, StopLine, StopNode, StopTarget
from app.core.robots.stop.report import RobotStop, StopReport
from app.core.robots.stop.request import StopRequest
from app.robots import rize
from app.robots.description.description import Robot, RobotTopics
from app.robots.held_messages import PendingMessages
from app.robots.identity import (
    Senders,
    first_announcer,
    identity_of,
    publisher_nodes,
    stop_error_text,
    subscriber_nodes,
)
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


def stop_timeout_s(robots: Iterable[Robot], longest_s: float = MAX_STOP_TIMEOUT_S) -> float:
    """Return the time limit in seconds for a Stop, which exceeds the time limits of the robots' drivers.

    Args:
        robots: Robots to stop.
        longest_s: Maximum of the result.
    """
    needed_s = max((robot.safe_stop.within_s + TIMEOUT_MARGIN_S for robot in robots), default=0.0)
    return min(longest_s, max(STOP_TIMEOUT_S, needed_s))


class RobotStopper:
    """Connections to all robots, used to stop them. Thread-safe."""

    def __init__(
        self,
        node: StopNode,
        clock: Callable[[], float] = time.monotonic,
        longest_s: float = MAX_STOP_TIMEOUT_S,
    ) -> None:
        # `longest_s` limits the wait for replies. Robots are added by `set_robots`.
        self._longest_s = longest_s
        self._node = node
        self._clock = clock
        self._sender = f"stopper-{uuid.uuid4().hex[:8]}"
        self._changed = threading.Condition()
        self._opening_lock = threading.Lock()  # held while opening connections
        self._openers: list[threading.Thread] = []
        self._lines: dict[str, StopLine] = {}
        self._asked: dict[str, StopRequest] = {}
        self._view: GraphView | None = None
        self._hearers: dict[str, frozenset[str]] = {}  # subscribed nodes by command topic, of this view
        self._graph_queried_s = 0.0
        self._senders = Senders()

    def update_graph(self, view: GraphView) -> None:
        """Apply a new graph, which determines the programs that serve each robot and must confirm a Stop."""
        with self._changed:
            self._view, self._hearers = view, {}
            targets = [line.target for line in self._lines.values()]
            self._senders.update(view, {way.reply for target in targets for way in target.topic_sets})
            late = [
                reply for asked in self._asked.values() for reply in self._apply_held_replies_locked(asked)
            ]
            self._changed.notify_all()
        for tell, reply in late:
            tell(reply)

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
        wanted = {target.robot.name: target for target in targets}
        left: list[StopChannel] = []
        with self._changed:
            for name in self._lines.keys() - wanted.keys():
                left += self._lines.pop(name).channels.values()
            for name, target in wanted.items():
                line = self._lines.setdefault(name, StopLine(target))
                left += [
                    line.channels.pop(topics) for topics in line.channels.keys() - set(target.topic_sets)
                ]
                line.target = target
            lines = list(self._lines.values())
        for way in left:
            way.close()
        with self._opening_lock:
            for line in lines:
                self._open_missing_channels(line)
        with self._changed:
            view = self._view
        if view is not None:
            self.update_graph(view)

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots to which a connection is open."""
        with self._changed:
            lines = [line for line in self._lines.values() if line.target.is_expected and line.is_complete]
            return tuple(line.name for line in lines)

    def is_reachable(self, name: str) -> bool:
        """Return True if the robot's program is connected, so that a Stop sent now would arrive."""
        with self._changed:
            line = self._lines.get(name)
            way = None if line is None else line.channels.get(line.target.robot.topics)
            return line is not None and way is not None and self._is_connected_locked(line, way)

    def deliver(self) -> None:
        """Send pending Stops to robots that have been connected since. Called at each tick.

        A Stop is pending for at most `LATE_REPLY_TIMEOUT_S` seconds.
        """
        with self._changed:
            now = self._clock()
            waiting = [
                each
                for each in self._asked.values()
                if each.is_over and now - each.sent_s <= LATE_REPLY_TIMEOUT_S
            ]
        for each in waiting:
            self._deliver(each)

    def discard_late(self, names: Iterable[str]) -> None:
        """Discard pending Stops of robots that have stopped according to the user."""
        known = set(names)
        with self._changed:
            for id in [id for id, each in self._asked.items() if each.is_over and each.line.name in known]:
                del self._asked[id]

    @property
    def problems(self) -> Mapping[str, str]:
        """Reason why a robot can't be stopped, by the robot's name."""
        with self._changed:
            lines = [line for line in self._lines.values() if line.error and line.target.is_expected]
            return {line.name: line.error for line in lines}

    def send_stop(self, names: Iterable[str] | None = None, ends: str | None = None) -> None:
        """Send a Stop without waiting for replies.

        Robots that don't support ``ends`` (RIZE) need another Stop after the program has ended.

        Args:
            names: Names of the robots; None for all robots.
            ends: Key of a program (`app.robots.identity`) whose further commands the robots reject.
        """
        for line in self._select_lines(names):
            self._send(line, _new_id(), ends)

    def stop_all(
        self,
        names: Iterable[str] | None = None,
        timeout_s: float | None = None,
        on_answer: Callable[[RobotStop], object] | None = None,
        ends: str | None = None,
        on_late: Callable[[RobotStop], object] | None = None,
        is_for_all: bool = False,
    ) -> StopReport:
        """Stop robots and wait until each has replied or timed out.

        Args:
            names: Names of the robots; None for all. Robots that can't be reached are included in the
                report.
            timeout_s: Maximum time to wait. Default: the time that the descriptions require, at least
                one second.
            on_answer: Called in this thread for each reply, and at the end for each robot without a
                reply.
            ends: Key of a program whose further commands the robots reject (see `send_stop`).
            on_late: Called in another thread (of the node or of `update_graph`) when a robot replies after
                the timeout, or confirms the Stop after that.
            is_for_all: True to send the Stop to robots whose reply is not awaited as well.

        Returns:
            Results of all robots.
        """
        names = None if names is None else tuple(names)
        began = self._clock()
        lines = self._select_lines(names)
        asked = [self._start_request(line, ends, on_late) for line in lines]
        if is_for_all:
            for line in self._unexpected_lines():
                self._send(line, _new_id(), ends)
        self._retry_missing_channels(asked)
        if timeout_s is None:
            timeout_s = stop_timeout_s((line.target.robot for line in lines), self._longest_s)
        if asked:
            self._add_new_programs(asked)
        reported = self._wait_for_replies(asked, began + timeout_s, on_answer)
        elapsed_ms = (self._clock() - began) * 1000
        return self._create_report(asked, reported, elapsed_ms, on_answer).with_unreached(names or ())

    def _wait_for_replies(
        self,
        asked: Sequence[StopRequest],
        deadline_s: float,
        on_answer: Callable[[RobotStop], object] | None,
    ) -> set[tuple[str, str]]:
        # Waits until all requests are settled, or the deadline; returns the reported (request, node) pairs.
        reported: set[tuple[str, str]] = set()
        while True:
            self._query_graph_if_needed(asked)
            undelivered = [each for each in asked if not self._deliver(each)]
            with self._changed:
                remaining_s = deadline_s - self._clock()
                pause_s = (
                    min(remaining_s, GRAPH_POLL_INTERVAL_S)
                    if any(each.unknown_replies for each in asked)
                    else remaining_s
                )
                pause_s = min(pause_s, POLL_INTERVAL_S) if undelivered else pause_s
                self._changed.wait_for(lambda: self._has_new_replies(asked, reported), max(0.0, pause_s))
                news = [(each, node, result) for each in asked for node, result in each.new_replies(reported)]
            for each, node, result in news:
                reported.add((each.id, node))
                if on_answer is not None:
                    on_answer(result)
            if all(each.is_settled for each in asked) or self._clock() >= deadline_s:
                return reported

    def close(self) -> None:
        """Disconnect from all robots without stopping them."""
        self.set_robots(())
        for maker in self._openers:
            maker.join(timeout=5)
        with self._changed:
            self._asked.clear()

    # ---- connections

    def _open_missing_channels(self, line: StopLine) -> None:
        # Opens missing connections; a failure becomes the line's error. Call with `_opening_lock` held.
        error = ""
        for topics in line.target.topic_sets:
            with self._changed:
                is_there = topics in line.channels or self._lines.get(line.name) is not line
            if is_there:
                continue
            try:
                way = self._connect(line.target.robot, topics)
            except NepError as failed:
                error = f"{failed}"
                continue
            with self._changed:
                is_wanted = self._lines.get(line.name) is line and topics in line.target.topic_sets
                if is_wanted:
                    line.channels[topics] = way
            if not is_wanted:
                way.close()
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

    def _retry_missing_channels(self, asked: Sequence[StopRequest]) -> None:
        # Retries failed connections in a thread, so that the Stop of other robots is not delayed.
        missing = [each for each in asked if not each.line.is_complete]
        if not missing:
            return

        def open_channels() -> None:
            for each in missing:
                before = set(each.line.channels)
                with self._opening_lock:
                    self._open_missing_channels(each.line)
                new = each.line.channels.keys() - before
                error = self._send(each.line, each.id, each.ends, new) if new else each.line.send_problem
                with self._changed:
                    each.error = error if not before else each.error
                    self._changed.notify_all()

        for each in missing:
            each.error = "" if not each.line.channels else each.error
        self._openers = [thread for thread in self._openers if thread.is_alive()]
        self._openers.append(threading.Thread(target=open_channels, name="studio-stop-line", daemon=True))
        self._openers[-1].start()

    def _select_lines(self, names: Iterable[str] | None) -> list[StopLine]:
        with self._changed:
            if names is None:
                return [line for line in self._lines.values() if line.target.is_expected]
            return [self._lines[name] for name in dict.fromkeys(names) if name in self._lines]

    def _start_request(
        self, line: StopLine, ends: str | None, late: Callable[[RobotStop], object] | None
    ) -> StopRequest:
        asked = StopRequest(line, _new_id(), self._clock(), late, ends)
        with self._changed:
            self._evict_expired()
            self._asked[asked.id] = asked
            if self._view is not None and line.target.robot.dialect != RIZE:
                asked.replies |= self._serving_programs(asked)
            for topics, way in line.channels.items():
                if self._is_connected_locked(line, way):
                    asked.record_sent(topics, asked.sent_s)
        asked.error = self._send(line, asked.id, ends)
        return asked

    def _unexpected_lines(self) -> list[StopLine]:
        with self._changed:
            return [line for line in self._lines.values() if not line.target.is_expected]

    def _is_connected_locked(self, line: StopLine, way: StopChannel) -> bool:
        # Call with `_changed` held.
        hearers = self._hearers.get(way.topic)
        if hearers is None:
            hearers = frozenset(subscriber_nodes(self._view or GraphView(0, 0), way.topic))
            self._hearers[way.topic] = hearers
        return way.is_connected(line.target, hearers)

    def _deliver(self, asked: StopRequest) -> bool:
        # Sends the command on newly connected topics; returns whether nothing is left to deliver.
        with self._changed:
            if asked.has_all_replies or asked.line.target.robot.dialect == RIZE:
                return True
            ways = dict(asked.line.channels)
            new = [
                topics
                for topics, way in ways.items()
                if topics not in asked.delivered_topics and self._is_connected_locked(asked.line, way)
            ]
            for topics in new:
                asked.record_sent(topics, self._clock())
        if new:
            self._send(asked.line, asked.id, asked.ends, new)
        return bool(asked.delivered_topics or asked.error)

    def _send(
        self, line: StopLine, id: str, ends: str | None, only: Iterable[RobotTopics] | None = None
    ) -> str:
        # Returns the reason if the Stop could be sent on no topic, else an empty string.
        robot = line.target.robot
        stop = robot.safe_stop.action
        if robot.dialect == RIZE:
            command = rize.to_command(robot, stop, {}, id)
        else:
            command = {"id": id, "op": "stop", "from": self._sender, "action": stop, "input": {}}
            if ends is not None:
                command["ends"] = ends
        with self._changed:
            ways = [way for topics, way in line.channels.items() if only is None or topics in only]
        sent, error = False, line.send_problem
        for way in ways:
            try:
                way.publisher.publish(command)
                sent = True
            except NepError as failed:
                error = _("Stop can't be sent to {robot}: {why}").format(robot=robot.name, why=failed)
        return "" if sent else error

    # ---- replies

    def _has_new_replies(self, asked: Sequence[StopRequest], told: set[tuple[str, str]]) -> bool:
        if any(each.new_replies(told) for each in asked) or all(each.is_settled for each in asked):
            return True
        return (
            any(each.unknown_replies for each in asked)
            and self._clock() - self._graph_queried_s >= GRAPH_POLL_INTERVAL_S
        )

    def _query_graph_if_needed(self, asked: Sequence[StopRequest]) -> None:
        # Queries the graph while the programs of a robot or the publisher of a reply are unknown.
        with self._changed:
            waits = self._view is None or any(each.unknown_replies for each in asked)
            now = self._clock()
            looks = waits and (self._view is None or now - self._graph_queried_s >= GRAPH_POLL_INTERVAL_S)
            if looks:
                self._graph_queried_s = now
        if looks:
            self._refresh_view()
        with self._changed:
            for each in asked:
                if not each.replies:
                    each.replies |= self._serving_programs(each)
                    self._apply_held_replies_locked(each)  # not late: the Stop was sent just now

    def _add_new_programs(self, asked: Sequence[StopRequest]) -> None:
        # Programs newer than the last graph received the Stop too.
        self._refresh_view()
        with self._changed:
            for each in asked:
                known = {node: reply for node, reply in each.replies.items() if node != _UNKNOWN_PROGRAM}
                each.replies = self._serving_programs(each) | known

    def _refresh_view(self) -> None:
        # Without a reply of the master the previous graph stays valid.
        with suppress(NepError):
            self.update_graph(self._node.graph(GRAPH_TIMEOUT_S))

    def _serving_programs(self, asked: StopRequest) -> dict[str, RobotStop | None]:
        # The programs that must reply, by node: the robot's own, then others that serve it. Programs that
        # receive its commands but can't reply are named.
        target, view = asked.line.target, self._view or GraphView(0, 0)
        if target.robot.dialect == RIZE:
            # RIZE never replies; a robot that could not be reached is not among them.
            return {} if asked.error else {"": RobotStop(asked.line.name, False, None, can_confirm=False)}
        identity = target.identity or first_announcer(view, target.robot.topics.description)
        own = identity.node_id if identity is not None else _UNKNOWN_PROGRAM
        found: dict[str, RobotStop | None] = {own: None}
        answering = {node for way in target.topic_sets for node in publisher_nodes(view, way.reply)}
        heard = dict.fromkeys(
            node for way in target.topic_sets for node in subscriber_nodes(view, way.command)
        )
        others = [node for node in heard if node not in (own, self._node.id)]
        for node in [node for node in others if node in answering][:MAX_SERVING_PROGRAMS]:
            asked.program_names[node] = identity_of(view, node).node or node
            found[node] = None
        listening = [node for node in others if node not in answering]
        programs = [identity_of(view, node).node or node for node in listening[:MAX_NAMED_LISTENERS]]
        if len(listening) > MAX_NAMED_LISTENERS:
            programs = [
                ngettext("{count} program", "{count} programs", len(listening)).format(count=len(listening))
            ]
        for node, program in zip(listening, programs, strict=False):
            found[node] = RobotStop(target.robot.name, False, None, can_confirm=False, program=program)
        for before in target.earlier_programs:
            if before.node_id not in found:
                asked.program_names[before.node_id] = before.node or before.node_id
                found[before.node_id] = None
        return found

    def _on_replies(self, messages: Sequence[Message]) -> None:
        # Checks the sender first: only messages of programs that must answer are decoded.
        late: list[tuple[Callable[[RobotStop], object], RobotStop]] = []
        with self._changed:
            for message in messages:
                node = self._senders.node_of(message)
                for asked in self._asked.values():
                    if message.topic in asked.line.reply_topics:
                        late += self._apply_reply_locked(asked, node, message)
            self._changed.notify_all()
        for tell, said in late:
            tell(said)

    def _apply_held_replies_locked(
        self, asked: StopRequest
    ) -> list[tuple[Callable[[RobotStop], object], RobotStop]]:
        # Processes held replies whose publishers are known now; returns late ones with their callbacks, which
        # the caller invokes after releasing the lock. Replies that are still unknown are discarded: their
        # publisher has not registered, or the master is missing, and then nothing can be proven.
        held = asked.unknown_replies.pop_all()
        known = [(node, message) for message in held if (node := self._senders.node_of(message)) is not None]
        return [late for node, message in known for late in self._apply_reply_locked(asked, node, message)]

    def _apply_reply_locked(
        self, asked: StopRequest, node: str | None, message: Message
    ) -> list[tuple[Callable[[RobotStop], object], RobotStop]]:
        # Applies a reply of a program that must reply; returns the callback if it is late.
        if node is None or not asked.replies:
            asked.unknown_replies.add(message)
            return []
        if node not in asked.replies:
            if node in asked.foreign_replies or len(asked.foreign_replies) < MAX_SERVING_PROGRAMS:
                asked.foreign_replies.setdefault(node, PendingMessages(publishers=1)).add(message)
            return []
        name = asked.line.name
        is_news = asked.accept(node, message, self._clock(), partial(stop_error_text, name))
        reply = asked.replies[node]
        if not is_news or reply is None or not asked.is_over or asked.on_late is None:
            return []
        return [(asked.on_late, reply)]

    def _create_report(
        self,
        asked: Sequence[StopRequest],
        told: set[tuple[str, str]],
        elapsed_ms: float,
        on_answer: Callable[[RobotStop], object] | None,
    ) -> StopReport:
        with self._changed:
            for each in asked:
                each.is_over = True
            results = [result for each in asked for result in each.results()]
            untold = [
                result
                for each in asked
                for node, result in zip(each.replies or {"": None}, each.results(), strict=True)
                if (each.id, node) not in told
            ]
            view = self._view or GraphView(0, 0)
            strangers = [
                (each.line.name, identity_of(view, node).node or node)
                for each in asked
                for node in each.impostors()
            ]
        for result in untold:
            if on_answer is not None:
                on_answer(result)
        return StopReport(tuple(results), elapsed_ms, tuple(dict.fromkeys(strangers)))

    def _evict_expired(self) -> None:
        # Discards Stops whose late replies are no longer accepted.
        now = self._clock()
        over = [id for id, each in self._asked.items() if each.is_over]
        for place, id in enumerate(over):
            each = self._asked[id]
            if (
                each.is_confirmed
                or place < len(over) - MAX_LATE_REQUESTS
                or now - each.sent_s > LATE_REPLY_TIMEOUT_S
            ):
                del self._asked[id]


def _new_id() -> str:
    return f"stop-{uuid.uuid4().hex[:12]}"


def stop_and_report(
    stopper: RobotStopper | None,
    names: tuple[str, ...],
    *,
    on_late: Callable[[RobotStop], object],
    on_answer: Callable[[RobotStop], object] | None = None,
    ends: str | None = None,
    is_for_all: bool = False,
) -> StopReport:
    """Stop robots and return a report, even after an unexpected error.

    Without a report, the run would remain in the state "stopping".

    Args:
        stopper: Connections to the robots; None if there are none.
        names: Names of the robots.
        on_late: See `RobotStopper.stop_all`.
        on_answer: See `RobotStopper.stop_all`.
        ends: See `RobotStopper.stop_all`.
        is_for_all: See `RobotStopper.stop_all`.
    """
    why = _(NO_NETWORK)
    if stopper is not None:
        try:
            return stopper.stop_all(
                names, on_answer=on_answer, ends=ends, on_late=on_late, is_for_all=is_for_all
            )
        except Exception as error:  # noqa: BLE001 - reported as unproven for these robots
            _log.exception("can't stop the robots")
            why = error_text(error)
    return StopReport((), 0.0).with_unreached(names, why)
