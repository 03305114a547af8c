"""Tests of alerts about malformed data: one per topic with an exact count, resolved by valid messages."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from app.core.alerts.alerts import ActiveAlert, Alerts
from app.core.network.decode_checks import CheckResult
from app.core.network.mailbox import Batch
from app.core.network.topics import Topics
from app.core.robots.fleet import Fleet
from app.core.robots.health import RECOVERY_S, RESTART_TIMEOUT_S, Health
from app.core.robots.reported_count import GROWTH_WINDOW_S, ReportedCount
from app.intents import ConnectRobot, Inspect, OpenDoctor, StopRobots
from nep.messages.message import Message
from nep.protocol.graph_view import Alert, GraphView, PublisherInfo, SubscriberInfo, TopicInfo


class Case:
    """Health of a network whose topics, robots and check results a test sets."""

    def __init__(self) -> None:
        self.now = 50.0
        self.alerts = Alerts()
        self.links: list[SimpleNamespace] = []
        fleet = cast("Fleet", SimpleNamespace(links=self.links, claims={}))
        self.topics = Topics()
        self.health = Health(self.topics, fleet, self.alerts, lambda: self.now)

    def look(self, bad: int, good: int = 0, *, unchecked: int = 0, last_good: bool = False) -> None:
        checked = CheckResult(bad + good, bad, unchecked, "no json" if bad else "", last_good)
        self.health.update({"/a": checked})

    def alert(self) -> ActiveAlert | None:
        return next(iter(self.alerts.active), None)


@pytest.fixture
def case() -> Case:
    return Case()


def test_malformed_messages_are_one_alert_with_exact_count(case: Case) -> None:
    for _ in range(30):
        case.look(33)
    (alert,) = case.alerts.active
    assert (alert.id, alert.count, alert.intent) == ("message:/a", 990, Inspect("/a"))
    assert "990 messages" in alert.title
    assert alert.detail == "No json. See the raw bytes in the Inspector."


def test_alert_reports_the_number_of_unchecked_messages(case: Case) -> None:
    case.look(100, unchecked=0)
    case.look(1, unchecked=400)
    alert = case.alert()
    assert alert is not None
    assert alert.count == 101
    assert "400 more arrived too fast to be decoded" in alert.detail


def test_alert_is_resolved_by_a_second_of_valid_messages_and_count_restarts(case: Case) -> None:
    case.look(5)
    case.look(0, 1, last_good=True)
    case.health.check()
    assert case.alert() is not None
    case.now += RECOVERY_S
    case.health.check()
    assert case.alert() is None
    case.look(1)
    alert = case.alert()
    assert alert is not None
    assert "1 message on" in alert.title


def test_topic_with_valid_and_malformed_messages_keeps_one_alert(case: Case) -> None:
    seen = []
    for _ in range(20):
        case.look(1, 4, last_good=True)
        case.now += RECOVERY_S / 2
        case.health.check()
        alert = case.alert()
        seen.append(alert.since_s if alert is not None else None)
    assert len(set(seen)) == 1
    assert seen[0] is not None


def test_alert_of_topic_silent_after_errors_stays_until_unwatched(case: Case) -> None:
    case.look(2)
    case.now += 100
    case.health.check()
    assert case.alert() is not None
    case.health.discard("/a")
    assert case.alert() is None


def test_valid_messages_raise_no_alert(case: Case) -> None:
    case.look(0, 500, unchecked=7, last_good=True)
    assert case.alert() is None


def test_occupied_ports_are_one_developer_alert_that_opens_the_doctor(case: Case) -> None:
    ports = [Alert(f"port:{port}", f"Port {port} is taken", "Close it.") for port in (7000, 50000, 7777)]
    case.health.update_graph_alerts(GraphView(1, 1, alerts=(*ports, Alert("name:x", "2 x", ""))))
    told = {alert.id: (alert.intent, alert.for_developers) for alert in case.alerts.active}
    assert told == {"ports": (OpenDoctor(), True), "name:x": (None, False)}
    (both,) = [alert.title for alert in case.alerts.active if alert.id == "ports"]
    assert all(number in both for number in ("7000", "50000", "7777"))
    assert [alert.id for alert in case.alerts.errors_and_warnings()] == ["name:x"]
    case.health.update_graph_alerts(GraphView(1, 2, alerts=(ports[0],)))
    assert [alert.title for alert in case.alerts.active] == ["Port 7000 is taken"]
    case.health.update_graph_alerts(GraphView(1, 2))
    assert not case.alerts.active


def robot(*, virtual: bool, connected: bool = False) -> SimpleNamespace:
    shown = SimpleNamespace(sensors=())
    return SimpleNamespace(
        name="Rover",
        is_virtual=virtual,
        is_connected=connected,
        silence_reason=None,
        robot=shown,
        unended_actions="",
        rejected_messages=ReportedCount(),
        driver_exceptions=ReportedCount(),
        motion_warning="",
        stop_problem="",
    )


def test_disconnected_real_robot_is_reported_after_a_delay_and_resolved_on_return(case: Case) -> None:
    case.links.append(robot(virtual=False))
    case.health.check()
    assert case.alert() is None, "its driver may be starting again"
    case.now += RESTART_TIMEOUT_S
    case.health.check()
    alert = case.alert()
    assert alert is not None
    assert (alert.id, alert.title, alert.intent) == ("robot:Rover", "Rover disconnected.", OpenDoctor())
    case.health.check(used_names={"Rover"})
    used = case.alert()
    assert used is not None
    assert (used.severity, used.intent) == ("error", StopRobots())
    case.links[0].is_connected = True
    case.health.check()
    assert case.alert() is None
    case.links[0].is_connected = False
    case.health.check()
    assert case.alert() is None, "the time begins anew"


def test_virtual_robot_is_reported_only_while_its_process_runs_here(case: Case) -> None:
    case.links.append(robot(virtual=True))
    case.health.check()
    case.now += RESTART_TIMEOUT_S
    case.health.check()
    assert case.alert() is None, "it was ended, or belongs to somebody else"
    case.health.check(started_names={"Rover"})
    alert = case.alert()
    assert alert is not None
    assert (alert.title, alert.intent) == ("Rover isn't responding.", ConnectRobot("Rover"))


@pytest.mark.parametrize(
    ("kind", "attribute"), [("rejected", "rejected_messages"), ("errors", "driver_exceptions")]
)
def test_driver_that_rejects_messages_or_catches_exceptions_is_an_alert_until_it_stops(
    case: Case, kind: str, attribute: str
) -> None:
    link = robot(virtual=False, connected=True)
    case.links.append(link)
    count: ReportedCount = getattr(link, attribute)
    case.health.check()
    assert case.alert() is None
    for value in (1, 12):
        count.update(value, case.now)
        case.health.check()
    alert = case.alert()
    assert alert is not None
    assert (alert.id, alert.severity, alert.for_developers) == (f"{kind}:Rover", "warn", True)
    assert "Rover" in alert.title
    assert "12" in alert.title
    case.now += GROWTH_WINDOW_S
    count.update(12, case.now)
    case.health.check()
    assert case.alert() is None
    count.update(13, case.now)
    case.health.check()
    assert case.alert() is not None
    link.is_connected = False
    case.health.check()
    assert case.alert() is None


def seeing(name: str) -> SimpleNamespace:
    link = robot(virtual=True, connected=True)
    link.name = name
    link.robot = SimpleNamespace(sensors=(SimpleNamespace(is_image=True, topic=f"/{name}/camera"),))
    return link


def camera(name: str, subscribers: int) -> TopicInfo:
    sender = PublisherInfo(1, "n1", (), False, 5, 50, 5, 1_000_000_000, None, None)
    heard = tuple(SubscriberInfo(n, "n2", 0, 0) for n in range(subscribers))
    return TopicInfo(f"/{name}/camera", "image", "image", (sender,), heard, last_stamp_ns=1_000_000_000)


def test_hidden_camera_of_second_robot_is_not_reported_as_silent(case: Case) -> None:
    """A virtual robot publishes images only while its camera is watched."""
    case.links += [seeing("Pepper"), seeing("Turtle")]
    both = {f"/{name}/camera": camera(name, name == "Pepper") for name in ("Pepper", "Turtle")}
    case.topics.update(GraphView(1, 1, {}, both), 0)
    case.topics["/Pepper/camera"].is_watched = True
    case.topics.add("/Pepper/camera", Batch([Message("/Pepper/camera", b"", "image", "image")]), 49)
    case.topics.update_ages(50, 60 * 10**9)
    case.health.check()
    assert [link.silence_reason for link in case.links] == [None, None]
    assert case.alert() is None
    case.topics.update_ages(53, 60 * 10**9)
    case.health.check()
    alert = case.alert()
    assert alert is not None, "the one that is looked at is silent"
    assert alert.title == "The camera of Pepper has sent nothing for 4 s."
    assert [link.silence_reason for link in case.links] == ["camera silent", None]
