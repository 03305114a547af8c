"""Implementation of `ProgramLink` over NEP. Imported only in the program's process."""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from typing import Protocol

from app.blocks.runtime.link import FINAL_STATES, REPLY_STATES, RobotCall
from app.blocks.runtime.motions import Motions
from app.blocks.runtime.publishing import PublishGuard
from app.robots import rize
from app.robots.description.description import Robot
from app.robots.heartbeat import Heartbeat
from app.robots.identity import (
    Senders,
    first_announcer,
    publisher_nodes,
    safe_error_text,
    stop_error_text,
    subscriber_nodes,
)
from app.robots.message_buffer import PendingMessages
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView
from nep.system.log_rarely import SuppressedErrors
from nep.text import bounded_str

LOOKUP_INTERVAL_S = 0.2
"""Minimum interval in seconds between graph queries that look up unknown publishers."""
MAX_PENDING_PER_PUBLISHER = 32

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


def new_id(kind: str) -> str:
    """Return a unique id with the prefix ``kind``."""
    return f"{kind}-{uuid.uuid4().hex[:12]}"


class Network:
    """Connection of a program to its robots and topics.

    The constructor opens the publishers and subscribers.

    Args:
        node: Node of the program.
        program: Id of the program, sent with its commands.
        robots: Descriptions of the program's robots.
        sensors: Used sensors as (robot, name).
        events: Used events as (robot, name).
        publishes: Topics to publish on; other topics are opened at first use.
        listens: Topics to subscribe to; other topics are opened at first use.
        owners: Node ids by robot name; replies of other nodes are ignored. The default for each robot is the
            first node that announced it.
    """

    def __init__(
        self,
        node: ProgramNode,
        program: str,
        robots: Sequence[Robot],
        *,
        sensors: Iterable[tuple[str, str]] = (),
        events: Iterable[tuple[str, str]] = (),
        publishes: Iterable[str] = (),
        listens: Iterable[str] = (),
        owners: Mapping[str, str] | None = None,
    ) -> None:
        self._node = node
        self.guard = PublishGuard({}, ())
        """Guard of the topics on which the program may not publish."""
        self._owners = dict(owners or {})
        self._senders = Senders()
        self._view = GraphView(0, 0)
        self._replies_lock = threading.Lock()  # serializes the handling of replies
        self._unresolved_replies = PendingMessages(per_publisher=MAX_PENDING_PER_PUBLISHER)
        self._lookup_requested = threading.Event()
        self._lookup_thread: threading.Thread | None = None
        self._stop_errors: dict[str, str] = {}
        self._program = program
        self._robots = {robot.name: robot for robot in robots}
        self._robot_of = {sensor.topic: robot.name for robot in robots for sensor in robot.sensors}
        self._robot_of |= {event.topic: robot.name for robot in robots for event in robot.events}
        self._lock = threading.RLock()
        self._calls: dict[str, RobotCall] = {}
        # id of a stop -> robot, and nodes that must still reply
        self._stops: dict[str, tuple[str, set[str]]] = {}
        self._own_stops: set[str] = set()
        self._newest_messages: dict[str, Message] = {}
        self._callbacks: dict[str, list[Callback]] = {}
        self._subscribed_topics: set[str] = set()
        self._publishers: dict[str, ProgramPublisher] = {}
        self._on_change: Callable[[], None] = _do_nothing
        self._on_external_stop: Callable[[str], None] = _ignore
        self._stops_changed = threading.Condition()
        self._closed = threading.Event()
        self._errors = SuppressedErrors(_log, "a message or reply of a robot")
        self._is_ending = False
        self._motions = Motions(self._stop_for_pause, self._stop_motion, self.invoke)
        self._heartbeat = Heartbeat(program, "program alive")
        self._open((*sensors, *events), publishes, listens)

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
            if robot.dialect != "rize":
                self._heartbeat.start(robot.name, self._publishers[robot.topics.command].publish)

    def _open_robot(self, robot: Robot) -> None:
        self._get_publisher(robot.topics.command, "json" if robot.dialect == "rize" else "robot/command")
        msg_type = "json" if robot.dialect == "rize" else "robot/answer"
        with self._lock:
            topic = robot.topics.reply
            if topic not in self._subscribed_topics:
                self._subscribed_topics.add(topic)
                self._node.new_sub(topic, msg_type, sink=self._receive_replies)

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
        call = RobotCall(new_id("cmd"), robot, action)
        with self._lock:
            self._calls[call.id] = call
        self._motions.record_command(call, description, input)
        if description.dialect == "rize":
            self._send(description, rize.to_command(description, action, input, call.id))
        else:
            self._send(description, self._make_command(call.id, "invoke", action, input))
        return call

    def cancel(self, call: RobotCall) -> None:
        """Cancel a command. Has no effect for robots of RIZE, which don't support it."""
        description = self._robots[call.robot]
        if description.dialect != "rize":
            self._send(description, self._make_command(call.id, "cancel", call.action))

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

    def suspend_motions(self) -> AbstractContextManager[None]:
        """Return a context manager that stops the motions of the calling script during a delay at a block."""
        return self._motions.suspend()

    def _stop_motion(self, robot: Robot) -> None:
        pending_calls = [call for call in list(self._calls.values()) if call.robot == robot.name]
        if all(self._motions.is_motion(call) for call in pending_calls):
            self._send_stop(robot)

    def _stop_for_pause(self, robot: Robot) -> None:
        for call in list(self._calls.values()):
            call.is_canceled_by_pause = call.is_canceled_by_pause or call.robot == robot.name
        self._send_stop(robot)

    def _send_stop(self, robot: Robot) -> None:
        id = new_id("stop")
        with self._stops_changed:
            self._own_stops.add(id)
            self._stops[id] = (robot.name, self._stop_nodes(robot))
        self._send(robot, self._make_command(id, "stop", robot.safe_stop.action))

    def stop_robots(self, timeout_s: float) -> tuple[str, ...]:
        """Stop all robots and wait for their confirmations. Robots of RIZE are skipped.

        Args:
            timeout_s: Maximum wait in seconds.

        Returns:
            Names of the robots that did not confirm the stop; see `stop_error` for the reasons.
        """
        self._is_ending = True
        if timeout_s:
            with suppress(NepError):
                self._resolve_senders()
        for robot in self._robots.values():
            if robot.dialect == "rize":
                continue
            self._send_stop(robot)
        with self._stops_changed:
            pending_stops = self._stops
            self._stops_changed.wait_for(
                lambda: all(name in self._stop_errors for name, _ in pending_stops.values()), timeout_s
            )
            return tuple(dict.fromkeys(name for name, _ in pending_stops.values()))

    def stop_error(self, name: str) -> str:
        """Return the reason why a robot did not confirm its stop: the error in its reply, or no reply.

        The text has no full stop.
        """
        return self._stop_errors.get(name) or _("{robot} didn't reply").format(robot=name)

    def _stop_nodes(self, robot: Robot) -> set[str]:
        # The robot's own node, and others that reply to its commands, must reply to a stop.
        command_subscribers = set(subscriber_nodes(self._view, robot.topics.command))
        other_nodes = command_subscribers & set(publisher_nodes(self._view, robot.topics.reply))
        owner = self._owners.get(robot.name)
        return {owner or "", *other_nodes}

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
                if robot.dialect != "rize" and first is not None:
                    self._owners.setdefault(robot.name, first.node_id)
            for message in self._unresolved_replies.pop_all():
                if self._senders.node_of(message) is not None:
                    self._handle_reply_locked(message)
        self._on_change()

    def _request_lookup(self) -> None:
        # Starts the query in a separate thread.
        with self._lock:
            if self._lookup_thread is None and not self._closed.is_set():
                self._lookup_thread = threading.Thread(
                    target=self._run_lookup, name="program senders", daemon=True
                )
                self._lookup_thread.start()
        self._lookup_requested.set()

    def _run_lookup(self) -> None:
        while self._lookup_requested.wait() and not self._closed.is_set():
            self._lookup_requested.clear()
            with self._errors, suppress(NepError):
                self._resolve_senders()
            self._closed.wait(LOOKUP_INTERVAL_S)

    def _is_from_robot(self, message: Message) -> bool:
        # If the robot's own program publishes the topic, only its messages count; a camera may be another
        # program.
        robot = self._robot_of.get(message.topic)
        owner = self._owners.get(robot) if robot is not None else None
        if owner is None or owner not in publisher_nodes(self._view, message.topic):
            return True
        node = self._senders.node_of(message)
        if node is None:
            self._request_lookup()
        return node == owner

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
                    self._handle_reply_locked(message)
        self._on_change()

    def _handle_reply_locked(self, message: Message) -> None:
        # Call with `_replies_lock` held. The sender must be known before a reply is used.
        node = self._senders.node_of(message)
        is_native = any(
            robot.dialect != "rize" and robot.topics.reply == message.topic for robot in self._robots.values()
        )
        if is_native and (node is None or self._unresolved_replies.has_messages_of(message.publisher)):
            self._unresolved_replies.add(message)
            self._request_lookup()
            return
        if is_native and not self._is_stop_node(message.topic, node or ""):
            return  # skip decoding
        payload = payload_of(message)
        if isinstance(payload, Mapping):
            self._apply_reply(message.topic, payload, node or "")

    def _is_stop_node(self, topic: str, node: str) -> bool:
        # True for a robot's node, and for a node that must reply to a stop.
        with self._stops_changed:
            is_awaited = any(node in silent_nodes for _name, silent_nodes in self._stops.values())
        return is_awaited or any(self._is_own_reply(robot, topic, node) for robot in self._robots.values())

    def _apply_reply(self, topic: str, payload: Mapping[str, object], node: str) -> None:
        # Replies to a stop count from all nodes that must reply, others from the robot's own node only.
        reply = payload if "state" in payload and "op" in payload else rize.from_reply(payload)
        if reply is None:
            return
        if reply.get("op") == "stop":
            self._record_stop_reply(topic, reply, node)
        if not any(self._is_own_reply(robot, topic, node) for robot in self._robots.values()):
            return
        self._record_heartbeat(topic)
        if reply.get("op") == "stop":
            return
        call = self._calls.get(bounded_str(reply.get("id")))
        # The reply to a cancel has the command's id, but only the command's own reply ends it.
        if call is None or call.done or reply.get("op") not in (None, "invoke"):
            return
        state = bounded_str(reply.get("state"))
        if self._robots[call.robot].topics.reply != topic or state not in REPLY_STATES:
            return  # another robot's reply, or an invalid state
        output = reply.get("output")
        call.output = output if isinstance(output, Mapping) else {}
        call.error = safe_error_text(reply.get("error"))
        feedback = reply.get("feedback")
        call.feedback = feedback if isinstance(feedback, Mapping) and feedback else call.feedback
        call.has_started = call.has_started or state == "running"
        waits_for = reply.get("waits_for")
        call.waits_for = tuple(map(bounded_str, waits_for)) if isinstance(waits_for, list) else call.waits_for
        call.state = state
        if call.state in FINAL_STATES:
            self._calls.pop(call.id, None)
            self._motions.record_final_reply(call)

    def _is_own_reply(self, robot: Robot, topic: str, node: str) -> bool:
        if robot.topics.reply != topic:
            return False
        return robot.dialect == "rize" or self._owners.get(robot.name) == node

    def _record_heartbeat(self, topic: str) -> None:
        now = time.monotonic()
        for call in list(self._calls.values()):
            if self._robots[call.robot].topics.reply == topic:
                call.last_reply_s = now

    def _record_stop_reply(self, topic: str, reply: Mapping[str, object], node: str) -> None:
        if reply.get("state") not in ("succeeded", "failed"):
            return
        id = bounded_str(reply.get("id"))
        robots = [robot.name for robot in self._robots.values() if robot.topics.reply == topic]
        sender_robots = [
            robot.name for robot in self._robots.values() if self._is_own_reply(robot, topic, node)
        ]
        with self._stops_changed:
            is_own_stop = id in self._own_stops  # also for duplicate replies
            name, silent_nodes = self._stops.get(id, ("", set()))
            if name in robots and node in silent_nodes:
                if reply["state"] == "failed":
                    self._stop_errors[name] = stop_error_text(name, reply.get("error"))
                else:
                    silent_nodes.discard(node)
                    self._stop_errors.pop(name, None)
                if not silent_nodes:
                    del self._stops[id]
            self._stops_changed.notify_all()
        if not is_own_stop and not self._is_ending:
            for name in sender_robots:
                self._on_external_stop(name)

    def _make_command(
        self, id: str, op: str, action: str = "", input: Mapping[str, object] | None = None
    ) -> dict[str, object]:
        return {"id": id, "op": op, "from": self._program, "action": action, "input": dict(input or {})}

    def _send(self, robot: Robot, command: Mapping[str, object]) -> None:
        self._publishers[robot.topics.command].publish(command)


def _do_nothing() -> None:
    return


def _ignore(_robot: str) -> None:
    return
