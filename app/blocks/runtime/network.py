"""Implementation of `ProgramLink` over NEP. Imported only in the program's process."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from typing import Protocol

from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.motions import Motions
from app.blocks.runtime.publishing import PublishGuard
from app.blocks.runtime.scheduler import ScriptGroup
from app.clock import MonotonicClock, ThreadClock
from app.robots.client.dialects import dialect_of, new_id
from app.robots.client.heartbeat import Heartbeat
from app.robots.client.inbox import ReplyInbox, Senders
from app.robots.client.limits import PROGRAM_LOOKUP_INTERVAL_S, stop_timeout_s
from app.robots.client.reply import RobotReply
from app.robots.client.stop import PendingStops, StopRequest, StopTarget, unproven_robots
from app.robots.description.description import Robot
from app.robots.identity import Identity, first_announcer
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView
from nep.system.log_rarely import SuppressedErrors

Callback = Callable[[object], None]
_log = logging.getLogger(__name__)


class ProgramPublisher(Protocol):
    """Interface of the publisher that `Network` uses; implemented by `nep.nodes.publisher.Publisher`."""

    def publish(self, payload: object) -> None:
        """Publish one message."""
        ...


class ProgramNode(Protocol):
    """Interface of the node that `Network` uses; implemented by `nep.nodes.node.Node`."""

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool) -> ProgramPublisher:
        """Open a publisher.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            batch: False to send each message immediately.
        """
        ...

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[Message]], None]
    ) -> object:
        """Open a subscriber.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            sink: Called with received messages in the node's thread.
        """
        ...

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Return the current graph."""
        ...


def payload_of(message: Message) -> object:
    """Return the payload of a message; None if it can't be decoded."""
    try:
        return message.payload
    except NepError:
        return None


def value_of(payload: object) -> object:
    """Return the value in a sensor's payload ``{"value": …}``; other payloads are returned unchanged."""
    if isinstance(payload, Mapping) and set(payload) == {"value"}:
        return payload["value"]
    return payload


class Network:
    """Connection of a program to its robots and topics.

    The constructor opens the publishers and subscribers.

    Args:
        node: Node of the program.
        program: Id of the program, sent with its commands.
        robots: Descriptions of the program's robots.
        parts: Used sensors and events as (robot, name).
        publishes: Topics to publish on; other topics are opened at first use.
        listens: Topics to subscribe to; other topics are opened at first use.
        owners: Node ids by robot name; replies of other nodes are ignored. The default for each robot is the
            first node that announced it.
        clock: Clock of the program (default: that of the computer). Stops are timed by the computer's clock.
    """

    def __init__(
        self,
        node: ProgramNode,
        program: str,
        robots: Sequence[Robot],
        *,
        parts: Iterable[tuple[str, str]] = (),
        publishes: Iterable[str] = (),
        listens: Iterable[str] = (),
        owners: Mapping[str, str] | None = None,
        clock: ThreadClock | None = None,
    ) -> None:
        self._node = node
        self._clock: ThreadClock = clock or MonotonicClock()
        self.guard = PublishGuard({}, ())
        """Guard of the topics on which the program may not publish."""
        self._owners = dict(owners or {})
        self._senders = Senders()
        self._view = GraphView(0, 0)
        self._replies_lock = threading.Lock()  # serializes the handling of replies
        self._inbox = ReplyInbox(self._senders)
        self._lookup_requested = self._clock.event()
        self._lookup_thread: threading.Thread | None = None
        self._program = program
        self._robots = {robot.name: robot for robot in robots}
        self._robot_of = {sensor.topic: robot.name for robot in robots for sensor in robot.sensors}
        self._robot_of |= {event.topic: robot.name for robot in robots for event in robot.events}
        self._lock = threading.RLock()
        self._calls: dict[str, RobotCall] = {}
        self._stops = PendingStops()
        self._unproven_stops: Mapping[str, StopRequest] = {}
        self._newest_messages: dict[str, Message] = {}
        self._callbacks: dict[str, list[Callback]] = {}
        self._subscribed_topics: set[str] = set()
        self._publishers: dict[str, ProgramPublisher] = {}
        self._on_change: Callable[[], None] = _do_nothing
        self._on_external_stop: Callable[[str], None] = _ignore
        self._stops_changed = threading.Condition()
        self._closed = self._clock.event()
        self._errors = SuppressedErrors(_log, "a message or reply of a robot")
        self._is_ending = False
        self._motions = Motions(self._stop_for_pause, self._stop_motion, self.invoke)
        self._heartbeat = Heartbeat(program, "program alive", self._clock)
        self._open(parts, publishes, listens)

    def _open(
        self, parts: Iterable[tuple[str, str]], publishes: Iterable[str], listens: Iterable[str]
    ) -> None:
        for robot in self._robots.values():
            self._open_robot(robot)
        for name, part in parts:
            self._subscribe(self._topic(name, part))
        for topic in publishes:
            self._get_publisher(topic)
        for topic in listens:
            self._subscribe(topic)
        with suppress(NepError):  # the master is down: owners are resolved later
            self._resolve_senders()
        for robot in self._robots.values():
            if dialect_of(robot).is_identified:
                self._heartbeat.start(robot.name, self._publishers[robot.topics.command].publish)

    def _open_robot(self, robot: Robot) -> None:
        dialect = dialect_of(robot)
        self._get_publisher(robot.topics.command, dialect.command_type)
        with self._lock:
            topic = robot.topics.reply
            if topic not in self._subscribed_topics:
                self._subscribed_topics.add(topic)
                self._node.new_sub(topic, dialect.reply_type, sink=self._receive_replies)

    def close(self) -> None:
        """Stop the heartbeat and the look-up of publishers.

        The node is not closed, because it belongs to the caller.
        """
        self._closed.set()
        self._lookup_requested.set()
        self._heartbeat.close()
        if self._lookup_thread is not None:
            self._lookup_thread.join(timeout=3.0)

    def update_owners(self, owners: Mapping[str, str]) -> None:
        """Update the node ids of restarted robots.

        Args:
            owners: Node ids by robot name.
        """
        with self._replies_lock:
            self._owners |= owners

    # ---- ProgramLink interface

    def set_callbacks(self, on_change: Callable[[], None], on_external_stop: Callable[[str], None]) -> None:
        """Set the callbacks; see `ProgramLink.set_callbacks`."""
        self._on_change, self._on_external_stop = on_change, on_external_stop

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> RobotCall:
        """Send a command to a robot; the returned call is updated as replies arrive."""
        description = self._robots[robot]
        call = RobotCall(new_id("cmd"), robot, action, started_s=self._clock.now())
        with self._lock:
            self._calls[call.id] = call
        self._motions.record_command(call, description, input)
        command = dialect_of(description).invoke(description, call.id, self._program, action, input)
        self._send(description, command)
        return call

    def cancel(self, call: RobotCall) -> None:
        """Cancel a command. Has no effect for robots of RIZE, which don't support it."""
        description = self._robots[call.robot]
        command = dialect_of(description).cancel(call.id, self._program, call.action)
        if command is not None:
            self._send(description, command)

    def sensor(self, robot: str, name: str) -> object:
        """Return the newest value of a sensor; None if no value has been received yet or decoding fails.

        Raises:
            KeyError: The robot has no sensor or event with this name.
        """
        topic = self._topic(robot, name)
        self._subscribe(topic)
        message = self._newest_messages.get(topic)
        return None if message is None else value_of(payload_of(message))

    def newest(self, topic: str) -> object:
        """Return the payload of the newest message of a topic; None if there is none or decoding fails."""
        self._subscribe(topic)
        message = self._newest_messages.get(topic)
        return None if message is None else payload_of(message)

    def publish(self, topic: str, payload: object) -> None:
        """Publish a message as JSON.

        Raises:
            BehaviourError: The message would move a robot that the program is not allowed to move.
        """
        self.guard.check(topic)
        self._get_publisher(topic).publish(payload)

    def on_sensor(self, robot: str, name: str, callback: Callback) -> None:
        """Call `callback` with each value of a sensor."""
        self.on_message(self._topic(robot, name), lambda payload: callback(value_of(payload)))

    def on_event(self, robot: str, name: str, callback: Callback) -> None:
        """Call `callback` with the data of each event with this name."""
        self.on_message(self._topic(robot, name), callback)

    def on_message(self, topic: str, callback: Callback) -> None:
        """Call `callback` with the payload of each message of a topic.

        Messages that can't be decoded are skipped, and so are messages of other programs if the topic
        belongs to a robot whose own program publishes it.
        """
        with self._lock:
            self._callbacks.setdefault(topic, []).append(callback)
        self._subscribe(topic)

    # ---- stopping

    def pause_robots(self) -> None:
        """Stop motions that continue after their command (such as a speed) until `resume_robots`."""
        self._motions.stop_all()

    def resume_robots(self) -> None:
        """Resume the motions that `pause_robots` stopped."""
        self._motions.resume_all()

    def hold_motions(self, group: ScriptGroup) -> None:
        """Stop the motions of a group's scripts until `resume_motions`."""
        self._motions.hold(group)

    def resume_motions(self, group: ScriptGroup) -> None:
        """Resume the motions that `hold_motions` stopped."""
        self._motions.resume(group)

    def end_motions(self, group: ScriptGroup) -> None:
        """Stop and discard the motions of a group's scripts."""
        self._motions.end(group)

    def suspend_motions(self) -> AbstractContextManager[None]:
        """Return a context manager that stops the motions of the calling script during a delay at a block."""
        return self._motions.suspend()

    def _stop_motion(self, robot: Robot) -> bool:
        pending_calls = [call for call in list(self._calls.values()) if call.robot == robot.name]
        if not all(self._motions.is_motion(call) for call in pending_calls):
            return False
        self._send_stop(robot)
        return True

    def _stop_for_pause(self, robot: Robot) -> None:
        for call in list(self._calls.values()):
            call.is_canceled_by_pause = call.is_canceled_by_pause or call.robot == robot.name
        self._send_stop(robot)

    def _send_stop(self, robot: Robot) -> StopRequest:
        owner = self._owners.get(robot.name)
        target = StopTarget(robot, None if owner is None else Identity(owner))
        with self._stops_changed:
            request = self._stops.start(target, self._view, time.monotonic())
            request.is_over = not self._is_ending  # a pause doesn't wait for replies
        self._send(robot, dialect_of(robot).stop(robot, request.id, self._program))
        return request

    def stop_robots(self, timeout_s: float | None = None) -> tuple[str, ...]:
        """Stop all robots and wait for their confirmations. Robots that can't confirm (RIZE) are skipped.

        Don't call this in a thread of the clock: robots in virtual time couldn't stop meanwhile.

        Args:
            timeout_s: Maximum wait in seconds of real time; None for the time that the robots' descriptions
                require.

        Returns:
            Names of the robots that did not confirm the stop; see `stop_error` for the reasons.
        """
        self._is_ending = True
        if timeout_s is None:
            timeout_s = stop_timeout_s(self._robots.values())
        if timeout_s:
            with suppress(NepError):
                self._resolve_senders()
        requests = [
            self._send_stop(robot) for robot in self._robots.values() if dialect_of(robot).is_identified
        ]
        with self._stops_changed:
            self._stops_changed.wait_for(
                lambda: all(request.has_all_replies or request.is_refused for request in requests), timeout_s
            )
            self._unproven_stops = unproven_robots(requests)
            return tuple(self._unproven_stops)

    def stop_error(self, name: str) -> str:
        """Return the reason why a robot did not confirm its stop: the error in its reply, or no reply.

        The text has no full stop.
        """
        request = self._unproven_stops.get(name)
        problems = [result.problem for result in request.results()] if request is not None else []
        return next(filter(None, problems), "") or _("{robot} didn't reply").format(robot=name)

    # ---- internals

    def _topic(self, robot: str, name: str) -> str:
        description = self._robots[robot]
        sensor_or_event = description.sensor(name) or description.event(name)
        if sensor_or_event is None:
            raise KeyError(name)
        return sensor_or_event.topic

    def _get_publisher(self, topic: str, msg_type: str = "json") -> ProgramPublisher:
        with self._lock:
            if topic not in self._publishers:
                self._publishers[topic] = self._node.new_pub(topic, msg_type, batch=False)
            return self._publishers[topic]

    def _subscribe(self, topic: str) -> None:
        with self._lock:
            if topic in self._subscribed_topics:
                return
            self._subscribed_topics.add(topic)
        self._node.new_sub(topic, sink=self._receive_messages)

    def _resolve_senders(self) -> None:
        # Queries the graph and resolves senders. Never call it in the node's own thread, which it would
        # block.
        view = self._node.graph()
        topics = {robot.topics.reply for robot in self._robots.values()} | self._robot_of.keys()
        with self._replies_lock:
            self._view = view
            self._senders.update(view, topics)
            for robot in self._robots.values():
                first = first_announcer(view, robot.topics.description)
                if dialect_of(robot).is_identified and first is not None:
                    self._owners.setdefault(robot.name, first.node_id)
            with self._stops_changed:
                self._stops.update(view, time.monotonic())
                self._stops_changed.notify_all()
            for node, message in self._inbox.pop_listed():
                self._handle_reply_locked(node, message)
        self._on_change()

    def _request_lookup(self) -> None:
        # Starts the query in a separate thread.
        with self._lock:
            if self._lookup_thread is None and not self._closed.is_set():
                self._lookup_thread = self._clock.start_thread(self._run_lookup, "program senders")
        self._lookup_requested.set()

    def _run_lookup(self) -> None:
        while self._clock.wait(self._lookup_requested, None) and not self._closed.is_set():
            self._lookup_requested.clear()
            with self._errors, suppress(NepError):
                self._resolve_senders()
            self._clock.wait(self._closed, PROGRAM_LOOKUP_INTERVAL_S)

    def _is_from_robot(self, message: Message) -> bool:
        owner = self._owners.get(self._robot_of.get(message.topic, ""))
        is_own = self._senders.is_own(self._view, message, owner)
        if is_own is None:
            self._request_lookup()
        return is_own is True

    def _receive_messages(self, messages: Sequence[Message]) -> None:
        for message in messages:
            with self._errors:
                self._receive(message)
        self._on_change()

    def _receive(self, message: Message) -> None:
        if not self._is_from_robot(message):
            return
        self._newest_messages[message.topic] = message
        for callback in self._callbacks.get(message.topic, ()):
            payload = payload_of(message)
            if payload is not None:
                callback(payload)

    def _receive_replies(self, messages: Sequence[Message]) -> None:
        with self._replies_lock:
            for message in messages:
                with self._errors:
                    self._receive_reply_locked(message)
        self._on_change()

    def _receive_reply_locked(self, message: Message) -> None:
        # The sender must be known before a reply counts, if robots on this topic can be identified.
        robots = [robot for robot in self._robots.values() if robot.topics.reply == message.topic]
        if not any(dialect_of(robot).is_identified for robot in robots):
            self._handle_reply_locked(self._senders.node_of(message), message)
            return
        node = self._inbox.sender_of(message)
        if node is None:
            self._request_lookup()
        else:
            self._handle_reply_locked(node, message)

    def _handle_reply_locked(self, node: str | None, message: Message) -> None:
        # Call with `_replies_lock` held. Only messages of nodes whose replies count are decoded.
        with self._stops_changed:
            if node is not None and self._stops.is_awaited(message):
                self._stops.receive(node, message, time.monotonic())
            self._stops_changed.notify_all()
        for robot in self._robots.values():
            dialect = dialect_of(robot)
            if robot.topics.reply == message.topic and dialect.is_own(
                robot, self._owners.get(robot.name), node, self._view
            ):
                reply = dialect.read(payload_of(message))
                if reply is not None:
                    self._apply_reply(robot, reply, self._clock.now())

    def _apply_reply(self, robot: Robot, reply: RobotReply, now: float) -> None:
        for pending_call in list(self._calls.values()):
            if pending_call.robot == robot.name:
                pending_call.last_reply_s = now
        if reply.op == "stop":
            is_external = reply.state in ("succeeded", "failed") and not self._stops.is_own(reply.id)
            if is_external and not self._is_ending:
                self._on_external_stop(robot.name)
            return
        call = self._calls.get(reply.id)
        if call is not None and call.robot == robot.name and call.apply(reply, now):
            self._calls.pop(call.id, None)
            self._motions.record_final_reply(call)

    def _send(self, robot: Robot, command: Mapping[str, object]) -> None:
        self._publishers[robot.topics.command].publish(command)


def _do_nothing() -> None:
    return


def _ignore(_robot: str) -> None:
    return
