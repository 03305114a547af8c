"""The robots that are there.

Found by their description, watched by their sensors, tried out by their actions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from app.core.heartbeat import Heartbeat
from app.core.known_robots import KnownRobots
from app.core.mailbox import Batch
from app.core.moving import MayNotMoveError, Moving
from app.core.rize_names import RizeNames
from app.core.robot_link import SENDER, Invocation, Payload, RobotLink, topics_of
from app.core.settings import Settings
from app.core.tries import Tries
from app.core.watches import Watch, Watches
from app.errors import AppError, DescriptionError, RobotInputError, RobotUnknownError
from app.robots import rize
from app.robots.description import Robot, parse, topic_of
from nep.errors import NepError
from nep.message import Message
from nep.nodes import Node
from nep.views import GraphView

DESCRIPTION_TYPE = "robot/description"
COMMAND_TYPE = "robot/command"


class Fleet:
    """All robots, in the order in which they came. One thread uses it (the window's)."""

    def __init__(
        self,
        watches: Watches,
        submit: Callable[[str, Callable[[Node], None]], None],
        clock: Callable[[], float] = time.monotonic,
        settings: Settings | None = None,
    ) -> None:
        """``watches`` subscribes topics, ``submit`` does something with the node in the source's thread.

        ``settings`` keep who may move and who was here; without them only until this ends.
        """
        self._watches = watches
        self._submit = submit
        self._clock = clock
        self._links: dict[str, RobotLink] = {}
        self._descriptions: dict[str, Watch] = {}
        self._named: dict[str, str] = {}
        self._rize = RizeNames()
        self._rize_events: Watch | None = None
        self._alive = Heartbeat(SENDER)
        self.moving, self.known = Moving(settings), KnownRobots(settings)
        self._tries = Tries(self._send, self._alive.rest, clock)
        self._chosen = ""
        self._told = False
        self.revision = 0

    @property
    def links(self) -> Sequence[RobotLink]:
        """All robots seen since the start, also those that are away now."""
        return tuple(self._links.values())

    @property
    def connected(self) -> tuple[RobotLink, ...]:
        """Those that are there now."""
        return tuple(link for link in self._links.values() if link.connected)

    def is_there(self, name: str) -> bool | None:
        """Whether a robot of this name is there now, also one that has not yet told what it can do.

        None while nobody has told who is there.
        """
        link = self._links.get(name)
        if (link is not None and link.connected) or topic_of(name, "description") in self._descriptions:
            return True
        return False if self._told else None

    def link(self, name: str) -> RobotLink | None:
        """The robot of that name, or None."""
        return self._links.get(name)

    @property
    def shown(self) -> RobotLink | None:
        """The robot that panels of one robot show: the chosen one, else a virtual one, else the first."""
        chosen = self._links.get(self._chosen)
        if chosen is not None and chosen.connected:
            return chosen
        there = self.connected
        return next((link for link in there if link.virtual), there[0] if there else chosen)

    def choose(self, name: str) -> None:
        """Let the panels of one robot show this one."""
        if name != self._chosen:
            self._chosen = name
            self.revision += 1

    # -- what a person does ----------------------------------------------------------------------------------

    def look_at(self, name: str) -> Watch:
        """A panel shows this robot: its sensors arrive until the watch is closed.

        Raises RobotUnknownError.
        """
        return self._watches.open(topics_of(self._get(name).robot))

    def invoke(self, name: str, action: str, input: Payload) -> Invocation:
        """Try an action.

        Raises RobotUnknownError, RobotInputError with a sentence for each wrong value, or MayNotMoveError
        when a person is to be asked first: it is tried then when the answer is yes.
        """
        link = self._get(name)
        described = link.robot.action(action)
        if described is None:
            raise RobotInputError((f"{name} can't {action}",))
        wrong = described.check(input)
        if wrong:
            raise RobotInputError(tuple(wrong))
        if not self.moving.permits([(link.robot, [action])], lambda: self._try_again(name, action, input)):
            raise MayNotMoveError([name])
        invocation = self._tries.begin(link, described, input)
        if invocation.running and link.publisher is not None and link.robot.dialect == "native":
            self._alive.beat(name, link.publisher)
        return invocation

    def _try_again(self, name: str, action: str, input: Payload) -> None:
        """Do what was asked before a person said that the robot may move."""
        try:
            self.invoke(name, action, input)
        except AppError:
            return  # it has changed or gone meanwhile, which its panel says

    def cancel(self, name: str, action: str) -> None:
        """Cancel the action that was tried last; nothing happens when it has ended."""
        self._tries.cancel(self._get(name), action)

    def world(self, name: str, change: Payload) -> None:
        """Change the world of a virtual robot: touch its head, move the ball, say a word."""
        link = self._get(name)
        if link.world is not None:
            link.world.publish(dict(change))

    def stopped(self, words: Mapping[str, str]) -> None:
        """These robots were told to stop; the words say what each did, by its name."""
        for name, said in words.items():
            link = self._links.get(name)
            if link is None:
                continue
            link.last_stop = said
            self._tries.end_all(link, "canceled")
            self._alive.rest(name)

    # -- what the session tells ------------------------------------------------------------------------------

    def update(self, view: GraphView) -> None:
        """Take over a new graph: robots come and go."""
        self._told = True
        there = {
            name
            for name, info in view.topics.items()
            if info.msg_type == DESCRIPTION_TYPE and info.publishers
        }
        for topic in there - self._descriptions.keys():
            self._descriptions[topic] = self._watches.open([topic])
        for topic in self._descriptions.keys() - there:
            self._descriptions.pop(topic).close()
            link = self._links.get(self._named.get(topic, ""))
            if link is not None:
                self._away(link)
        self._update_rize(view)

    def add(self, batches: Mapping[str, Batch]) -> None:
        """Take over what arrived: descriptions, answers, sensor values."""
        for topic, batch in batches.items():
            if topic in self._descriptions and batch.messages:
                self._describe(topic, batch)
        events = batches.get(rize.EVENTS)
        for message in events.messages if events is not None else ():
            name = rize.ready(_mapping(message))
            if name is not None:
                self._rize.tell(name)
        for link in self._links.values():
            self._read(link, batches)
        self._tries.look(self._links.values())

    def close(self) -> None:
        """End the heartbeat and the command publishers."""
        self.known.saw([link.robot for link in self.connected])
        self._alive.close()
        for link in self._links.values():
            for publisher in (link.publisher, link.world):
                if publisher is not None:
                    publisher.close()

    def unwatched(self, topic: str) -> None:
        """Nobody looks at a topic any more: what a robot told there is not known from now on."""
        for link in self._links.values():
            for sensor in link.robot.sensors:
                if sensor.topic == topic:
                    link.values.pop(sensor.name, None)

    # -- inside ----------------------------------------------------------------------------------------------

    def _get(self, name: str) -> RobotLink:
        link = self._links.get(name)
        if link is None:
            raise RobotUnknownError(name)
        return link

    def _update_rize(self, view: GraphView) -> None:
        if self._rize_events is None and rize.EVENTS in view.topics:
            self._rize_events = self._watches.open([rize.EVENTS])
        native = {link.name for link in self._links.values() if link.robot.dialect == "native"}
        there = self._rize.present(view, native)
        for name in there:
            known = self._links.get(name)
            if known is None or known.robot.dialect == "rize":
                self.join(rize.robot(name), f"{rize.COMMANDS} {name}")
        for link in self._links.values():
            if link.robot.dialect == "rize" and link.connected and link.name not in there:
                self._away(link)

    def _describe(self, topic: str, batch: Batch) -> None:
        try:
            robot = parse(_mapping(batch.messages[-1]) or {})
        except DescriptionError:
            return  # the session's alert `message:<topic>` says so
        self.join(robot, topic)

    def join(self, robot: Robot, topic: str) -> None:
        """A robot is there, known by ``topic``; said again it does nothing unless the robot changed."""
        self._named[topic] = robot.name
        link = self._links.get(robot.name)
        if link is None:
            link = self._links[robot.name] = RobotLink(robot.name, robot)
        elif link.connected and link.robot == robot:
            return
        link.robot, link.connected, link.gone_s = robot, True, None
        if link.watch is None:
            link.watch = self._watches.open([robot.topics.answer])
        self._open_publisher(link)
        self.known.saw([robot])
        self.revision += 1

    def _open_publisher(self, link: RobotLink) -> None:
        topics = link.robot.topics
        if link.publisher is not None:
            return

        def open_them(node: Node) -> None:
            native = link.robot.dialect == "native"
            link.publisher = node.new_pub(topics.command, COMMAND_TYPE if native else "json")
            if topics.world is not None:
                link.world = node.new_pub(topics.world, "json")

        self._submit(f"reach {link.name}", open_them)

    def _away(self, link: RobotLink) -> None:
        link.connected, link.gone_s = False, self._clock()
        self.known.saw([link.robot])
        self._alive.rest(link.name)
        if link.watch is not None:
            link.watch.close()
            link.watch = None
        link.mute = False
        if self.moving.question is not None and link.name in self.moving.question.moves:
            self.moving.withdraw()
        self._tries.end_all(link, "failed", f"{link.name} has gone; check that it is on")
        self.revision += 1

    def _send(self, link: RobotLink, command: Payload) -> bool:
        if link.publisher is None or not link.connected:
            return False
        try:
            link.publisher.publish(command)
        except NepError:
            return False
        return True

    def _read(self, link: RobotLink, batches: Mapping[str, Batch]) -> None:
        answers = batches.get(link.robot.topics.answer)
        for message in answers.messages if answers is not None else ():
            answer = _mapping(message)
            if answer is not None and link.robot.dialect == "rize":
                answer = rize.from_answer(answer)
            if answer is not None:
                self._tries.answer(link, answer)
        for sensor in link.robot.sensors:
            batch = batches.get(sensor.topic)
            if batch is not None and batch.messages and not sensor.is_image:
                value = _mapping(batch.messages[-1])
                if value is not None:
                    link.values[sensor.name] = value.get("value", value)
        state = batches.get(link.robot.topics.state or "")
        if state is not None and state.messages:
            link.drawing = _mapping(state.messages[-1]) or link.drawing


def _mapping(message: Message) -> Payload | None:
    try:
        value = message.payload
    except NepError:
        return None
    return value if isinstance(value, Mapping) else None
