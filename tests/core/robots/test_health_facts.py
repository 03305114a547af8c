"""Tests of the single facts in the health report of a robot."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.core.network.topics import Topic
from app.core.robots.health_facts import LOW_BATTERY_PERCENT, HealthItem, health_items
from app.core.robots.reported_count import GROWTH_WINDOW_S, ReportedCount
from app.core.robots.robot_link import RobotLink
from app.robots import simulated
from app.robots.client import rize
from app.robots.description.description import DataField, Sensor, parse, thing_description

PEPPER = parse(thing_description(simulated.ROBOT.thing_model, "Pepper"))
NOW = 1000.0


def seconds(age_s: float) -> str:
    return f"{age_s:g} s"


class Case:
    """Healthy robot with all its topics."""

    def __init__(self) -> None:
        self.link = RobotLink(
            "Pepper",
            PEPPER,
            last_reply_s=NOW - 3,
            last_stop="confirmed in 41 ms, at 8:40",
            last_stop_status="ok",
        )
        self.link.values["battery"] = 84
        self.topics = {
            sensor.topic: Topic(sensor.topic, rate_hz=15.2, age_s=0.1) for sensor in PEPPER.sensors
        }

    def facts(self) -> tuple[HealthItem, ...]:
        return health_items(self.link, self.topics, NOW, seconds)  # type: ignore[arg-type]

    def says(self, title: str) -> tuple[str, str]:
        fact = next(fact for fact in self.facts() if fact.title == title)
        return fact.status, fact.text

    def with_sensor(self, sensor: Sensor, value: object) -> None:
        self.link.robot = replace(PEPPER, sensors=(*PEPPER.sensors, sensor))
        self.link.values[sensor.name] = value


@pytest.fixture
def case() -> Case:
    return Case()


def test_healthy_robot_has_only_ok_facts(case: Case) -> None:
    assert [(fact.title, fact.status, fact.text) for fact in case.facts()] == [
        ("Connection", "ok", "last response 3 s ago"),
        ("Battery", "ok", "84 %"),
        ("Stop", "ok", "confirmed in 41 ms, at 8:40"),
        ("Camera", "ok", "sends 15 images per second"),
        ("Sensors", "ok", f"all {len(PEPPER.sensors) - 1} are sending"),
        ("Safety stop", "ok", "stops 1 s after its program disappears"),
        ("Heartbeat", "ok", f"every {PEPPER.heartbeat_interval_s:g} s during actions"),
    ]
    assert not any(fact.needs_attention for fact in case.facts())


def test_unknown_facts_are_not_warnings(case: Case) -> None:
    case.link.last_reply_s = case.link.last_stop = None
    case.link.values.clear()
    case.topics.clear()
    assert case.says("Connection") == ("ok", "connected; no request sent yet")
    assert case.says("Battery") == ("off", "not reported yet")
    assert case.says("Stop") == ("off", "not used yet")
    assert case.says("Camera") == ("off", "no image yet")
    assert not any(fact.needs_attention for fact in case.facts())


def test_unwatched_camera_is_not_a_warning(case: Case) -> None:
    (camera,) = [sensor.topic for sensor in PEPPER.sensors if sensor.is_image]
    case.topics[camera] = Topic(camera, subscribers=0)
    assert case.says("Camera") == ("off", "ready (not in use)")
    case.topics[camera] = Topic(camera, age_s=15.0)
    assert case.says("Camera") == ("off", "ready (not in use)"), "it sent while somebody looked"
    case.topics[camera] = Topic(camera, subscribers=1, subscribed_since_s=NOW)
    assert case.says("Camera") == ("off", "no image yet")


def test_unresponsive_robot_shows_duration_and_advice(case: Case) -> None:
    case.link.is_unresponsive = True
    assert case.says("Connection") == ("error", "not responding for 3 s; restart it")
    case.link.last_reply_s = None
    case.link.robot = replace(PEPPER, virtual=False)
    assert case.says("Connection") == ("error", "not responding; check that it is switched on")


@pytest.mark.parametrize(
    ("title", "kind"),
    [("Rejected messages", "rejected_messages"), ("Driver exceptions", "driver_exceptions")],
)
def test_driver_rejections_and_exceptions_are_a_warning_while_they_increase(
    case: Case, title: str, kind: str
) -> None:
    assert title not in {fact.title for fact in case.facts()}
    count: ReportedCount = getattr(case.link, kind)
    count.update(12, NOW - 1)
    status, words = case.says(title)
    assert status == "warn"
    assert "12" in words
    count.last_increase_s = NOW - GROWTH_WINDOW_S
    status, words = case.says(title)
    assert status == "off"
    assert "12" in words


def test_disconnected_robot_shows_no_outdated_facts(case: Case) -> None:
    case.link.is_connected, case.link.gone_s = False, NOW - 12
    assert case.says("Connection") == ("warn", "disconnected 12 s ago; restart it")
    assert [fact.title for fact in case.facts()] == [
        "Connection",
        "Stop",
        "Safety stop",
        "Heartbeat",
    ]


def test_low_battery_is_the_first_fact(case: Case) -> None:
    case.link.values["battery"] = LOW_BATTERY_PERCENT - 1
    assert case.facts()[0] == HealthItem("Battery", "warn", "19 %; charge it soon")
    case.link.values["battery"] = LOW_BATTERY_PERCENT
    assert case.says("Battery") == ("ok", "20 %")


def test_warmest_part_is_named(case: Case) -> None:
    joints = Sensor(
        "joints", "joints", "object", "/joints",
        fields=(DataField("knee", "left knee", "number", "°C"), DataField("hip", "hip", "number", "°C")),
    )  # fmt: skip
    case.with_sensor(joints, {"knee": 44.2, "hip": 39.0})
    assert case.says("Temperature") == ("ok", "left knee 44 °C")
    case.link.values["joints"] = {"knee": 44.2, "hip": 61.0}
    assert case.says("Temperature") == ("warn", "hip warm, 61 °C; let it cool down")
    case.link.values["joints"] = None
    assert "Temperature" not in [fact.title for fact in case.facts()]


@pytest.mark.parametrize(
    ("last", "status"),
    [
        ("confirmed in 41 ms, at 8:40", "ok"),
        ("not confirmed, at 8:41", "error"),
        ("sent at 8:41; this robot can't confirm", "off"),
    ],
)
def test_last_stop_is_shown_with_its_status(case: Case, last: str, status: str) -> None:
    case.link.last_stop, case.link.last_stop_status = last, status
    assert case.says("Stop") == (status, last)


def test_silent_camera_is_an_error(case: Case) -> None:
    case.link.silence_reason = "camera silent"
    case.topics["/Pepper/camera"].silent_s = 4.0
    assert case.says("Camera") == ("error", "silent for 4 s")


def test_silent_periodic_sensors_are_a_warning(case: Case) -> None:
    case.topics["/Pepper/distance"].silent_s = 8.0
    case.topics["/Pepper/heard_word"].silent_s = 8.0  # publishes only when there is an event
    assert case.says("Sensors") == ("warn", "distance silent for 8 s")
    case.topics["/Pepper/sees_ball"].silent_s = 9.0
    assert case.says("Sensors") == ("warn", "distance and 1 more silent for 9 s")
    case.topics["/Pepper/distance"].gone_s = case.topics["/Pepper/sees_ball"].gone_s = 1.0
    assert case.says("Sensors")[0] == "ok"


def test_unsubscribed_sensors_are_not_reported_as_silent(case: Case) -> None:
    case.topics["/Pepper/distance"].age_s = 80.0
    assert case.says("Sensors") == ("ok", f"all {len(PEPPER.sensors) - 1} are sending")


def test_sensors_without_messages_are_not_counted_as_sending(case: Case) -> None:
    felt = [sensor.topic for sensor in PEPPER.sensors if not sensor.is_image]
    for topic in felt:
        case.topics[topic] = Topic(topic)
    assert case.says("Sensors") == ("off", f"none of {len(felt)} has sent anything yet")
    case.topics[felt[0]].age_s = 0.2
    assert case.says("Sensors") == ("ok", f"1 of {len(felt)} have sent data")
    case.link.robot = replace(PEPPER, sensors=PEPPER.sensors[:1])
    assert case.says("Sensors") == ("ok", "1 sensor is sending")
    case.topics[felt[0]].age_s = None
    assert case.says("Sensors") == ("off", "has sent nothing yet")


def test_rize_robot_has_no_heartbeat_fact_and_its_stop_and_watchdog_facts_are_off(case: Case) -> None:
    case.link.robot = rize.robot("Nao")
    case.link.last_stop = None
    assert case.says("Stop") == ("off", "not used yet; this robot can't confirm")
    assert case.says("Safety stop")[0] == "off"
    assert "Heartbeat" not in [fact.title for fact in case.facts()]
    assert not any(fact.needs_attention for fact in case.facts())
