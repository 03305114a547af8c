"""Robots and topics of a running program, over NEP. Only a program's own process imports this."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager

from app.blocks.going import Going
from app.blocks.link import LAST_STATES, STATES, Call
from app.blocks.wire import Node, Publisher, new_id, payload_of, value_of
from app.robots import rize
from app.robots.description import Robot
from nep.errors import NepError
from nep.message import Message

ALIVE_S = 0.2

Told = Callable[[object], None]


class Network:
    """The link of a program. All publishers and subscribers that it needs exist when the constructor returns.

    `sensors` and `events` are (robot, name), `publishes` and `listens` are topics; others are made at first
    use.
    """

    def __init__(
        self,
        node: Node,
        program: str,
        robots: Sequence[Robot],
        *,
        sensors: Iterable[tuple[str, str]] = (),
        events: Iterable[tuple[str, str]] = (),
        publishes: Iterable[str] = (),
        listens: Iterable[str] = (),
    ) -> None:
        self._node = node
        self._program = program
        self._robots = {robot.name: robot for robot in robots}
        self._lock = threading.RLock()
        self._calls: dict[str, Call] = {}
        self._stops: dict[str, str] = {}  # stop's id -> robot, until it has answered
        self._own_stops: set[str] = set()
        self._newest: dict[str, Message] = {}
        self._told: dict[str, list[Told]] = {}
        self._subscribed: set[str] = set()
        self._publishers: dict[str, Publisher] = {}
        self._poke: Callable[[], None] = _nothing
        self._stopped_outside: Callable[[str], None] = _ignore
        self._arrived = threading.Condition()
        self._closed = threading.Event()
        self._ending = False
        self._going = Going(self._rest, self._stand, self.invoke)
        for robot in robots:
            self._meet(robot)
        for name, sensor in (*sensors, *events):
            self._subscribe(self._topic(name, sensor))
        for topic in publishes:
            self._publisher(topic)
        for topic in listens:
            self._subscribe(topic)
        self._alive = threading.Thread(target=self._beat, name="program alive", daemon=True)
        self._alive.start()

    def _meet(self, robot: Robot) -> None:
        self._publisher(robot.topics.command, "json" if robot.dialect == "rize" else "robot/command")
        type_ = "json" if robot.dialect == "rize" else "robot/answer"
        with self._lock:
            topic = robot.topics.answer
            if topic not in self._subscribed:
                self._subscribed.add(topic)
                self._node.new_sub(topic, type_, sink=self._answers)

    def close(self) -> None:
        """End the heartbeat; the node is closed by who made it."""
        self._closed.set()
        self._alive.join(timeout=1.0)

    # ---- Link

    def listen(self, poke: Callable[[], None], stopped_outside: Callable[[str], None]) -> None:
        """Tell of every answer and message, and of stops that are not ours."""
        self._poke, self._stopped_outside = poke, stopped_outside

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> Call:
        """Send a command; the call changes as answers arrive."""
        described = self._robots[robot]
        call = Call(new_id("cmd"), robot, action)
        with self._lock:
            self._calls[call.id] = call
        self._going.asked(call, described, input)
        if described.dialect == "rize":
            self._send(described, rize.to_command(described, action, input, call.id))
        else:
            self._send(described, self._command(call.id, "invoke", action, input))
        return call

    def cancel(self, call: Call) -> None:
        """Take a command back; RIZE robots know no such thing."""
        described = self._robots[call.robot]
        if described.dialect != "rize":
            self._send(described, self._command(call.id, "cancel", call.action))

    def sensor(self, robot: str, name: str) -> object:
        """The newest value, of a property's ``{"value": …}`` or the object itself."""
        topic = self._topic(robot, name)
        self._subscribe(topic)
        message = self._newest.get(topic)
        return None if message is None else value_of(payload_of(message))

    def newest(self, topic: str) -> object:
        """The newest message, decoded only now."""
        self._subscribe(topic)
        message = self._newest.get(topic)
        return None if message is None else payload_of(message)

    def publish(self, topic: str, payload: object) -> None:
        """Send a message as JSON."""
        self._publisher(topic).publish(payload)

    def on_sensor(self, robot: str, name: str, told: Told) -> None:
        """Tell each value of a sensor."""
        self.on_message(self._topic(robot, name), lambda payload: told(value_of(payload)))

    def on_event(self, robot: str, name: str, told: Told) -> None:
        """Tell the data of each event."""
        self.on_message(self._topic(robot, name), told)

    def on_message(self, topic: str, told: Told) -> None:
        """Tell each message."""
        with self._lock:
            self._told.setdefault(topic, []).append(told)
        self._subscribe(topic)

    # ---- stopping

    def rest(self) -> None:
        """The program is paused: robots that it left in motion (a speed) stand still until `go_on`."""
        self._going.rest()

    def go_on(self) -> None:
        """The pause is over: what was in motion is asked for again."""
        self._going.go_on()

    def slow(self) -> AbstractContextManager[None]:
        """While the calling script stays at a block in slow motion: what it left in motion stands still."""
        return self._going.slow()

    def _stand(self, robot: Robot) -> None:
        """Stop a robot that drives; not while it does something else, which a stop would end as well."""
        busy = [call for call in list(self._calls.values()) if call.robot == robot.name]
        if all(self._going.is_motion(call) for call in busy):
            self._tell_stop(robot)

    def _rest(self, robot: Robot) -> None:
        """Stop one robot; what else it does ends as if the pause had taken it back."""
        for call in list(self._calls.values()):
            call.held = call.held or call.robot == robot.name
        self._tell_stop(robot)

    def _tell_stop(self, robot: Robot) -> None:
        id = new_id("stop")
        with self._arrived:
            self._own_stops.add(id)
            self._stops[id] = robot.name
        self._send(robot, self._command(id, "stop", robot.safe_stop.action))

    def stop_robots(self, timeout_s: float) -> tuple[str, ...]:
        """Tell every robot to stop and wait; the names of those that did not answer (RIZE's can't)."""
        self._ending = True
        for robot in self._robots.values():
            if robot.dialect == "rize":
                continue
            self._tell_stop(robot)
        with self._arrived:
            self._arrived.wait_for(lambda: not self._stops, timeout_s)
        return tuple(self._stops.values())

    # ---- inside

    def _topic(self, robot: str, name: str) -> str:
        described = self._robots[robot]
        found = described.sensor(name) or described.event(name)
        if found is None:
            raise KeyError(name)
        return found.topic

    def _publisher(self, topic: str, msg_type: str = "json") -> Publisher:
        with self._lock:
            if topic not in self._publishers:
                self._publishers[topic] = self._node.new_pub(topic, msg_type)
            return self._publishers[topic]

    def _subscribe(self, topic: str) -> None:
        with self._lock:
            if topic in self._subscribed:
                return
            self._subscribed.add(topic)
        self._node.new_sub(topic, sink=self._messages)

    def _messages(self, messages: Sequence[Message]) -> None:
        for message in messages:
            self._newest[message.topic] = message
            for told in self._told.get(message.topic, ()):
                payload = payload_of(message)
                if payload is not None:
                    told(payload)
        self._poke()

    def _answers(self, messages: Sequence[Message]) -> None:
        for message in messages:
            payload = payload_of(message)
            if isinstance(payload, Mapping):
                self._answer(message.topic, payload)
        self._poke()

    def _answer(self, topic: str, told: Mapping[str, object]) -> None:
        answer = told if "state" in told and "op" in told else rize.from_answer(told)
        if answer is None:
            return
        self._hear(topic)
        if answer.get("op") == "stop":
            self._stop_answered(topic, answer)
            return
        call = self._calls.get(str(answer.get("id")))
        # A cancel is answered with the id of the command it was for; only the command's own answer ends it.
        if call is None or call.done or answer.get("op") not in (None, "invoke"):
            return
        state = str(answer.get("state"))
        if self._robots[call.robot].topics.answer != topic or state not in STATES:
            return  # another robot's answer, or no word of a robot
        output = answer.get("output")
        call.output = output if isinstance(output, Mapping) else {}
        call.error = str(answer.get("error") or "")
        feedback = answer.get("feedback")
        call.feedback = feedback if isinstance(feedback, Mapping) and feedback else call.feedback
        call.began = call.began or state == "running"
        waits_for = answer.get("waits_for")
        call.waits_for = tuple(map(str, waits_for)) if isinstance(waits_for, list) else call.waits_for
        call.state = state
        if call.state in LAST_STATES:
            self._calls.pop(call.id, None)
            self._going.ended(call)

    def _hear(self, topic: str) -> None:
        """A robot has said something: whoever waits for it knows that it lives."""
        now = time.monotonic()
        for call in list(self._calls.values()):
            if self._robots[call.robot].topics.answer == topic:
                call.heard_s = now

    def _stop_answered(self, topic: str, answer: Mapping[str, object]) -> None:
        if answer.get("state") not in ("succeeded", "failed"):
            return
        id = str(answer.get("id"))
        robots = [robot.name for robot in self._robots.values() if robot.topics.answer == topic]
        with self._arrived:
            ours = id in self._own_stops  # also when it is answered twice
            if answer["state"] == "succeeded" and self._stops.get(id) in robots:
                del self._stops[id]
            self._arrived.notify_all()
        if not ours and not self._ending:
            for name in robots:
                self._stopped_outside(name)

    def _command(
        self, id: str, op: str, action: str = "", input: Mapping[str, object] | None = None
    ) -> dict[str, object]:
        return {"id": id, "op": op, "from": self._program, "action": action, "input": dict(input or {})}

    def _send(self, robot: Robot, command: Mapping[str, object]) -> None:
        self._publishers[robot.topics.command].publish(command)

    def _beat(self) -> None:
        """Say five times a second that the program lives; robots stop by themselves without it."""
        while not self._closed.wait(ALIVE_S):
            for robot in self._robots.values():
                if robot.dialect == "rize":
                    continue
                try:
                    self._send(robot, self._command(new_id("alive"), "alive"))
                except NepError:
                    return


def _nothing() -> None:
    return


def _ignore(_robot: str) -> None:
    return
