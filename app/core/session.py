"""State of one window: the network with its topics and robots, and the behaviours with their run.

The window reads the state 30 times a second. No method blocks: threads post to the mailbox, and
`Session.tick` applies the posted events and messages.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.alarms import SessionAlarms
from app.core.alerts.alerts import Alerts
from app.core.alerts.intents import ConnectRobot, OpenDoctor
from app.core.console import Console
from app.core.documents.document import Document
from app.core.documents.journal import Journal
from app.core.documents.open_documents import Documents
from app.core.documents.saved_tabs import SavedTabs
from app.core.faults import FaultAlerts, log_errors
from app.core.messages.image_streams import Images
from app.core.network.decode_checks import DecodeChecker
from app.core.network.doctor import create_doctor
from app.core.network.graph_changes import change_messages
from app.core.network.mailbox import Batch, DrainResult, Mailbox
from app.core.network.master import MasterChangeDetector, MasterState
from app.core.network.nodes import Nodes
from app.core.network.remote_access import RemoteAccess, RemoteAccessChanged
from app.core.network.source import (
    GraphReceived,
    JobFailed,
    LiveSource,
    MasterFound,
    MasterLost,
    Source,
    SourceFactory,
    WatchFailed,
)
from app.core.network.topics import Topic, Topics, split_key
from app.core.network.traffic import Traffic
from app.core.network.watches import Watch, Watches
from app.core.network.web_pages import WebPages, WebServerStarted
from app.core.networks.live_network import LiveNetwork
from app.core.networks.networks import NetworkEvent, Networks, split_by_network
from app.core.networks.parameters import ParameterSetter
from app.core.own_process import OwnProgram
from app.core.recording.client import RecorderEvent, RecorderExited
from app.core.recording.recordings import SessionRecordings
from app.core.robots.fleet import Fleet
from app.core.robots.health import OPEN_DOCTOR_LABEL, Health
from app.core.robots.last_robots import LastRobots
from app.core.robots.launcher import VIRTUAL_ROBOT_MODULES, Launcher, LaunchFailed, VirtualProcesses
from app.core.robots.motion.bridged_commands import BridgedCommands
from app.core.robots.room import SessionRoom
from app.core.robots.stop.channels import StopTarget
from app.core.robots.stop.report import LateReply, RobotReplied, RobotStopped, StopCompleted
from app.core.robots.stop.stopper import RobotStopper
from app.core.robots.voices import RobotVoices
from app.core.run.acting.acting import SessionActing
from app.core.run.control import Runs
from app.core.run.runner import RunnerEvent
from app.core.series.feed import SeriesFeed
from app.core.storage.settings import Settings
from nep.i18n import _, lazy, ngettext
from nep.masters.master import master_address
from nep.messages.message import Message
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, LOG_TOPIC, LOG_TYPE
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.core.recording.replay import replay as replay_module
else:
    replay_module = lazy_module("app.core.recording.replay.replay")

CHECK_INTERVAL_S = 1.0
MONITORING_FAILED_MESSAGE = lazy("can't monitor the robots: {error}")
LOG_TOPICS = {LOG_TOPIC: LOG_TYPE, LAST_ERRORS_TOPIC: LAST_ERRORS_TYPE}
"""Message types of the topics that are shown in the Console, by topic."""


class Session:
    """State of the window, which the panels show. Not thread-safe; use it from the main thread.

    ``topics``, ``nodes``, ``networks``, ``images``, ``series`` and ``graph`` belong to the source that
    is shown: the live network (`live`), which always stays connected, or a recording (``replay``).
    `close` stops all threads.
    """

    replay: replay_module.Replay | None = None
    source_revision = 0
    """Counter that increases when another source (live network or recording) is shown."""
    _live: LiveNetwork | None = None  # while a recording is shown
    _closing_replays: list[replay_module.Replay]

    def __init__(
        self,
        settings: Settings | None = None,
        *,
        address: str | None = None,
        source: SourceFactory | None = None,
        journal_folder: Path | None = None,
        clock: Callable[[], float] = time.monotonic,
        clock_ns: Callable[[], int] = time.time_ns,
        start_processes: bool = True,
    ) -> None:
        self.address = address if address is not None else master_address()
        self._clock, self._clock_ns = clock, clock_ns
        self._start_processes = start_processes
        self.settings = settings if settings is not None else Settings()
        self.alerts, self.console = Alerts(), Console()
        self._faults = FaultAlerts(self.alerts, clock)
        self._mailbox, self._checks = Mailbox(), DecodeChecker()
        self._watches = Watches(self._start_watch, self._stop_watch, self._on_unwatched)
        self._add_network(source if source is not None else partial(LiveSource, permanent_topics=LOG_TOPICS))
        self._add_robots()
        self._add_programs(journal_folder)
        self._health = Health(self.topics, self.fleet, self.alerts, clock)
        self.alarms = SessionAlarms(self, clock=clock, clock_s=lambda: clock_ns() / 1e9)
        self.acting = SessionActing(self, clock=clock, clock_s=lambda: clock_ns() / 1e9)
        recorder = self.settings, self.alerts, self.address, self._mailbox.post_event
        self.recordings = SessionRecordings(*recorder, clock=clock, uses_reader_process=start_processes)
        self._connect_parts()
        self._own_program, self.tick_ms = OwnProgram(), 0.0
        self._robots_revision = self._topics_revision = -1
        self._stop_targets: tuple[StopTarget, ...] = ()
        self._retries_stop_connections, self._next_check_s, self._closing_replays = False, 0.0, []

    def _add_network(self, create_source: SourceFactory) -> None:
        self.topics, self.nodes = Topics(), Nodes()
        self.traffic = Traffic(self.topics)
        self.images = Images(self.watch, self._clock)
        self.series = SeriesFeed(self.watch, self._clock_ns, self._mailbox.set_capacity)
        post_event = self._mailbox.post_event
        sinks = [self._checks.check, self._mailbox.post, self._offer_images, self._evaluate_alarms]
        self.source: Source = create_source(self.address, sinks, post_event)
        self.networks = Networks(self.settings, sinks[1:], post_event, self.alerts)
        self.parameters = ParameterSetter(self.source.submit)
        self.graph: GraphView | None = None
        self.master = MasterState("searching", self.address)
        self.remote_access = RemoteAccess(self.address, self.settings, self.alerts, post_event)
        self.web_pages = WebPages(self.address, post_event)
        self.doctor = create_doctor(self.address, self.settings.path.parent)
        self._master_change_detector = MasterChangeDetector()

    def _add_robots(self) -> None:
        submit, clock = self.source.submit, self._clock
        processes = VirtualProcesses(VIRTUAL_ROBOT_MODULES.values(), lambda: self.launcher.process_ids)
        self.fleet = Fleet(self._watches, submit, clock, self.settings, processes)
        self.room = SessionRoom(self.settings, self._watches, submit, clock, self._clock_ns)
        self.voices = RobotVoices(self.settings, self.fleet, self.watch, self.console.add, clock)
        self.stopper: RobotStopper | None = None
        self.launcher = Launcher(self.address, self._mailbox.post_event, self.fleet.is_present)
        self.last_robots = LastRobots(self.settings)

    def _add_programs(self, journal_folder: Path | None) -> None:
        self.documents = Documents(lambda: Document(lambda: Journal(journal_folder)))
        self.tabs = SavedTabs(self.settings, self.documents, partial(self.console.add, "warn", "studio"))
        alerts, console, post_event, clock = self.alerts, self.console, self._mailbox.post_event, self._clock
        self.runs = Runs(
            self.documents,
            self.fleet,
            self,
            alerts=alerts,
            console=console,
            post_event=post_event,
            clock=clock,
        )

    def _connect_parts(self) -> None:
        self.runs.starting_robots, self.runs.before_stop = (lambda: self.starting_robots), self.acting.disarm
        self.alarms.save_flight_recorder, self.alarms.on_event = (
            self.recordings.save_for_alarm,
            self.recordings.events.on_alarm,
        )
        self.alarms.on_moved = self.acting.on_moved = self.fleet.moved.record_command
        self._bridged_commands = BridgedCommands(self.fleet.moved.record_command)

    def _offer_images(self, topic: str, messages: Sequence[Message]) -> None:
        live = self._live
        (self.images if live is None else live.images).offer(messages, topic)

    def _evaluate_alarms(self, topic: str, messages: Sequence[Message]) -> None:
        self.alarms.evaluate(topic, messages)

    # -- public ----------------------------------------------------------------------------------------------

    @property
    def document(self) -> Document:
        """Behaviour of the current tab."""
        return self.documents.current

    @property
    def live(self) -> LiveNetwork:
        """State of the live network, even while a recording is shown."""
        if self._live is not None:
            return self._live
        return LiveNetwork(self.topics, self.nodes, self.networks, self.images, self.series, self.graph)

    @property
    def is_replaying(self) -> bool:
        """True if a recording is shown instead of the live network."""
        return self.replay is not None

    @property
    def displayed_console(self) -> Console:
        """Console of the source that is shown."""
        return self.replay.console if self.replay is not None else self.console

    def open_recording(self, path: Path) -> replay_module.Replay:
        """Show and return a recording, which is read in a child process. The live network stays connected."""
        live = self.live
        self._end_replay()
        self._live = live
        opener = self.recordings.new_opener()
        replay = self.replay = replay_module.Replay(
            path, self.settings, self.alerts, clock=self._clock, acting=self.acting, opener=opener
        )
        self.topics, self.nodes, self.networks = replay.topics, replay.nodes, replay.networks
        self.images, self.series, self.graph = replay.images, replay.series, None
        self.source_revision += 1
        replay.start()
        return replay

    def return_to_live(self) -> None:
        """Close the recording and show the live network."""
        live = self._live
        if live is None:
            return
        self.topics, self.nodes, self.networks = live.topics, live.nodes, live.networks
        self.images, self.series, self.graph = live.images, live.series, live.graph
        self._live = None
        self.source_revision += 1
        self._end_replay()

    def _end_replay(self) -> None:
        if self.replay is not None:
            replay, self.replay = self.replay, None
            self._closing_replays = [each for each in self._closing_replays if not each.has_ended]
            self._closing_replays.append(replay)
            replay.request_stop()

    @property
    def starting_robots(self) -> tuple[str, ...]:
        """Names of the virtual robots that are starting."""
        connected = {link.name for link in self.fleet.connected}
        return tuple(name for name in self.launcher.starting_robots if name not in connected)

    def start(self) -> None:
        """Start the threads. If no master replies, start a master, unless ``start_processes`` is False."""
        self.source.start()
        self.networks.start()
        self.alarms.start()
        self.recordings.start()
        self.source.submit(MONITORING_FAILED_MESSAGE, self._create_stopper)
        if self._start_processes:
            self.launcher.ensure_master()

    def watch(self, topic: str) -> Watch:
        """Watch a topic of the live network until the watch is closed. Messages arrive in `Topics`.

        Args:
            topic: Key of the topic, see `key_of`.
        """
        return self._watches.open([topic])

    def watch_displayed(self, topic: str) -> Watch:
        """Watch a topic of the source that is shown (live network or recording).

        Watch the topic again after `source_revision` has changed.

        Args:
            topic: Key of the topic, see `key_of`.
        """
        return self.watch(topic) if self.replay is None else self.replay.watch(topic)

    def topic(self, key: str) -> Topic | None:
        """Return the topic with this key, or None."""
        return self.networks.topic(key) if split_key(key)[0] else self.topics.get(key)

    def mark_seen(self, key: str) -> None:
        """Stop highlighting a topic as new."""
        name, topic = split_key(key)
        network = self.networks.get(name)
        (network.topics if network is not None else self.topics).mark_seen(topic)

    def confirm_discard(self, document: Document) -> bool:
        """Return True if the user confirms discarding work that can't be saved.

        The first call raises an alert and returns False; a second call confirms.
        """
        return self._health.confirm_discard(document.name, document.journal_error or "")

    def tick(self) -> None:
        """Apply the events and messages that threads have posted since the last tick."""
        now, now_ns = self._clock(), self._clock_ns()
        drain_result = self._mailbox.drain()
        for event in drain_result.events:
            with self.guarded(lazy("handle {event}"), event=type(event).__name__):
                self._on_event(event, now)
        self._on_messages(drain_result, now)
        with self.guarded(lazy("update the ages of topics and nodes")):
            live = self.live
            live.topics.update_ages(now, now_ns)
            live.nodes.update_ages(now)
            live.networks.update_ages(now, now_ns)
        if self.replay is not None:
            with self.guarded(lazy("update the replay")):
                self._tick_replay(self.replay, now)
        with self.guarded(lazy("monitor the robots")):
            self._update_robots()
        with self.guarded(lazy("monitor the alarms")):
            self.alarms.tick()
        with self.guarded(lazy("send messages by hand")):
            self.acting.tick()
        with self.guarded(lazy("play the robots' voices")):
            self.voices.update()
        with self.guarded(lazy("update the robots of the program")):
            self.runs.update_robots()
        with self.guarded(lazy("stop robots again")):
            for name in self.fleet.pop_settled_robots():
                self.runs.stop_again(name)
        with self.guarded(lazy("monitor started programs")):
            self.launcher.start_requested_robots()
        with self.guarded(lazy("update the run")):
            self.runs.tick()
            self.recordings.events.update_run(self.runs.state)
        if now >= self._next_check_s:
            self._next_check_s = now + CHECK_INTERVAL_S
            self._check(now)
        self.tick_ms = (self._clock() - now) * 1000

    def _tick_replay(self, replay: replay_module.Replay, now: float) -> None:
        was_open = replay.opened_recording is not None
        replay.tick(now)
        self.graph = replay.graph
        if not was_open and replay.opened_recording is not None:
            self.source_revision += 1  # its topics and start time are available from now on

    def guarded(self, phrase: str, **placeholder_values: object) -> AbstractContextManager[None]:
        """Return a context manager that logs exceptions of one step, raises an alert and suppresses them.

        Args:
            phrase: Translatable phrase that completes "can't ..."; mark it with `lazy`.
            placeholder_values: Values for the placeholders in ``phrase``.
        """
        return self._faults.guarded(phrase, **placeholder_values)

    def _check(self, now: float) -> None:
        self._faults.check()
        with self.guarded(lazy("save the alarms")):
            self.alarms.check()
            self.acting.check()
        with self.guarded(lazy("monitor the recorder")):
            self.recordings.check()
        with self.guarded(lazy("save the open tabs")):
            self.tabs.save_if_changed()
        with self.guarded(lazy("check started programs")):
            self.launcher.check()
            self.last_robots.save(self.launcher)
            if self.master.kind == "none" and self._start_processes:
                self.launcher.ensure_master_with_backoff()
            self.web_pages.check()
        with self.guarded(lazy("count lost messages")):
            lost_counts = self.source.lost_counts()
            self.traffic.count_lost(
                {topic: count for topic, count in lost_counts.items() if self._watches.is_watched(topic)}, now
            )
        with self.guarded(lazy("report problems with Stop")):
            self._check_stop_connections()
        with self.guarded(lazy("check for problems")):
            self._health.check(self.runs.used_robots, self.launcher.virtual_robots)
            self.documents.retry_journals()
            self._health.report_journal_problem(self.documents.journal_error)
            self._health.report_settings_problem(self.settings.write_error)
            self._health.report_executable_state(self._own_program.executable_state())

    def _close_replays(self) -> None:
        self.return_to_live()
        for replay in self._closing_replays:
            replay.close()
        self._closing_replays.clear()

    def close(self) -> None:
        """Stop the running program and all threads and child processes; errors are logged, not raised."""
        live = self.live
        steps: list[tuple[str, Callable[[], object]]] = [
            ("stop the program", self.runs.close),
            ("stop sending by hand", self.acting.close),
            ("save the tabs", lambda: self.tabs.save(has_ended_normally=True)),
            ("save the robots", partial(self.last_robots.save, self.launcher)),
            ("save the alarms", self.alarms.close),
            ("close the behaviours", self.documents.close_all),
            ("silence the robots", self.voices.close),
            ("close the connections to the robots", self.fleet.close),
            ("save the room", self.room.close),
            *([("close the stopper", self.stopper.close)] if self.stopper is not None else []),
            ("stop the image streams", live.images.close),
            ("stop the doctor", self.doctor.close),
            ("stop the recorder", self.recordings.close),  # before the master, which the recorder may need
            ("close the recording", self._close_replays),
            ("leave the network", self.source.close),
            ("leave other networks", live.networks.close),
            ("stop setting parameters", self.parameters.close),
            ("stop the child processes", self.launcher.close),
            ("close remote access", self.remote_access.close),
            ("stop the web server", self.web_pages.close),
        ]
        for description, close_part in steps:
            with log_errors(description):
                close_part()

    # -- private ---------------------------------------------------------------------------------------------

    def _start_watch(self, topic: str) -> None:
        if split_key(topic)[0]:
            self.live.networks.watch(topic)
            return
        self.source.watch(topic)
        live_topic = self.live.topics.get(topic)
        if live_topic is not None:
            live_topic.is_watched = True

    def _stop_watch(self, topic: str) -> None:
        if split_key(topic)[0]:
            self.live.networks.unwatch(topic)
            return
        self.source.unwatch(topic)
        self.live.topics.unwatch(topic)
        self.fleet.on_unwatched(topic)

    def _on_unwatched(self, topic: str) -> None:
        self._health.discard(topic)  # only now, because the problem doesn't depend on the panel being shown

    def _create_stopper(self, node: Node) -> None:
        self.stopper = RobotStopper(node)

    def _on_messages(self, drain_result: DrainResult, now: float) -> None:
        batches, other_batches = split_by_network(drain_result.batches)
        for topic, batch in batches.items():
            with self.guarded(lazy("receive messages of {topic}"), topic=topic):
                self._on_batch(topic, batch, now)
        for key, batch in other_batches.items():
            with self.guarded(lazy("receive messages of {topic}"), topic=key):
                self.live.networks.add(key, batch, now)
        with self.guarded(lazy("update the plots")):
            self.live.series.dispatch(drain_result.batches)
        with self.guarded(lazy("count messages")):
            self.traffic.add(batches, now)
        with self.guarded(lazy("update the robots")):
            self.fleet.add(batches)
        with self.guarded(lazy("update the room")):
            self.room.add_messages(batches)
            self.room.tick()
        with self.guarded(lazy("check messages")):
            results = self._checks.pop_results()
            self._health.update(
                {topic: result for topic, result in results.items() if self._watches.is_watched(topic)}
            )
        if drain_result.lost_event_count:
            self.alerts.raise_alert(
                "mailbox",
                "warn",
                ngettext(
                    "{count} event was lost because the window was busy.",
                    "{count} events were lost because the window was busy.",
                    drain_result.lost_event_count,
                ).format(count=drain_result.lost_event_count),
                _("Panels may be up to a second out of date."),
                count=drain_result.lost_event_count,
            )

    def _on_batch(self, topic: str, batch: Batch, now: float) -> None:
        if topic in LOG_TOPICS:
            self.console.add_messages(batch.messages, batch.dropped)
        # else these are the last messages of a subscription that has just ended
        if self._watches.is_watched(topic):
            topics = self.live.topics
            topics.add(topic, batch, now)
            topics[topic].is_watched = True

    def _on_event(self, event: object, now: float) -> None:
        match event:
            case GraphReceived():
                self._on_graph(event.view, now)
            case MasterFound():
                self.master = MasterState("connected", event.address)
                self.alerts.resolve("master")
                self.alerts.resolve("companion:master")
                self.console.add("info", "master", _("connected to {address}").format(address=event.address))
            case MasterLost():
                self._on_master_lost(event)
            case RunnerEvent():
                self.runs.on_runner_event(event)
            case StopCompleted() | RobotReplied() | RobotStopped() | LateReply():
                self.runs.on_stop(event)
            case LaunchFailed():
                self.console.add("error", event.name, f"{event.message} {event.detail}".strip())
                self.alerts.raise_alert(
                    f"companion:{event.name}",
                    "error",
                    event.message,
                    event.detail.splitlines()[-1] if event.detail else "",
                    button=_("Restart the robot") if event.is_robot else _(OPEN_DOCTOR_LABEL),
                    intent=ConnectRobot(event.name) if event.is_robot else OpenDoctor(),
                )
            case WatchFailed():
                self.alerts.raise_alert(
                    f"watch:{event.topic}",
                    "warn",
                    _("Can't subscribe to {topic}.").format(topic=event.topic),
                    event.message,
                )
            case (
                RemoteAccessChanged()
                | NetworkEvent()
                | RecorderEvent()
                | RecorderExited()
                | WebServerStarted()
            ):
                self._forward_event(event, now)
            case JobFailed() if event.message_template:
                self.console.add("error", "studio", _(event.message_template).format(error=event.message))
            case _:
                pass

    def _forward_event(
        self,
        event: RemoteAccessChanged | NetworkEvent | RecorderEvent | RecorderExited | WebServerStarted,
        now: float,
    ) -> None:
        if isinstance(event, NetworkEvent):
            self.live.networks.on_event(event, now)
        elif isinstance(event, RemoteAccessChanged):
            self.remote_access.on_changed(event)
        elif isinstance(event, WebServerStarted):
            self.web_pages.on_started(event)
        else:
            self.recordings.on_event(event)

    def _on_graph(self, view: GraphView, now: float) -> None:
        self.remote_access.update_graph(view)
        if self._master_change_detector.is_incomplete(self.live.graph, view, now):
            return
        live = self.live
        previous = live.graph
        if previous is not None and (previous.epoch, previous.revision) != (view.epoch, view.revision):
            for line in change_messages(previous, view):
                self.console.add("info", "master", line)
        if self._live is None:
            self.graph = view
        live.graph = view
        self.alarms.update_graph(view)
        live.topics.update(view, now)
        live.nodes.update(view, now)
        self.fleet.update(view)
        self._bridged_commands.update(view, (link.robot for link in self.fleet.links if not link.is_virtual))
        self.room.update(view)
        for notice in self.fleet.take_notices():
            self.console.add("warn", "robots", notice)
        if self.stopper is not None:
            self.stopper.update_graph(view)
        self.traffic.update_graph(view, now)
        self._health.update_graph_alerts(view)

    def _on_master_lost(self, event: MasterLost) -> None:
        was_connected = self.master.kind == "connected"
        self.master = MasterState("none", event.address, event.message)
        self.alarms.update_graph(None)
        if was_connected:
            self.console.add("error", "master", event.message)
            self.alerts.raise_alert(
                "master",
                "warn",
                _("Lost the connection to the master."),
                _("Connected programs keep running. New programs can't join until a master responds."),
                button=_(OPEN_DOCTOR_LABEL),
                intent=OpenDoctor(),
            )
            self.live.topics.values_revision += 1

    def _update_robots(self) -> None:
        if self.fleet.revision != self._robots_revision:
            self._robots_revision = self.fleet.revision
            robots = [link.robot for link in self.fleet.connected]
            self.documents.set_connected(robots)
            for robot in robots:
                self.launcher.on_started(robot.name)
                self.alerts.resolve(f"companion:{robot.name}")
        self._update_stop_targets()
        topics = self.live.topics
        if topics.revision != self._topics_revision:
            self._topics_revision = topics.revision
            self.documents.set_topics(sorted(topic.name for topic in topics.existing_topics()))

    def _check_stop_connections(self) -> None:
        # Alerts about robots that a stop can't reach; the next tick tries to connect to them again.
        problems = self.stopper.problems if self.stopper is not None else {}
        self._health.update_unreachable(problems)
        self._retries_stop_connections = bool(problems)

    def _update_stop_targets(self) -> None:
        # Covers connected robots and those that disconnected while a program used them or without a stop.
        if self.stopper is not None:
            self.stopper.deliver()
            for link in self.fleet.connected:
                link.is_reachable = self.stopper.is_reachable(link.name)
        targets = self.fleet.stop_targets
        stopper = self.stopper
        if stopper is not None and (targets != self._stop_targets or self._retries_stop_connections):
            self._stop_targets, self._retries_stop_connections = targets, False
            stopper.set_expected(targets)
            self.source.submit(MONITORING_FAILED_MESSAGE, lambda _node: stopper.set_robots(targets))
