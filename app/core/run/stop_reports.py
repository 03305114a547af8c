"""Reports about a Stop: to the user (Console and alerts), and to the fleet."""

from __future__ import annotations

import time

from app.core.alerts.alerts import Alerts
from app.core.robots.fleet import Fleet
from app.core.run.view import STOP_AGAIN, clock_text, result_text, stop_text, unconfirmed_texts
from app.core.world.console import Console
from app.intents import StopRobots
from app.robots.client.stop_report import StopReport
from nep.i18n import _


class StopReporter:
    """Reporter of the results of Stops. Not thread-safe; use it from the main thread."""

    def __init__(self, fleet: Fleet, alerts: Alerts, console: Console) -> None:
        self._fleet, self._alerts, self._console = fleet, alerts, console

    def update_fleet(self, report: StopReport, mark: int) -> None:
        """Apply the result of a Stop to the fleet.

        Args:
            report: Result of the Stop.
            mark: Value of `MovedRobots.mark` when the Stop started.
        """
        self._fleet.moved.apply_report(report, mark)
        time_of_day = clock_text(time.localtime())
        texts_by_robot = {
            name: (stop_text(each, time_of_day), each.status)
            for name, each in report.results_by_robot.items()
        }
        self._fleet.apply_stop(texts_by_robot, report)

    def motion_warnings(self, report: StopReport) -> tuple[str, ...]:
        """Return sentences about robots without a confirmation.

        The sentences state why a robot may be moving, and which robots receive the Stop once they are
        connected.
        """
        pending = [name for name, robot in report.results_by_robot.items() if robot.is_pending]
        motions = (self._fleet.moved.motion(name) for name in report.unconfirmed_names)
        return (
            *(motion.reason for motion in motions if motion is not None and motion.is_sender_known),
            *(
                _("Stop will be sent to {robot} as soon as it is connected").format(robot=name)
                for name in pending
            ),
        )

    def notify_user(self, report: StopReport, origin: str) -> None:
        """Report the result of a Stop in the Console, and with an alert while a robot may be moving.

        Args:
            report: Result of the Stop.
            origin: Origin of the Console record.
        """
        for name, program in report.impostors:
            message = _("“{program}” replied to Stop on behalf of {robot}; the reply was ignored").format(
                program=program, robot=name
            )
            self._console.add("error", origin, message)
            detail = _("Find out what this program is, and close it.")
            self._alerts.raise_alert(f"stranger:{name}", "error", f"{message}.", detail)
        result = result_text(report)
        if not report.unconfirmed_robots:
            self._console.add("info", origin, result)
            self._alerts.resolve("stop")
        else:
            title, detail, _compact_text, _confirm_label = unconfirmed_texts(
                report, self.motion_warnings(report)
            )
            self._console.add("error", origin, f"{result}: {title}")
            self._alerts.raise_alert(
                "stop", "error", f"{title}.", detail, button=_(STOP_AGAIN), intent=StopRobots()
            )
