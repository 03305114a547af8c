"""What a stop brought is told to the person (Console, alerts) and to the fleet."""

from __future__ import annotations

import time

from app.core.alerts import Alerts
from app.core.console import Console
from app.core.robots.fleet import Fleet
from app.core.robots.stop.report import StopReport
from app.core.run.view import STOP_AGAIN, clock_words, result_words, stop_words, unanswered_words
from nep.i18n import _


class StopNews:
    """Tells of stops. One thread uses it (the window's)."""

    def __init__(self, fleet: Fleet, alerts: Alerts, console: Console) -> None:
        self._fleet, self._alerts, self._console = fleet, alerts, console

    def tell_fleet(self, report: StopReport, mark: int) -> None:
        """Tell what a stop proved that began at ``mark`` (`MovedRobots.mark`), then the words for it."""
        self._fleet.moved.take(report, mark)
        clock = clock_words(time.localtime())
        words = {name: (stop_words(each, clock), each.status) for name, each in report.by_name.items()}
        self._fleet.stopped(words, report)

    def doubts(self, report: StopReport) -> tuple[str, ...]:
        """What is known of why robots that are not proven to stand still may move, and who is told later."""
        pending = [name for name, robot in report.by_name.items() if robot.is_pending]
        motions = (self._fleet.moved.motion(name) for name in report.silent)
        return (
            *(motion.sentence for motion in motions if motion is not None and motion.is_known),
            *(
                _("Stop will be sent to {robot} as soon as it is connected").format(robot=name)
                for name in pending
            ),
        )

    def tell_person(self, report: StopReport, origin: str) -> None:
        """Tell in the Console, for ``origin``, and by an alert as long as a robot may still move."""
        for name, program in report.strangers:
            said = _("“{program}” answered Stop in the name of {robot}; that does not count").format(
                program=program, robot=name
            )
            self._console.add("error", origin, said)
            detail = _("Find out what this program is, and close it.")
            self._alerts.put(f"stranger:{name}", "error", f"{said}.", detail)
        words = result_words(report)
        if not report.unproven:
            self._console.add("info", origin, words)
            self._alerts.resolve("stop")
        else:
            title, detail, _compact, _confirm = unanswered_words(report, self.doubts(report))
            self._console.add("error", origin, f"{words}: {title}")
            self._alerts.put("stop", "error", f"{title}.", detail, button=_(STOP_AGAIN), action="run.stop")
