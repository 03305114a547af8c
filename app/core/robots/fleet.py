"""Robots on the network, found by their descriptions, with their sensor values and actions."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from app.core.network.mailbox import Batch
from app.core.network.watches import Watch, Watches
from app.core.robots.command_publishers import CommandPublishers, Submit, close_publishers
from app.core.robots.invocations import ManualInvocations
from app.core.robots.known_robots import KnownRobots
from app.core.robots.motion.gate import MotionGate, MovableRobots
from app.core.robots.motion.permission import MayNotMoveError, MotionPermission
from app.core.robots.own_messages import OwnMessageFilter, decode_mapping
from app.core.robots.reported_count import ReportedCount
from app.core.robots.robot_link import (
    SENDER,
    Invocation,
    RobotLink,
    excess_disconnected,
    topics_of,
)
from app.core.robots.robot_messages import RobotMessages
from app.core.robots.stop.moved_robots import MovedRobots
from app.core.robots.stop.reach import targets_of, unlisted_targets
from app.core.robots.stop.report import STOPPING_DISPLAY_DELAY_S
from app.core.storage.settings import Settings
from app.errors import AppError, RobotInputError, UnknownRobotError
from app.robots.client import rize
from app.robots.client.announcements import Announcements, Claim, RizeNames, foreign_topic_claim
from app.robots.client.dialects import dialect_of
from app.robots.client.heartbeat import Heartbeat
from app.robots.client.inbox import Senders
from app.robots.client.limits import MAX_STOP_TOPICS
from app.robots.client.reply import Payload
from app.robots.client.stop import StopTarget
from app.robots.client.stop_report import StopReport
from app.robots.description.description import Robot, topic_of
from app.robots.identity import AllVirtualProcesses, Identity, RobotProcesses, publisher_nodes
from nep.errors import NepError
from nep.i18n import _
from nep.programs.robots.moving import MovingTopics
from nep.protocol.graph_view import GraphView


class Fleet:
    """All robots, in order of discovery. Not thread-safe; use it from the main thread."""

    def __init__(
        self,
        watches: Watches,
        submit: Submit,
        clock: Callable[[], float] = time.monotonic,
        settings: Settings | None = None,
        processes: RobotProcesses | None = None,
    ) -> None:
        # `processes` distinguish virtual from real robots; without them a robot's own description decides.
        self._watches = watches
        self._publishers = CommandPublishers(submit)
        self._clock = clock
        self._links: dict[str, RobotLink] = {}
        self._processes = processes if processes is not None else AllVirtualProcesses()
        self._senders = Senders()
        self._own_filter = OwnMessageFilter(self._senders, self._links)
        self._announcements = Announcements(watches, self._senders, clock, self._must_keep_topic)
        self._unlisted_targets: tuple[StopTarget, ...] = ()
        self._settings = settings
        self._names_by_topic: dict[str, str] = {}
        self._foreign_claims: dict[str, Claim] = {}
        self._notices: list[str] = []
        self._rize_names = RizeNames()
        self._rize_events: Watch | None = None
        self._heartbeat = Heartbeat(SENDER, "studio-alive")
        self.permission = MotionPermission(settings, self._identity_of)
        self.known_robots = KnownRobots(settings)
        self._movable_robots = MovableRobots(self._links, self._names_by_topic)
        self.gate = MotionGate(self.permission, self._movable_robots)
        has_ended = self._processes.has_ended
        self.moved = MovedRobots(self._identity_of, has_ended, clock, self._own_filter.other_programs)
        """Robots that may move, and so must be named by a Stop."""
        self._invocations = ManualInvocations(self._send, self._heartbeat.stop, clock)
        self._messages = RobotMessages(self._senders, self._own_filter, self._invocations, self.moved, clock)
        self._selected_name = ""
        self._has_graph = False
        self.revision = 0
        self.stop_count = 0
        """Number of stops sent to robots so far."""
        self.robots_in_use: Callable[[], Collection[str]] = tuple
        """Returns the names of the robots that the running program uses."""

    @property
    def links(self) -> Sequence[RobotLink]:
        """All known robots in order of discovery, including disconnected ones until they are evicted."""
        return tuple(self._links.values())

    @property
    def connected(self) -> tuple[RobotLink, ...]:
        """Connected robots."""
        return tuple(link for link in self._links.values() if link.is_connected)

    @property
    def moving_topics(self) -> MovingTopics:
        """Topics whose messages move robots, including robots whose descriptions can't be read."""
        return self._movable_robots.moving_topics

    def is_present(self, name: str) -> bool | None:
        """Return True if a robot with this name is connected or announced; None before the first graph."""
        link = self._links.get(name)
        if (link is not None and link.is_connected) or self._announcements.is_announced(
            topic_of(name, "description")
        ):
            return True
        return False if self._has_graph else None

    def link(self, name: str) -> RobotLink | None:
        """Return the robot with this name, even if it is disconnected; None if the name is unknown."""
        return self._links.get(name)

    @property
    def current(self) -> RobotLink | None:
        """Robot shown by panels that display a single robot, or None if there is none.

        This is the chosen robot if it is connected, else a connected virtual robot, else the first
        connected robot, else the chosen robot although it is disconnected.
        """
        chosen = self._links.get(self._selected_name)
        if chosen is not None and chosen.is_connected:
            return chosen
        connected = self.connected
        return next((link for link in connected if link.is_virtual), connected[0] if connected else chosen)

    def select(self, name: str) -> None:
        """Select the robot for panels that display a single robot."""
        if name != self._selected_name:
            self._selected_name = name
            self.revision += 1

    # -- commands of the user --------------------------------------------------------------------------------

    def watch_sensors(self, name: str) -> Watch:
        """Subscribe to the sensors of a robot; return the watch, which must be closed.

        Raises:
            UnknownRobotError: No robot has this name.
        """
        return self._watches.open(topics_of(self._get_link(name).robot))

    def invoke(self, name: str, action: str, input: Payload) -> Invocation:
        """Send an action to a robot.

        Args:
            name: Name of the robot.
            action: Name of the action.
            input: Input of the action.

        Raises:
            UnknownRobotError: No robot has this name.
            RobotInputError: The robot lacks the action or rejects the input; contains a message for
                each invalid value.
            MayNotMoveError: The user is asked to allow the motion. If the user allows it, the action is
                sent.
        """
        link = self._get_link(name)
        description = link.robot.action(action)
        if description is None:
            raise RobotInputError((_("{robot} has no action “{action}”").format(robot=name, action=action),))
        problems = description.check(input)
        if problems:
            raise RobotInputError(problems, description.problems(input))
        if not self.permission.request_permission(
            [(link.robot, [action])], lambda: self._retry_invoke(name, action, input)
        ):
            raise MayNotMoveError([name])
        invocation = self._invocations.start(link, description, input)
        if invocation.is_running:  # a speed continues after its final reply: only a Stop ends it
            self.moved.record_command(
                [name], "form", id="" if description.repeat_s is not None else invocation.id
            )
        if invocation.is_running and link.publisher is not None and dialect_of(link.robot).is_identified:
            self._heartbeat.start(name, link.publisher.publish)
        return invocation

    def _retry_invoke(self, name: str, action: str, input: Payload) -> None:
        try:
            self.invoke(name, action, input)
        except AppError:
            return  # the robot changed or disconnected meanwhile, which its panel shows

    def cancel(self, name: str, action: str) -> None:
        """Cancel the last invocation of an action, if it is still running.

        Raises:
            UnknownRobotError: No robot has this name.
        """
        self._invocations.cancel(self._get_link(name), action)

    def change_world(self, name: str, change: Payload) -> None:
        """Change the world of a virtual robot, for example touch its head, move the ball or say a word.

        If Studio doesn't know that the robot is virtual, the user must allow the change like a motion. The
        change is discarded while no publisher for the world topic is open.

        Args:
            name: Name of the robot.
            change: Message for the world topic.

        Raises:
            UnknownRobotError: No robot has this name.
        """
        link = self._get_link(name)
        actions = [action.name for action in link.robot.actions]
        is_allowed = self.permission.request_permission(
            [(link.robot, actions)], lambda: self._retry_change(name, change)
        )
        if is_allowed and link.world_publisher is not None:
            link.world_publisher.publish(dict(change))

    @property
    def resets_at_start(self) -> bool:
        """True if virtual robots move to their start position when a behaviour starts."""
        return self._settings is None or self._settings.resets_robots

    def set_resets_at_start(self, *, is_enabled: bool) -> None:
        """Set and save `resets_at_start`; without settings, do nothing.

        Raises SettingsError if the settings can't be written.
        """
        if self._settings is not None:
            self._settings.resets_robots = is_enabled

    def return_to_start(self, names: Iterable[str]) -> None:
        """If `resets_at_start` is set, move the virtual robots among ``names`` to their start position."""
        links = [link for name in names if (link := self._links.get(name)) is not None and link.is_virtual]
        for link in links if self.resets_at_start else ():
            if link.world_publisher is not None:
                link.world_publisher.publish({"start": [each.name for each in links]})

    def _retry_change(self, name: str, change: Payload) -> None:
        if name in self._links:
            self.change_world(name, change)

    def mark_stopping(self, names: Iterable[str]) -> None:
        """Set robots to the state "stopping", until `apply_stop` applies the result of the Stop."""
        self.stop_count += 1
        for link in map(self._links.get, names):
            if link is not None and link.pending_stop_start_s is None:
                link.pending_stop_start_s = self._clock()

    @property
    def stopping_robots(self) -> tuple[str, ...]:
        """Names of robots that have not replied to a Stop yet."""
        return tuple(link.name for link in self._links.values() if link.pending_stop_start_s is not None)

    @property
    def unresponsive_robots(self) -> tuple[str, ...]:
        """Names of robots that may be moving and don't reply. Every Stop reports these robots."""
        return tuple(name for name in self.moved.names if not self._is_responsive(self._links.get(name)))

    @property
    def stoppable_robots(self) -> tuple[str, ...]:
        """Names of the robots whose replies a Stop of all robots waits for."""
        unlisted = (target.robot.name for target in self._unlisted_targets if target.is_expected)
        return tuple(dict.fromkeys((*(link.name for link in self.connected), *self.moved.names, *unlisted)))

    @property
    def stop_targets(self) -> tuple[StopTarget, ...]:
        """Targets of a Stop of all robots, including robots whose replies are not awaited."""
        return targets_of(self._links.values(), self.moved, self._unlisted_targets)

    @staticmethod
    def _is_responsive(link: RobotLink | None) -> bool:
        return link is not None and link.is_connected and not link.is_unresponsive

    def apply_stop(self, texts_by_robot: Mapping[str, tuple[str, str]], report: StopReport) -> None:
        """Apply the result of a Stop.

        If the Stop of a robot is not confirmed, its invocations end only when the robot reports that.

        Args:
            texts_by_robot: Message and status for each robot.
            report: Result of the Stop.
        """
        problems = {name: robot.problem for name, robot in report.results_by_robot.items()}
        for name, (last_stop, status) in texts_by_robot.items():
            link = self._links.get(name)
            if link is None:
                continue
            link.last_stop, link.last_stop_status = last_stop, status
            link.stop_problem = problems.get(name, "")
            link.pending_stop_start_s, link.is_stopping = None, False
            link.has_confirmed_stop |= name in report.stopped_names
            if not link.stop_problem:
                self._invocations.end_all(link, "canceled")
            self._heartbeat.stop(name)

    def confirm_stopped(self, names: Iterable[str]) -> None:
        """Record that these robots are not moving, according to the user."""
        robot_names = tuple(names)
        self.moved.confirm(robot_names)
        for link in map(self._links.get, robot_names):
            if link is not None:
                link.stop_problem = ""
                self._update_motion(link)

    def pop_settled_robots(self) -> tuple[str, ...]:
        """Return and clear the robots that have reported the end of all actions after an unconfirmed Stop."""
        return self._messages.pop_settled_robots()

    # -- input from the session ------------------------------------------------------------------------------

    def update(self, view: GraphView) -> None:
        """Apply a new graph, by which robots are connected, replaced or disconnected."""
        self._has_graph, previous_view = True, self._own_filter.view
        self._movable_robots.view = view
        self._own_filter.update(view)
        self._announcements.update(view)
        topics = (self._own_filter.topics(link.robot) for link in self._links.values())
        self._senders.update(view, {rize.ANSWERS}.union(*topics))
        self._update_announced_robots()
        announcements = self._announcements
        self._unlisted_targets = (
            *unlisted_targets(view, announcements.omitted_topics),
            *unlisted_targets(view, announcements.unreadable_topics, is_expected=False),
        )
        self._update_rize(view)
        commanded_links = map(self._links.get, self.moved.recently_commanded)
        new_programs = {
            link.name: self._own_filter.new_programs(link, previous_view) for link in commanded_links if link
        }
        self.moved.record_new_programs(new_programs)
        self._messages.apply_held_replies(self.links)
        for link in self._links.values():
            if link.is_connected and link.publisher is None:
                self._publishers.open(link)
        self._evict_disconnected()

    def add(self, batches: Mapping[str, Batch]) -> None:
        """Process received messages: descriptions, replies, sensor values."""
        if self._announcements.add(batches):
            self._update_announced_robots()
            self._evict_disconnected()
        events = batches.get(rize.EVENTS)
        for message in events.messages if events is not None else ():
            name = rize.announced_name(decode_mapping(message))
            if name is not None:
                self._rize_names.add(name)
        for link in self._links.values():
            self._messages.read(link, batches)
            stop_start_s = link.pending_stop_start_s
            link.is_stopping = (
                stop_start_s is not None and self._clock() - stop_start_s >= STOPPING_DISPLAY_DELAY_S
            )
        self._invocations.check_timeouts(self._links.values())
        self.gate.update()
        for link in self._links.values():
            self._update_motion(link)

    @property
    def claims(self) -> Mapping[str, Claim]:
        """Problems with announcements, by topic, see `Announcements.claims`.

        Robots that use topics of other robots are included.
        """
        return {**self._announcements.claims, **self._foreign_claims}

    def take_notices(self) -> tuple[str, ...]:
        """Return and clear the notices for the user about restarted robots."""
        notices, self._notices = tuple(self._notices), []
        return notices

    def close(self) -> None:
        """Record the connected robots as known, stop the heartbeat, and close the command publishers."""
        self.known_robots.record([link.robot for link in self.connected])
        self._heartbeat.close()
        for link in self._links.values():
            close_publishers(link)

    def on_unwatched(self, topic: str) -> None:
        """Discard the sensor values received on a topic that is no longer watched."""
        for link in self._links.values():
            for sensor in link.robot.sensors:
                if sensor.topic == topic:
                    link.values.pop(sensor.name, None)

    # -- private ---------------------------------------------------------------------------------------------

    def _identity_of(self, name: str) -> Identity | None:
        link = self._links.get(name)
        return None if link is None else link.identity

    def _drop_ended(self, link: RobotLink) -> None:
        # A virtual robot is its program: it has stopped once the process has ended.
        if link.is_virtual and link.name in self.moved:
            self.moved.drop_ended(link.name)
            link.stop_problem = link.stop_problem if link.name in self.moved else ""

    def _update_motion(self, link: RobotLink) -> None:
        # Explains why a robot that may move and doesn't answer is not known to have stopped.
        if not link.is_connected:
            self._drop_ended(link)
        motion = self.moved.motion(link.name)
        link.motion_warning = motion.reason if motion is not None and not self._is_responsive(link) else ""

    def _must_keep_topic(self, topic: str) -> bool:
        link = self._links.get(self._names_by_topic.get(topic, ""))
        return link is not None and (link.has_confirmed_stop or link.name in self.moved)

    def _get_link(self, name: str) -> RobotLink:
        link = self._links.get(name)
        if link is None:
            raise UnknownRobotError(name)
        return link

    def _update_rize(self, view: GraphView) -> None:
        if self._rize_events is None and rize.EVENTS in view.topics:
            self._rize_events = self._watches.open([rize.EVENTS])
        native = {link.name for link in self._links.values() if dialect_of(link.robot).is_identified}
        rize_names = self._rize_names.names_in(view, native)
        for name in rize_names:
            if name not in native:
                self.connect(rize.robot(name), f"{rize.COMMANDS} {name}")
        for link in self._links.values():
            if link.name not in native and link.is_connected and link.name not in rize_names:
                self._disconnect(link)

    def _update_announced_robots(self) -> None:
        # Connects announced robots; disconnects those whose program is no longer listed.
        announced = {topic: (robot, identity) for topic, robot, identity in self._announcements.robots}
        for topic, name in list(self._names_by_topic.items()):
            link, newest = self._links.get(name), announced.get(topic)
            if link is None or not link.is_connected:
                continue
            is_same = newest is not None and newest[0].name == name and newest[1] == link.identity
            if not is_same and not (newest is None and self._is_listed(topic, link)):
                self._disconnect(link)
        for topic in self._foreign_claims.keys() - announced.keys():
            del self._foreign_claims[topic]
        for topic, (robot, identity) in announced.items():
            claim = foreign_topic_claim(robot, (link.robot for link in self._links.values()))
            if claim is None:
                self._foreign_claims.pop(topic, None)
                self.connect(robot, topic, identity)
                continue
            self._foreign_claims[topic] = claim
            link = self._links.get(robot.name)
            if link is not None and link.is_connected:
                self._disconnect(link)

    def _is_listed(self, topic: str, link: RobotLink) -> bool:
        # The program is still listed, but its newest description can't be parsed.
        nodes = publisher_nodes(self._own_filter.view, topic)
        return link.identity is not None and link.identity.node_id in nodes

    def connect(self, robot: Robot, topic: str, identity: Identity | None = None) -> None:
        """Connect a robot. Does nothing if neither the robot nor its program has changed.

        Args:
            robot: Description of the robot.
            topic: Topic of the description.
            identity: Program of the robot; None for a robot of RIZE.
        """
        link = self._links.get(robot.name)
        was_real = not robot.virtual or (link is not None and link.identity == identity and link.was_real)
        if identity is not None:
            self._names_by_topic[topic] = robot.name
            is_virtual = not was_real and self._processes.is_started_by_studio(identity)
            robot = replace(robot, virtual=is_virtual)
        if link is None:
            link = self._links[robot.name] = RobotLink(robot.name, robot)
        elif link.is_connected and link.robot == robot and link.identity == identity:
            return
        self._apply_identity(link, identity)
        link.was_real = was_real
        previous, link.robot = link.robot, robot
        link.is_connected, link.gone_s = True, None
        if previous.topics != robot.topics or dialect_of(previous) is not dialect_of(robot):
            if dialect_of(previous) is dialect_of(robot):
                earlier_topics = dict.fromkeys((*link.earlier_topics, previous.topics))
                link.earlier_topics = tuple(earlier_topics)[:MAX_STOP_TOPICS]
            self._close_topics(link)
        if link.watch is None:
            link.watch = self._watches.open([robot.topics.reply])
        self._senders.update(self._own_filter.view, self._own_filter.topics(robot))
        self._publishers.open(link)
        self.known_robots.record([robot])
        self.revision += 1

    def _apply_identity(self, link: RobotLink, identity: Identity | None) -> None:
        # The previous program may still run on another computer and move the robot.
        previous, link.identity = link.identity, identity
        if previous is None or identity is None or previous.node_id == identity.node_id:
            return
        link.rejected_messages, link.driver_exceptions = ReportedCount(), ReportedCount()
        self._notices.append(
            _("{robot} was restarted as {now} (previously {before})").format(
                robot=link.name, now=identity.display_name, before=previous.display_name
            )
        )
        self._record_unended_actions(link, previous)
        self._drop_ended(link)

    def _close_topics(self, link: RobotLink) -> None:
        # The description names other topics: invocations on the old ones fail.
        self._heartbeat.stop(link.name)
        self._invocations.end_all(
            link, "failed", _("The description of {robot} has changed; try again").format(robot=link.name)
        )
        if link.watch is not None:
            link.watch.close()
            link.watch = None
        self._publishers.close_outdated(link)

    def _record_unended_actions(self, link: RobotLink, program: Identity | None) -> None:
        # Records actions that the robot could not end: their end can no longer be observed.
        if link.unended_actions and not link.is_virtual:  # a virtual robot is its program
            self.moved.record_command([link.name], "action", program=program)
            link.stop_problem = link.stop_problem or link.unended_actions
        link.unended_actions = ""

    def _disconnect(self, link: RobotLink) -> None:
        link.is_connected, link.gone_s = False, self._clock()
        self._record_unended_actions(link, link.identity)
        self.known_robots.record([link.robot])
        self._heartbeat.stop(link.name)
        if link.watch is not None:
            link.watch.close()
            link.watch = None
        link.is_unresponsive = False
        if self.permission.question is not None and link.name in self.permission.question.moving_actions:
            self.permission.withdraw()
        self._invocations.end_all(
            link, "failed", _("{robot} disconnected; check that it is switched on").format(robot=link.name)
        )
        self.revision += 1

    def _evict_disconnected(self) -> None:
        # Limits disconnected robots: any program can announce any number of names.
        in_use = {self._selected_name, *self.robots_in_use(), *self.moved.names}
        for link in excess_disconnected(self._links.values(), in_use):
            del self._links[link.name]
            for topic in [topic for topic, name in self._names_by_topic.items() if name == link.name]:
                del self._names_by_topic[topic]
            self._messages.discard(link)
            self._publishers.close(link)
            self.revision += 1

    def _send(self, link: RobotLink, command: Payload) -> bool:
        if link.publisher is None or not link.is_connected:
            return False
        try:
            link.publisher.publish(command)
        except NepError:
            return False
        return True
