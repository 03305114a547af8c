"""Parts of a session that look for problems and count messages."""

from __future__ import annotations

import time
from collections.abc import Callable

from app.core.network.traffic import Traffic
from app.core.projects.open_projects import OpenProjects
from app.core.reports.own_process import OwnProgram
from app.core.robots.health import Health
from app.core.robots.launcher import Launcher
from app.core.run.control import Runs
from app.core.storage.settings import Settings
from app.core.world.live import LiveWorld
from app.core.world.part import SessionPart
from nep.i18n import lazy


class MessageCounts(SessionPart):
    """Statistics of the messages of the live network."""

    task = lazy("count messages")

    def __init__(
        self, live: LiveWorld, traffic: Traffic, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._live, self._traffic, self._clock = live, traffic, clock

    def tick(self) -> None:
        """Count the messages since the last tick."""
        now = self._clock()
        if self._live.new_graph is not None:
            self._traffic.update_graph(self._live.new_graph, now)
        self._traffic.add(self._live.batches, now)

    def check(self) -> None:
        """Count lost messages."""
        self._traffic.count_lost(self._live.lost_counts(), self._clock())


class HealthChecks(SessionPart):
    """Alerts about problems of the network, robots, files and Studio itself."""

    task = lazy("check for problems")

    def __init__(
        self,
        live: LiveWorld,
        health: Health,
        *,
        runs: Runs,
        launcher: Launcher,
        projects: OpenProjects,
        settings: Settings,
        own_program: OwnProgram,
    ) -> None:
        self._live, self._health, self._runs, self._launcher = live, health, runs, launcher
        self._projects, self._settings, self._own_program = projects, settings, own_program

    def tick(self) -> None:
        """Update the alerts about the graph and about messages that can't be decoded."""
        if self._live.new_graph is not None:
            self._health.update_graph_alerts(self._live.new_graph)
        self._health.update(self._live.pop_check_results())

    def check(self) -> None:
        """Update all other alerts, and retry to save journals."""
        self._health.check(self._runs.used_robots, self._launcher.virtual_robots)
        self._projects.retry_journals()
        self._health.report_journal_problem(self._projects.journal_error)
        self._health.report_settings_problem(self._settings.write_error)
        self._health.report_executable_state(self._own_program.executable_state())
