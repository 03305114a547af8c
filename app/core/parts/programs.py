"""Parts of a session for programs: open behaviours, the run, and programs that Studio starts."""

from __future__ import annotations

import math
from collections.abc import Callable

from app.core.alerts.alerts import Alerts
from app.core.faults import log_errors
from app.core.network.web_pages import WebPages
from app.core.projects.open_projects import OpenProjects
from app.core.projects.saved_tabs import SavedTabs
from app.core.robots.fleet import Fleet
from app.core.robots.last_robots import LastRobots
from app.core.robots.launcher import Launcher, LaunchFailed
from app.core.run.control import Runs
from app.core.run.run_record import RunRecord
from app.core.run.spare_child import SpareChild
from app.core.world.console import Console
from app.core.world.live import LiveWorld
from app.core.world.part import SessionPart
from app.intents import OPEN_DOCTOR_LABEL, ConnectRobot, OpenDoctor
from nep.i18n import _, lazy

SPARE_CHILD_DELAY_S = 3.0
"""Time in seconds from the start of Studio to that of the spare process."""


class OpenBehaviourTabs(SessionPart):
    """Open behaviours, which know the connected robots and the topics of the live network."""

    task = lazy("save the open tabs")

    def __init__(self, live: LiveWorld, fleet: Fleet, projects: OpenProjects, tabs: SavedTabs) -> None:
        self._live, self._fleet, self._projects, self._tabs = live, fleet, projects, tabs
        self._fleet_revision = self._topics_revision = -1

    def tick(self) -> None:
        """Tell the behaviours about changed robots and topics."""
        if self._fleet.revision != self._fleet_revision:
            self._fleet_revision = self._fleet.revision
            self._projects.set_connected([link.robot for link in self._fleet.connected])
        topics = self._live.topics
        if topics.revision != self._topics_revision:
            self._topics_revision = topics.revision
            self._projects.set_topics(sorted(topic.name for topic in topics.existing_topics()))

    def check(self) -> None:
        """Save changed tabs."""
        self._tabs.save_if_changed()

    def close(self) -> None:
        """Save the tabs, and close the behaviours."""
        with log_errors("save the tabs"):
            self._tabs.save(has_ended_normally=True)
        self._projects.close_all()


class SpareProgram(SessionPart):
    """Spare process for the next run, while the current behaviour has blocks."""

    task = lazy("prepare a run")

    def __init__(
        self, spare: SpareChild, projects: OpenProjects, clock: Callable[[], float], *, is_enabled: bool
    ) -> None:
        self._spare, self._projects, self._clock, self._is_enabled = spare, projects, clock, is_enabled
        self._start_s = math.inf

    def start(self) -> None:
        """Delay the process, because it would slow down the start of Studio."""
        self._start_s = self._clock() + SPARE_CHILD_DELAY_S

    def check(self) -> None:
        """Start a process if there is none."""
        if self._is_enabled and self._clock() >= self._start_s and self._projects.current.has_blocks:
            self._spare.prepare_in_background()

    def close(self) -> None:
        """End the process."""
        self._spare.close()


class CurrentRun(SessionPart):
    """Run of a behaviour."""

    task = lazy("update the run")

    def __init__(self, runs: Runs, on_record: Callable[[RunRecord], object]) -> None:
        # `on_record` is called with the record of the run at each tick.
        self._runs, self._on_record = runs, on_record

    def tick(self) -> None:
        """Update the run and its robots."""
        self._runs.update_robots()
        self._runs.tick()
        self._on_record(self._runs.record)

    def close(self) -> None:
        """Stop the program and its robots."""
        self._runs.close()


class RepeatedStops(SessionPart):
    """Second Stop of robots that have finished an action after the first.

    A failing run doesn't prevent it, because it is a separate part.
    """

    task = lazy("stop robots again")

    def __init__(self, runs: Runs, fleet: Fleet) -> None:
        self._runs, self._fleet = runs, fleet

    def tick(self) -> None:
        """Stop these robots again."""
        for name in self._fleet.pop_settled_robots():
            self._runs.stop_again(name)


class StartedPrograms(SessionPart):
    """Programs that Studio starts: the master, virtual robots, and the web server."""

    task = lazy("check started programs")

    def __init__(
        self,
        live: LiveWorld,
        launcher: Launcher,
        last_robots: LastRobots,
        web_pages: WebPages,
        *,
        starts_master: bool,
    ) -> None:
        self._live, self._launcher, self._last_robots = live, launcher, last_robots
        self._web_pages, self._starts_master = web_pages, starts_master

    def start(self) -> None:
        """Start a master if none replies."""
        if self._starts_master:
            self._launcher.ensure_master()

    def tick(self) -> None:
        """Start the requested virtual robots."""
        self._launcher.start_requested_robots()

    def check(self) -> None:
        """Detect programs that have exited, and start a master again if none replies."""
        self._launcher.check()
        self._last_robots.save(self._launcher)
        if self._live.master.kind == "none" and self._starts_master:
            self._launcher.ensure_master_with_backoff()
        self._web_pages.check()

    def close(self) -> None:
        """Stop the programs, except a master that other programs use."""
        with log_errors("save the robots"):
            self._last_robots.save(self._launcher)
        self._launcher.close()


def alert_launch_failure(event: LaunchFailed, alerts: Alerts, console: Console) -> None:
    """Raise an alert about a program that couldn't be started or has exited, and log it."""
    console.add("error", event.name, f"{event.message} {event.detail}".strip())
    alerts.raise_alert(
        f"companion:{event.name}",
        "error",
        event.message,
        event.detail.splitlines()[-1] if event.detail else "",
        button=_("Restart the robot") if event.is_robot else _(OPEN_DOCTOR_LABEL),
        intent=ConnectRobot(event.name) if event.is_robot else OpenDoctor(),
    )
