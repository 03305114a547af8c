"""Health checks that raise alerts: undecodable messages, silent robots, duplicate names, unsaved settings."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass

from app.core.alerts.alerts import Alerts
from app.core.network.decode_checks import CheckResult
from app.core.network.topics import Topics
from app.core.reports.own_process import ExecutableState
from app.core.robots.fleet import Fleet
from app.core.robots.robot_link import RobotLink
from app.intents import (
    OPEN_DOCTOR_LABEL,
    ConnectRobot,
    Inspect,
    OpenDoctor,
    SaveBehaviour,
    SaveBehaviourAs,
    StopRobots,
)
from app.robots.client.limits import SENSOR_SILENCE_TIMEOUT_S
from nep.i18n import _, format_list, lazy, ngettext
from nep.protocol.graph_view import Alert, GraphView

RECOVERY_S = 1.0
RESTART_TIMEOUT_S = 5.0
"""Time limit in seconds for a restarted driver to connect again."""
PORTS_ALERT = "ports"
DISCARD_ALERT = "leaving"
INSTALLATION_ALERT = "installation"
"""Id of the alert about Studio's installation. The id "program" belongs to the program of a behaviour."""
ROBOT_ALERT_PREFIXES = ("robot", "moving", "camera", "rejected", "errors")
"""Id prefixes of alerts about one robot. They are followed by a colon and the name of the robot."""

REAL_ROBOT_HINT = lazy("Check that it is switched on and connected to the same Wi-Fi.")
VIRTUAL_ROBOT_HINT = lazy("Start the virtual robot again.")


@dataclass(slots=True)
class _BadTopic:
    """Topic with messages that can't be decoded.

    Attributes:
        count: Number of undecodable messages.
        unchecked_count: Number of messages that were not checked.
        last_error_s: Time of the last error (monotonic seconds).
        has_recovered: True if all messages received since the last error can be decoded.
    """

    count: int = 0
    unchecked_count: int = 0
    last_error_s: float = 0.0
    has_recovered: bool = False


class Health:
    """Health checks that raise and resolve alerts. Not thread-safe; use it from the main thread."""

    def __init__(self, topics: Topics, fleet: Fleet, alerts: Alerts, clock: Callable[[], float]) -> None:
        self._topics, self._fleet, self._alerts, self._clock = topics, fleet, alerts, clock
        self._graph_alert_ids: set[str] = set()
        self._claim_ids: set[str] = set()
        self._unreachable_names: set[str] = set()
        self._bad_topics: dict[str, _BadTopic] = {}
        self._gone_since_s: dict[str, float] = {}
        self._robot_names: set[str] = set()

    def update(self, results: Mapping[str, CheckResult]) -> None:
        """Raise alerts about topics with undecodable messages.

        `check` resolves an alert after a second without undecodable messages, so that the alert of a
        topic with both kinds of messages doesn't flicker.

        Args:
            results: Results of the decode checks, by topic.
        """
        for topic, result in results.items():
            bad_topic = self._bad_topics.get(topic)
            if bad_topic is None and result.bad_count:
                bad_topic = self._bad_topics[topic] = _BadTopic()
            if bad_topic is None:
                continue
            bad_topic.has_recovered = result.is_newest_readable
            bad_topic.unchecked_count += result.unchecked_count
            if result.bad_count:
                bad_topic.last_error_s = self._clock()
                bad_topic.count += result.bad_count
                self._alert_bad_topic(topic, bad_topic, result)

    def discard(self, topic: str) -> None:
        """Discard the problems of a topic that is no longer watched or has recovered."""
        self._bad_topics.pop(topic, None)
        self._alerts.resolve(f"message:{topic}")

    def check(self, used_names: Container[str] = (), started_names: Container[str] = ()) -> None:
        """Update all alerts. Called once a second.

        Args:
            used_names: Names of the robots that a program uses.
            started_names: Names of the virtual robots that this Studio started and that are still running.
        """
        now = self._clock()
        for topic in [
            t
            for t, bad_topic in self._bad_topics.items()
            if bad_topic.has_recovered and now - bad_topic.last_error_s >= RECOVERY_S
        ]:
            self.discard(topic)
        self._check_claims()
        self._discard_robots()
        for link in self._fleet.links:
            self._check_camera(link)
            self._check_motion(link)
            self._check_driver(link, now)
            if link.is_connected:
                self._gone_since_s.pop(link.name, None)
                self._alerts.resolve(f"robot:{link.name}")
            elif link.name in used_names:
                self._alerts.raise_alert(
                    f"robot:{link.name}",
                    "error",
                    _("{robot} isn't responding.").format(robot=link.name),
                    _("The behaviour uses this robot. {next_step}").format(
                        next_step=_(VIRTUAL_ROBOT_HINT if link.is_virtual else REAL_ROBOT_HINT)
                    ),
                    button=_("Stop"),
                    intent=StopRobots(),
                    count=0,
                )
            else:
                self._check_presence(link, now, is_running_here=link.name in started_names)

    def report_journal_problem(self, reason: str | None) -> None:
        """Raise or resolve the alert that unsaved work can't be backed up.

        Args:
            reason: Reason, or None to resolve the alert.
        """
        if reason is None:
            self._alerts.resolve("journal")
            self._alerts.resolve(DISCARD_ALERT)
            return
        self._alerts.raise_alert(
            "journal",
            "error",
            _("Your unsaved work isn't backed up."),
            f"{reason[0].upper()}{reason[1:]}.",
            button=_("Save"),
            intent=SaveBehaviour(),
            count=0,
        )

    def confirm_discard(self, name: str, reason: str) -> bool:
        """Return True if the user confirms closing the window although some work can't be saved.

        The first call raises an alert and returns False; a second call confirms.

        Args:
            name: Name of the behaviour.
            reason: Reason why the behaviour can't be saved.
        """
        if self._alerts.has(DISCARD_ALERT):
            return True
        self._alerts.resolve("journal")  # raised again after this alert
        self._alerts.raise_alert(
            DISCARD_ALERT,
            "error",
            _("Studio stays open: the unsaved work in {name} would be lost.").format(name=name),
            _("{why}. Close Studio again to discard the work.").format(
                why=f"{reason[0].upper()}{reason[1:]}"
            ),
            button=_("Save somewhere else"),
            intent=SaveBehaviourAs(),
            count=0,
        )
        return False

    def report_settings_problem(self, reason: str | None) -> None:
        """Raise or resolve the alert that settings can't be saved.

        Args:
            reason: Reason, or None to resolve the alert.
        """
        if reason is None:
            self._alerts.resolve("settings")
            return
        self._alerts.raise_alert(
            "settings",
            "warn",
            _("Settings you change now are lost when Studio closes."),
            f"{reason[0].upper()}{reason[1:]}.",
            count=0,
        )

    def report_executable_state(self, state: ExecutableState) -> None:
        """Raise or resolve the alert that Studio's executable file was replaced or removed.

        Args:
            state: State of the file, see `OwnProgram.executable_state`.
        """
        if state == "replaced":
            self._alerts.raise_alert(
                INSTALLATION_ALERT,
                "warn",
                _("NEP Studio was updated while it was open."),
                _("Save your behaviours and restart Studio: until then, parts of it may not open."),
                count=0,
            )
        elif state == "gone":
            self._alerts.raise_alert(
                INSTALLATION_ALERT,
                "error",
                _("NEP Studio was removed from this computer while it was open."),
                _("Save your behaviours now: behaviours that aren't open can no longer be opened or run."),
                count=0,
            )
        else:
            self._alerts.resolve(INSTALLATION_ALERT)

    def update_graph_alerts(self, view: GraphView) -> None:
        """Raise alerts for problems that the master reports, and resolve those that it no longer reports.

        These are duplicate names, conflicting types and ports in use.
        """
        ids = set()
        ports = [alert for alert in view.alerts if alert.id.startswith("port:")]
        for alert in view.alerts:
            if alert not in ports:
                ids.add(alert.id)
                self._alerts.raise_alert(alert.id, "warn", alert.sentence, alert.hint, count=0)
        if ports:
            ids.add(PORTS_ALERT)
            self._alert_ports(ports)
        for alert_id in self._graph_alert_ids - ids:
            self._alerts.resolve(alert_id)
        self._graph_alert_ids = ids

    def _alert_ports(self, port_alerts: Sequence[Alert]) -> None:
        # One alert for all occupied ports of the original NEP: only its programs need them.
        title, detail = port_alerts[0].sentence, port_alerts[0].hint
        if len(port_alerts) > 1:
            numbers = sorted(
                {alert.id.removeprefix("port:") for alert in port_alerts}, key=lambda port: (len(port), port)
            )
            title = _("Other programs are using ports {ports}.").format(ports=format_list(numbers))
            detail = _("Programs of the original NEP can't connect. The connection doctor shows the cause.")
        button = _(OPEN_DOCTOR_LABEL)
        self._alerts.raise_alert(
            PORTS_ALERT,
            "warn",
            title,
            detail,
            button=button,
            intent=OpenDoctor(),
            count=0,
            for_developers=True,
        )

    def _alert_bad_topic(self, topic: str, bad_topic: _BadTopic, result: CheckResult) -> None:
        title = ngettext(
            "{count} message on {topic} can't be decoded.",
            "{count} messages on {topic} can't be decoded.",
            bad_topic.count,
        )
        detail = (
            _("{why} See the raw bytes in the Inspector. {count} more arrived too fast to be decoded.")
            if bad_topic.unchecked_count
            else _("{why} See the raw bytes in the Inspector.")
        )
        reason = f"{result.error[:1].upper()}{result.error[1:]}."
        self._alerts.raise_alert(
            f"message:{topic}",
            "warn",
            title.format(topic=topic, count=bad_topic.count),
            detail.format(why=reason, count=bad_topic.unchecked_count),
            button=_("Show"),
            intent=Inspect(topic),
            count=result.bad_count,
        )

    def _check_presence(self, link: RobotLink, now: float, *, is_running_here: bool) -> None:
        # A real robot that left, or a virtual one that hangs.
        since_s = self._gone_since_s.setdefault(link.name, now)
        if now - since_s < RESTART_TIMEOUT_S or (link.is_virtual and not is_running_here):
            self._alerts.resolve(f"robot:{link.name}")
            return
        self._alerts.raise_alert(
            f"robot:{link.name}",
            "warn",
            (_("{robot} isn't responding.") if link.is_virtual else _("{robot} disconnected.")).format(
                robot=link.name
            ),
            _(VIRTUAL_ROBOT_HINT if link.is_virtual else REAL_ROBOT_HINT),
            button=_("Restart the robot") if link.is_virtual else _(OPEN_DOCTOR_LABEL),
            intent=ConnectRobot(link.name) if link.is_virtual else OpenDoctor(),
            count=0,
        )

    def _discard_robots(self) -> None:
        # Resolves the alerts of robots that Studio has discarded.
        names = {link.name for link in self._fleet.links}
        for name in self._robot_names - names:
            self._gone_since_s.pop(name, None)
            for kind in ROBOT_ALERT_PREFIXES:
                self._alerts.resolve(f"{kind}:{name}")
        self._robot_names = names

    def _check_claims(self) -> None:
        claims = self._fleet.claims
        for id in self._claim_ids - claims.keys():
            self._alerts.resolve(f"claim:{id}")
        for id, claim in claims.items():
            self._alerts.raise_alert(f"claim:{id}", "error", claim.title, claim.detail, count=0)
        self._claim_ids = set(claims)

    def update_unreachable(self, problems: Mapping[str, str]) -> None:
        """Raise alerts for robots that a Stop can't reach, and resolve those of all other robots.

        Args:
            problems: Reason for each of these robots, by name.
        """
        for name in self._unreachable_names - problems.keys():
            self._alerts.resolve(f"stop:{name}")
        for name, reason in problems.items():
            detail = _("{why}. Studio tries again every second.").format(
                why=f"{reason[:1].upper()}{reason[1:]}"
            )
            title = _("Stop can't reach {robot}.").format(robot=name)
            self._alerts.raise_alert(f"stop:{name}", "error", title, detail, count=0)
        self._unreachable_names = set(problems)

    def _check_motion(self, link: RobotLink) -> None:
        # A robot that reports an action it couldn't end, or that may move and doesn't answer.
        problem = link.unended_actions if link.is_connected else ""
        if not problem and not link.stop_problem:  # otherwise covered by the alert of the Stop
            problem = link.motion_warning
        if not problem:
            self._alerts.resolve(f"moving:{link.name}")
            return
        detail = _("Switch it off by hand if it is still moving.")
        self._alerts.raise_alert(
            f"moving:{link.name}",
            "error",
            f"{problem}.",
            detail,
            button=_("Stop"),
            intent=StopRobots(),
            count=0,
        )

    def _check_driver(self, link: RobotLink, now: float) -> None:
        # Resolved when the counts have not increased for a while.
        rejected, errors = link.rejected_messages, link.driver_exceptions
        counters = {
            "rejected": (
                rejected,
                ngettext(
                    "{robot} rejected {count} message.", "{robot} rejected {count} messages.", rejected.value
                ),
                _("They were too large, invalid or too many. The driver's log has the topics and reasons."),
            ),
            "errors": (
                errors,
                ngettext(
                    "The driver of {robot} caught {count} exception.",
                    "The driver of {robot} caught {count} exceptions.",
                    errors.value,
                ),
                _("See the driver's log for the traceback."),
            ),
        }
        for kind, (count, title, detail) in counters.items():
            if link.is_connected and count.is_growing(now):
                alert_title = title.format(robot=link.name, count=count.value)
                self._alerts.raise_alert(
                    f"{kind}:{link.name}", "warn", alert_title, detail, count=0, for_developers=True
                )
            else:
                self._alerts.resolve(f"{kind}:{link.name}")

    def _check_camera(self, link: RobotLink) -> None:
        id = f"camera:{link.name}"
        camera = next((sensor for sensor in link.robot.sensors if sensor.is_image), None)
        topic = self._topics.get(camera.topic) if camera is not None else None
        is_silent = (
            link.is_connected
            and topic is not None
            and topic.gone_since_s is None
            and topic.silent_s is not None
            and topic.silent_s > SENSOR_SILENCE_TIMEOUT_S
        )
        if not is_silent or topic is None or topic.silent_s is None:
            link.silence_reason = None
            self._alerts.resolve(id)
            return
        link.silence_reason = _("camera silent")
        self._alerts.raise_alert(
            id,
            "error",
            _("The camera of {robot} has sent nothing for {seconds} s.").format(
                robot=link.name, seconds=int(topic.silent_s)
            ),
            _("Blocks that need its images are waiting."),
            button=_(OPEN_DOCTOR_LABEL),
            intent=OpenDoctor(),
            count=0,
        )
