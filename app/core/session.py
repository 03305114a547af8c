"""State of one window: a list of parts, the live network, and the world that the panels show.

The window reads the state 30 times a second. No method blocks: threads post to the mailbox, and
`Session.tick` applies the posted events and messages.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.alerts.alerts import Alerts
from app.core.faults import FaultAlerts, log_errors
from app.core.network.doctor import create_doctor
from app.core.network.mailbox import Mailbox
from app.core.network.remote_access import RemoteAccess, RemoteAccessChanged
from app.core.network.source import (
    GraphReceived,
    JobFailed,
    LiveSource,
    MasterFound,
    MasterLost,
    SourceFactory,
    WatchFailed,
)
from app.core.network.traffic import Traffic
from app.core.network.web_pages import WebPages, WebServerStarted
from app.core.networks.networks import NetworkEvent
from app.core.networks.parameters import ParameterSetter
from app.core.parts.alarms import SessionAlarms
from app.core.parts.health import HealthChecks, MessageCounts
from app.core.parts.programs import (
    CurrentRun,
    OpenBehaviourTabs,
    RepeatedStops,
    SpareProgram,
    StartedPrograms,
    alert_launch_failure,
)
from app.core.parts.robots import ConnectedRobots, RoomSync, StopConnections
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import OpenProjects
from app.core.projects.project_files import ProjectFiles
from app.core.projects.saved_tabs import SavedTabs
from app.core.recording.client import RecorderEvent, RecorderExited
from app.core.recording.recordings import SessionRecordings
from app.core.reports.own_process import OwnProgram
from app.core.robots.fleet import Fleet
from app.core.robots.health import Health
from app.core.robots.last_robots import LastRobots
from app.core.robots.launcher import Launcher, LaunchFailed, VirtualProcesses
from app.core.robots.room import SessionRoom
from app.core.robots.stop.report import LateReply, RobotReplied, RobotStopped, StopCompleted
from app.core.robots.stop.stopper import RobotStopper
from app.core.robots.voices import RobotVoices
from app.core.run.acting.acting import SessionActing
from app.core.run.child_process import ChildProcess, child_command, source_root
from app.core.run.control import Runs
from app.core.run.runner import Runner, RunnerEvent
from app.core.run.spare_child import SpareChild
from app.core.storage.settings import Settings
from app.core.world.live import LOG_TOPICS, LiveWorld
from app.core.world.part import Resource, SessionPart
from app.core.world.shown import ShownWorld
from app.core.world.world import World
from nep.i18n import lazy
from nep.messages.message import Message
from nep.system.addresses import master_address
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.core.recording.replay import replay as replay_module
else:
    replay_module = lazy_module("app.core.recording.replay.replay")

CHECK_INTERVAL_S = 1.0


class Session:
    """State of the window, which the panels show. Not thread-safe; use it from the main thread.

    Attributes:
        live: Live network, which always stays connected.
        console: Console of the live network, with the messages of Studio.
    """

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
        self._clock, self._clock_ns, self._start_processes = clock, clock_ns, start_processes
        self.settings = settings if settings is not None else Settings()
        self.alerts, self._mailbox, self._own_program = Alerts(), Mailbox(), OwnProgram()
        self._faults = FaultAlerts(self.alerts, clock)
        self._next_check_s, self.tick_ms = 0.0, 0.0
        self._add_network(source if source is not None else partial(LiveSource, permanent_topics=LOG_TOPICS))
        self._add_robots()
        self._add_programs(journal_folder)
        self._health = Health(self.live.topics, self.fleet, self.alerts, clock)
        self.live.on_unsubscribed, self.live.on_forgotten = self.fleet.on_unwatched, self._health.discard
        self.alarms = SessionAlarms(self, clock=clock, clock_s=lambda: clock_ns() / 1e9)
        self.acting = SessionActing(self, clock=clock, clock_s=lambda: clock_ns() / 1e9)
        recorder = self.settings, self.alerts, self.address, self._mailbox.post_event
        self.recordings = SessionRecordings(*recorder, clock=clock, uses_reader_process=start_processes)
        self.runs.starting_robots, self.runs.before_stop = (lambda: self.starting_robots), self.acting.disarm
        self.alarms.save_flight_recorder = self.recordings.save_for_alarm
        self.alarms.on_event = self.recordings.events.on_alarm
        self.alarms.on_moved = self.acting.on_moved = self.fleet.moved.record_command

    def _add_network(self, create_source: SourceFactory) -> None:
        post_event = self._mailbox.post_event
        self.live = LiveWorld(
            partial(create_source, self.address), self.settings, self.alerts, self._mailbox, self._faults,
            sink=self._evaluate_alarms, clock=self._clock, now_ns=self._clock_ns,
        )  # fmt: skip
        self._shown = ShownWorld(self.live)
        self.console, self.traffic = self.live.console, Traffic(self.live.topics)
        self.parameters = ParameterSetter(self.live.source.submit)
        self.remote_access = RemoteAccess(self.address, self.settings, self.alerts, post_event)
        self.web_pages = WebPages(self.address, post_event)
        self.doctor = create_doctor(self.address, self.settings.path.parent)

    def _add_robots(self) -> None:
        live, clock, submit = self.live, self._clock, self.live.source.submit
        processes = VirtualProcesses(lambda: self.launcher.process_ids)
        self.fleet = Fleet(live.watches, submit, clock, self.settings, processes)
        self.room = SessionRoom(self.settings, live.watches, submit, clock, self._clock_ns)
        self.voices = RobotVoices(self.settings, self.fleet, live.watch, self.console.add, clock)
        self.stopper: RobotStopper | None = None
        self.launcher = Launcher(self.address, self._mailbox.post_event, self.fleet.is_present)
        self.last_robots = LastRobots(self.settings)

    def _add_programs(self, journal_folder: Path | None) -> None:
        self.documents = OpenProjects(lambda: OpenProject(lambda: Journal(journal_folder)))
        warn = partial(self.console.add, "warn", "studio")
        self.tabs = SavedTabs(self.settings, self.documents, warn)
        self.files = ProjectFiles(self.documents, self.tabs, self.settings, warn)
        source = source_root()
        self._spare_child = SpareChild(lambda: ChildProcess(child_command(), source), source)
        self.runs = Runs(
            self.documents, self.fleet, self, alerts=self.alerts, console=self.console,
            post_event=self._mailbox.post_event, clock=self._clock,
            create_runner=partial(Runner, spare=self._spare_child),
        )  # fmt: skip

    @cached_property
    def _parts(self) -> Sequence[SessionPart]:
        # Parts are started and updated in this order, and closed in the reverse order: the program before
        # the robots that it uses, and the recorder before the network and the master that it may need.
        live, fleet, launcher, projects = self.live, self.fleet, self.launcher, self.documents
        return (
            Resource(self.web_pages),
            Resource(self.remote_access),
            StartedPrograms(
                live, launcher, self.last_robots, self.web_pages, starts_master=self._start_processes
            ),
            Resource(self.doctor),
            Resource(self.parameters),
            live,
            MessageCounts(live, self.traffic, self._clock),
            self._shown,
            self.recordings,
            RoomSync(live, self.room),
            ConnectedRobots(live, fleet, launcher, self.alerts),
            StopConnections(self, self._health),
            self.voices,
            OpenBehaviourTabs(live, fleet, projects, self.tabs),
            self.alarms,
            self.acting,
            SpareProgram(self._spare_child, projects, self._clock, is_enabled=self._start_processes),
            CurrentRun(self.runs, self.recordings.events.update_run),
            RepeatedStops(self.runs, fleet),
            HealthChecks(
                live,
                self._health,
                runs=self.runs,
                launcher=launcher,
                projects=projects,
                settings=self.settings,
                own_program=self._own_program,
            ),
        )

    def _evaluate_alarms(self, topic: str, messages: Sequence[Message]) -> None:
        self.alarms.evaluate(topic, messages)

    # -- worlds ----------------------------------------------------------------------------------------------

    @property
    def shown(self) -> World:
        """World that the panels show: the live network, or another one such as a recording."""
        return self._shown.world

    @property
    def source_revision(self) -> int:
        """Counter that increases when another world is shown; panels then watch their topics again."""
        return self._shown.revision

    def show(self, world: World) -> None:
        """Show a world. The previous one is closed, unless it is the live network, which stays connected."""
        self._shown.show(world)

    @property
    def replay(self) -> replay_module.Replay | None:
        """Recording that is shown, or None."""
        world = self.shown
        return None if world.is_live or not isinstance(world, replay_module.Replay) else world

    def open_recording(self, path: Path) -> replay_module.Replay:
        """Show and return a recording, which is read in a child process."""
        replay = replay_module.Replay(
            path,
            self.alerts,
            clock=self._clock,
            acting=self.acting,
            opener=self.recordings.new_opener(),
        )
        self.show(replay)
        return replay

    def return_to_live(self) -> None:
        """Show the live network, and close the world that was shown."""
        self.show(self.live)

    # -- public ----------------------------------------------------------------------------------------------

    @property
    def document(self) -> OpenProject:
        """Behaviour of the current tab."""
        return self.documents.current

    @property
    def starting_robots(self) -> tuple[str, ...]:
        """Names of the virtual robots that are starting."""
        connected = {link.name for link in self.fleet.connected}
        return tuple(name for name in self.launcher.starting_robots if name not in connected)

    def confirm_discard(self, project: OpenProject) -> bool:
        """Return True if the user confirms discarding work that can't be saved.

        The first call raises an alert and returns False; a second call confirms.
        """
        return self._health.confirm_discard(project.name, project.journal_error or "")

    def guarded(self, phrase: str, **placeholder_values: object) -> AbstractContextManager[None]:
        """Return a context manager that logs exceptions of one step, raises an alert and suppresses them.

        Args:
            phrase: Translatable phrase that completes "can't ..."; mark it with `lazy`.
            placeholder_values: Values for the placeholders in ``phrase``.
        """
        return self._faults.guarded(phrase, **placeholder_values)

    # -- parts -----------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the threads. If no master replies, start a master, unless ``start_processes`` is False."""
        for part in self._parts:
            self._faults.run(part.task, part.start)

    def tick(self) -> None:
        """Apply the events and messages that threads have posted since the last tick."""
        start_s = self._clock()
        for event in self.live.take_events():
            with self.guarded(lazy("handle {event}"), event=type(event).__name__):
                self._on_event(event)
        for part in self._parts:
            self._faults.run(part.task, part.tick)
        if start_s >= self._next_check_s:
            self._next_check_s = start_s + CHECK_INTERVAL_S
            self.check()
        self.tick_ms = (self._clock() - start_s) * 1000

    def check(self) -> None:
        """Look for problems and save changes. Called once a second by `tick`."""
        self._faults.check()
        for part in self._parts:
            self._faults.run(part.task, part.check)

    def close(self) -> None:
        """Stop the running program and all threads and child processes; errors are logged, not raised."""
        for part in reversed(self._parts):
            with log_errors(f"close {part.name}"):
                part.close()

    # -- events ----------------------------------------------------------------------------------------------

    def _on_event(self, event: object) -> None:
        match event:
            case GraphReceived():
                self.remote_access.update_graph(event.view)
                self.live.on_event(event)
            case MasterLost():
                self.live.on_event(event)
                self.alarms.update_graph(None)
            case MasterFound() | WatchFailed() | JobFailed() | NetworkEvent():
                self.live.on_event(event)
            case RunnerEvent():
                self.runs.on_runner_event(event)
            case StopCompleted() | RobotReplied() | RobotStopped() | LateReply():
                self.runs.on_stop(event)
            case RecorderEvent() | RecorderExited():
                self.recordings.on_event(event)
            case RemoteAccessChanged():
                self.remote_access.on_changed(event)
            case WebServerStarted():
                self.web_pages.on_started(event)
            case LaunchFailed():
                alert_launch_failure(event, self.alerts, self.console)
            case _:
                pass
