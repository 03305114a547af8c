"""The robots that are there.

Found by their description, watched by their sensors, tried out by their actions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from app.core.network.mailbox import Batch
from app.core.network.watches import Watch, Watches
from app.core.robots.announcements import Announcements, Claim, RizeNames
from app.core.robots.command_publishers import CommandPublishers, Submit, close_publishers
from app.core.robots.known import KnownRobots
from app.core.robots.motion.gate import MotionGate, MovableRobots
from app.core.robots.motion.permission import MayNotMoveError, MotionPermission
from app.core.robots.own_messages import OwnMessages, mapping_of
from app.core.robots.reported_count import ReportedCount
from app.core.robots.robot_link import (
    FINAL_STATES,
    SENDER,
    Invocation,
    Payload,
    RobotLink,
    excess_away,
    topics_of,
)
from app.core.robots.stop.lines import MOST_TOPICS, StopTarget
from app.core.robots.stop.moved_robots import MovedRobots
from app.core.robots.stop.reach import targets_of, unlisted_targets
from app.core.robots.stop.report import STOPPING_SHOWN_AFTER_S, StopReport
from app.core.robots.tries import Tries
from app.core.storage.settings import Settings
from app.errors import AppError, RobotInputError, RobotUnknownError
from app.robots import rize
from app.robots.description.description import Robot, topic_of
from app.robots.heartbeat import Heartbeat
from app.robots.held_messages import HeldMessages
from app.robots.identity import (
    AllVirtual,
    Identity,
    RobotProcesses,
    Senders,
    foreign_topic,
    may_move,
    publishing,
    said,
    said_of_stop,
)
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message
from nep.programs.robots.moving import MovingTopics
from nep.protocol.graph_view import GraphView

MAX_HELD = 64
"""Answers of one publisher that no master has told of yet, kept until the next graph."""
BEGINS_AT_START = "runs_begin_at_start"


class Fleet:
    """All robots, in the order in which they came. One thread uses it (the window's)."""

    def __init__(
        self,
        watches: Watches,
        submit: Submit,
        clock: Callable[[], float] = time.monotonic,
        settings: Settings | None = None,
        processes: RobotProcesses | None = None,
    ) -> None:
        """``watches`` subscribes topics, ``submit`` does something with the node in the source's thread.

        ``settings`` keep who may move and who was here; without them only until this ends. ``processes`` know
        which robots are virtual; without them every robot is that says so.
        """
        self._watches = watches
        self._publishers = CommandPublishers(submit)
        self._clock = clock
        self._links: dict[str, RobotLink] = {}
        self._processes = processes if processes is not None else AllVirtual()
        self._senders = Senders()
        self._own = OwnMessages(self._senders, self._links)
        self._announcements = Announcements(watches, self._senders, clock, self._is_proven)
        self._unlisted: tuple[StopTarget, ...] = ()
        self._settings = settings
        self._names: dict[str, str] = {}
        self._view = GraphView(0, 0)
        self._held: dict[str, HeldMessages] = {}
        self._taken: dict[str, Claim] = {}
        self._notes: list[str] = []
        self._rize = RizeNames()
        self._rize_events: Watch | None = None
        self._alive = Heartbeat(SENDER, "studio-alive")
        self.permission = MotionPermission(settings, self._identity_of)
        self.known = KnownRobots(settings)
        self._movable = MovableRobots(self._links, self._names)
        self.gate = MotionGate(self.permission, self._movable)
        self.moved = MovedRobots(
            self._identity_of, self._processes.has_ended, clock, self._own.other_programs
        )
        """Which robots a Stop must name."""
        self._tries = Tries(self._send, self._alive.rest, clock)
        self._chosen = ""
        self._told = False
        self._settled: dict[str, None] = {}
        self.revision = 0
        self.stops = 0
        """How often robots were told to stop."""
        self.used: Callable[[], Collection[str]] = tuple
        """Returns the names of the robots that the running program uses."""

    @property
    def links(self) -> Sequence[RobotLink]:
        """All robots seen since the start, also those that are away now."""
        return tuple(self._links.values())

    @property
    def connected(self) -> tuple[RobotLink, ...]:
        """Those that are there now."""
        return tuple(link for link in self._links.values() if link.connected)

    @property
    def moving(self) -> MovingTopics:
        """The topics that move robots now, also robots whose descriptions could not be read."""
        return self._movable.moving

    def is_there(self, name: str) -> bool | None:
        """Whether a robot of this name is there now, also one that has not yet told what it can do.

        None while nobody has told who is there.
        """
        link = self._links.get(name)
        if (link is not None and link.connected) or self._announcements.is_announced(
            topic_of(name, "description")
        ):
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
            raise RobotInputError((_("{robot} can't {action}").format(robot=name, action=action),))
        wrong = described.check(input)
        if wrong:
            raise RobotInputError(wrong, described.problems(input))
        if not self.permission.permits(
            [(link.robot, [action])], lambda: self._try_again(name, action, input)
        ):
            raise MayNotMoveError([name])
        invocation = self._tries.begin(link, described, input)
        if invocation.running:  # a speed goes on after its final answer: only a Stop ends it
            self.moved.note([name], "form", id="" if described.repeat_s is not None else invocation.id)
        if invocation.running and link.publisher is not None and link.robot.dialect == "native":
            self._alive.beat(name, link.publisher.publish)
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
        """Change the world of a virtual robot: touch its head, move the ball, say a word.

        Of one that Studio does not know to be virtual a person is asked first, as before it moves.
        """
        link = self._get(name)
        actions = [action.name for action in link.robot.actions]
        may = self.permission.permits([(link.robot, actions)], lambda: self._change_again(name, change))
        if may and link.world is not None:
            link.world.publish(dict(change))

    @property
    def begins_at_start(self) -> bool:
        """Whether virtual robots go back to where they stood at first when a behaviour begins."""
        return self._settings is None or self._settings.get(BEGINS_AT_START, True)

    def choose_start(self, *, begins: bool) -> None:
        """Choose whether they do. Raises SettingsError when that can't be kept."""
        if self._settings is not None:
            self._settings.set(BEGINS_AT_START, begins)

    def to_start(self, names: Iterable[str]) -> None:
        """Put the virtual robots among these back to where they stood at first, if the person wants that."""
        links = [link for name in names if (link := self._links.get(name)) is not None and link.virtual]
        for link in links if self.begins_at_start else ():
            if link.world is not None:
                link.world.publish({"start": [each.name for each in links]})

    def _change_again(self, name: str, change: Payload) -> None:
        """Do what was asked before a person said that the robot may move."""
        if name in self._links:
            self.world(name, change)

    def told_to_stop(self, names: Iterable[str]) -> None:
        """These robots are being told to stop; `stopped` says what each did."""
        self.stops += 1
        for link in map(self._links.get, names):
            if link is not None and link.stop_began_s is None:
                link.stop_began_s = self._clock()

    @property
    def stopping(self) -> tuple[str, ...]:
        """Those that were told to stop and have not answered yet."""
        return tuple(link.name for link in self._links.values() if link.stop_began_s is not None)

    @property
    def unheard(self) -> tuple[str, ...]:
        """Robots that may move and can't be heard: every Stop names them."""
        return tuple(name for name in self.moved.names if not self._is_heard(self._links.get(name)))

    @property
    def stoppable(self) -> tuple[str, ...]:
        """The robots that a Stop of all robots tells and waits for."""
        unlisted = (target.robot.name for target in self._unlisted if target.is_expected)
        return tuple(dict.fromkeys((*(link.name for link in self.connected), *self.moved.names, *unlisted)))

    @property
    def stop_targets(self) -> tuple[StopTarget, ...]:
        """Where robots are told to stop, also those that nobody waits for."""
        return targets_of(self._links.values(), self.moved, self._unlisted)

    @staticmethod
    def _is_heard(link: RobotLink | None) -> bool:
        return link is not None and link.connected and not link.mute

    def stopped(self, words: Mapping[str, tuple[str, str]], report: StopReport) -> None:
        """Take over what robots did with a Stop; ``words`` say it by robot, each with its status.

        What a robot that is not proven to stand still was asked ends when it says so itself.
        """
        wrong = {name: robot.wrong for name, robot in report.by_name.items()}
        for name, (last_stop, status) in words.items():
            link = self._links.get(name)
            if link is None:
                continue
            link.last_stop, link.last_stop_status = last_stop, status
            link.not_stopped = wrong.get(name, "")
            link.stop_began_s, link.stopping = None, False
            link.has_proven_stop |= name in report.still
            if not link.not_stopped:
                self._tries.end_all(link, "canceled")
            self._alive.rest(name)

    def stands_still(self, names: Iterable[str]) -> None:
        """Take the word of a person that these robots stand still."""
        known = tuple(names)
        self.moved.confirm(known)
        for link in map(self._links.get, known):
            if link is not None:
                link.not_stopped = ""
                self._judge_motion(link)

    def take_settled(self) -> tuple[str, ...]:
        """The robots that were not stopped and have ended now, as they say, what would not end; once each."""
        settled, self._settled = tuple(self._settled), {}
        return settled

    # -- what the session tells ------------------------------------------------------------------------------

    def update(self, view: GraphView) -> None:
        """Take over a new graph: robots come and go."""
        self._told = True
        before, self._view = self._view, view
        self._movable.view = view
        self._own.update(view)
        self._announcements.update(view)
        topics = (self._own.topics(link.robot) for link in self._links.values())
        self._senders.learn(view, {rize.ANSWERS}.union(*topics))
        self._follow_announced()
        known = self._announcements
        self._unlisted = (
            *unlisted_targets(view, known.left_out),
            *unlisted_targets(view, known.unreadable, is_expected=False),
        )
        self._update_rize(view)
        told = map(self._links.get, self.moved.sent_to)
        self.moved.take_newcomers({link.name: self._own.newcomers(link, before) for link in told if link})
        held, self._held = self._held, {}
        for name, messages in held.items():
            link = self._links.get(name)
            for message in messages.take() if link is not None else ():
                if link is not None and self._own.is_from(link, message):
                    self._answer(link, message)
        for link in self._links.values():
            if link.connected and link.publisher is None:
                self._publishers.open(link)
        self._forget_away()

    def add(self, batches: Mapping[str, Batch]) -> None:
        """Take over what arrived: descriptions, answers, sensor values."""
        if self._announcements.add(batches):
            self._follow_announced()
            self._forget_away()
        events = batches.get(rize.EVENTS)
        for message in events.messages if events is not None else ():
            name = rize.ready(mapping_of(message))
            if name is not None:
                self._rize.tell(name)
        for link in self._links.values():
            self._read(link, batches)
            began_s = link.stop_began_s
            link.stopping = began_s is not None and self._clock() - began_s >= STOPPING_SHOWN_AFTER_S
        self._tries.look(self._links.values())
        self.gate.follow()
        for link in self._links.values():
            self._judge_motion(link)

    @property
    def claims(self) -> Mapping[str, Claim]:
        """What programs say of themselves and is not believed, by an id."""
        return {**self._announcements.claims, **self._taken}

    def take_notes(self) -> tuple[str, ...]:
        """What a person may want to read: a robot was started anew. Each once."""
        notes, self._notes = tuple(self._notes), []
        return notes

    def close(self) -> None:
        """End the heartbeat and the command publishers."""
        self.known.saw([link.robot for link in self.connected])
        self._alive.close()
        for link in self._links.values():
            close_publishers(link)

    def unwatched(self, topic: str) -> None:
        """Nobody looks at a topic any more: what a robot told there is not known from now on."""
        for link in self._links.values():
            for sensor in link.robot.sensors:
                if sensor.topic == topic:
                    link.values.pop(sensor.name, None)

    # -- inside ----------------------------------------------------------------------------------------------

    def _identity_of(self, name: str) -> Identity | None:
        link = self._links.get(name)
        return None if link is None else link.identity

    def _drop_ended(self, link: RobotLink) -> None:
        """A virtual robot is its program: what an ended one did moves no more."""
        if link.virtual and link.name in self.moved:
            self.moved.drop_ended(link.name)
            link.not_stopped = link.not_stopped if link.name in self.moved else ""

    def _judge_motion(self, link: RobotLink) -> None:
        """Say of a robot that may move and can't be heard why nobody knows that it stands still."""
        if not link.connected:
            self._drop_ended(link)
        motion = self.moved.motion(link.name)
        link.may_move = motion.sentence if motion is not None and not self._is_heard(link) else ""

    def _is_proven(self, topic: str) -> bool:
        link = self._links.get(self._names.get(topic, ""))
        return link is not None and (link.has_proven_stop or link.name in self.moved)

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

    def _follow_announced(self) -> None:
        """Join whom the announcements name; whose program is not there any more has gone."""
        found = {topic: (robot, identity) for topic, robot, identity in self._announcements.robots}
        for topic, name in list(self._names.items()):
            link, now = self._links.get(name), found.get(topic)
            if link is None or not link.connected:
                continue
            is_same = now is not None and now[0].name == name and now[1] == link.identity
            if not is_same and not (now is None and self._is_unread(topic, link)):
                self._away(link)
        for topic in self._taken.keys() - found.keys():
            del self._taken[topic]
        for topic, (robot, identity) in found.items():
            claim = self._foreign(robot)
            if claim is None:
                self._taken.pop(topic, None)
                self.join(robot, topic, identity)
                continue
            self._taken[topic] = claim
            link = self._links.get(robot.name)
            if link is not None and link.connected:
                self._away(link)

    def _is_unread(self, topic: str, link: RobotLink) -> bool:
        """Whether its program still announces it there, in words that can't be read just now."""
        there = publishing(self._view, topic)
        return link.identity is not None and link.identity.node_id in there

    def _foreign(self, robot: Robot) -> Claim | None:
        """Why a robot can't have the topics that it names: they are another robot's."""
        why = foreign_topic(robot, (link.robot for link in self._links.values()))
        if why is None:
            return None
        return Claim(
            f"{why}.",
            _("{robot} is left out. Find out what this program is and close it.").format(robot=robot.name),
        )

    def join(self, robot: Robot, topic: str, identity: Identity | None = None) -> None:
        """A robot is there, known by ``topic``; said again it does nothing unless the robot changed."""
        link = self._links.get(robot.name)
        was_real = not robot.virtual or (link is not None and link.identity == identity and link.was_real)
        if identity is not None:
            self._names[topic] = robot.name
            is_virtual = not was_real and self._processes.is_ours(identity)
            robot = replace(robot, virtual=is_virtual)
        if link is None:
            link = self._links[robot.name] = RobotLink(robot.name, robot)
        elif link.connected and link.robot == robot and link.identity == identity:
            return
        self._take_identity(link, identity)
        link.was_real = was_real
        before, link.robot = link.robot, robot
        link.connected, link.gone_s = True, None
        if before.topics != robot.topics or before.dialect != robot.dialect:
            if before.dialect == robot.dialect:
                known = dict.fromkeys((*link.topics_before, before.topics))
                link.topics_before = tuple(known)[:MOST_TOPICS]
            self._leave_topics(link)
        if link.watch is None:
            link.watch = self._watches.open([robot.topics.answer])
        self._senders.learn(self._view, self._own.topics(robot))
        self._publishers.open(link)
        self.known.saw([robot])
        self.revision += 1

    def _take_identity(self, link: RobotLink, identity: Identity | None) -> None:
        """It is this program now; the one before may still run somewhere and move the robot."""
        before, link.identity = link.identity, identity
        if before is None or identity is None or before.node_id == identity.node_id:
            return
        link.rejected, link.errors = ReportedCount(), ReportedCount()
        self._notes.append(
            _("{robot} was started anew: it is {now} now, before {before}").format(
                robot=link.name, now=identity.words, before=before.words
            )
        )
        self._keep_going(link, before)
        self._drop_ended(link)

    def _leave_topics(self, link: RobotLink) -> None:
        """Its description names other topics: what was asked on the old ones has ended."""
        self._alive.rest(link.name)
        self._tries.end_all(link, "failed", _("{robot} has changed; try it again").format(robot=link.name))
        if link.watch is not None:
            link.watch.close()
            link.watch = None
        self._publishers.leave(link)

    def _keep_going(self, link: RobotLink, program: Identity | None) -> None:
        """Enter what the robot itself could not end: from here on nobody hears whether it has."""
        if link.goes_on and not link.virtual:  # a virtual robot is its program
            self.moved.note([link.name], "action", program=program)
            link.not_stopped = link.not_stopped or link.goes_on
        link.goes_on = ""

    def _away(self, link: RobotLink) -> None:
        link.connected, link.gone_s = False, self._clock()
        self._keep_going(link, link.identity)
        self.known.saw([link.robot])
        self._alive.rest(link.name)
        if link.watch is not None:
            link.watch.close()
            link.watch = None
        link.mute = False
        if self.permission.question is not None and link.name in self.permission.question.moves:
            self.permission.withdraw()
        self._tries.end_all(
            link, "failed", _("{robot} has gone; check that it is on").format(robot=link.name)
        )
        self.revision += 1

    def _forget_away(self) -> None:
        """Forget robots that are away, beyond a limit: strangers can announce any number of names."""
        in_use = {self._chosen, *self.used(), *self.moved.names}
        for link in excess_away(self._links.values(), in_use):
            del self._links[link.name]
            for topic in [topic for topic, name in self._names.items() if name == link.name]:
                del self._names[topic]
            self._held.pop(link.name, None)
            self._publishers.end(link)
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
            is_own = self._own.is_from(link, message)
            if is_own:
                self._answer(link, message)
            elif is_own is None:
                self._held.setdefault(link.name, HeldMessages(per_publisher=MAX_HELD)).put(message)
        for sensor in link.robot.sensors:
            if sensor.is_image:
                continue
            value = self._own.newest(link, batches.get(sensor.topic), sensor.topic)
            if value is not None:
                link.values[sensor.name] = value.get("value", value)
        topic = link.robot.topics.state or ""
        link.drawing = self._own.newest(link, batches.get(topic), topic) or link.drawing

    def _answer(self, link: RobotLink, message: Message) -> None:
        answer = mapping_of(message)
        if answer is not None and link.robot.dialect == "rize":
            answer = rize.from_answer(answer)
        if answer is not None:
            self._tries.answer(link, answer)
            if answer.get("op") == "alive":
                self._take_life(link, answer)
            else:
                self._take_end(link, answer)

    def _take_end(self, link: RobotLink, answer: Payload) -> None:
        """Take a final answer: it ends a motion, unless the robot says that it may still move."""
        state = answer.get("state")
        if not isinstance(state, str) or state not in FINAL_STATES:
            return
        if answer.get("op") not in (None, "invoke"):
            return
        id, error = answer.get("id"), answer.get("error")
        if isinstance(id, str) and not may_move(link.name, said(error) if error else ""):
            self.moved.ended(link.name, id, link.identity)

    def _take_life(self, link: RobotLink, answer: Payload) -> None:
        """Take a robot's sign of life: counts, which are left out when zero, and actions that did not end."""
        now_s = self._clock()
        link.rejected.take(answer.get("rejected", 0), now_s)
        link.errors.take(answer.get("errors", 0), now_s)
        if "not_ended" not in answer:
            return
        before, link.goes_on = link.goes_on, ""
        if answer["not_ended"]:
            link.goes_on = said_of_stop(link.name, answer.get("error") or _("an action has not ended"))
        elif before and link.not_stopped:
            self._settled[link.name] = None
