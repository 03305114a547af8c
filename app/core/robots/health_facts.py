"""Health of one robot as a list of items: connection, battery, sensors, Stop.

The status of an item tells if it needs attention. Unknown values are listed as unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.core.network.topics import Topic, Topics
from app.core.robots.reported_count import ReportedCount
from app.core.robots.robot_link import RobotLink
from app.robots.client.dialects import dialect_of
from app.robots.client.limits import SENSOR_SILENCE_TIMEOUT_S
from app.robots.description.description import Sensor
from app.robots.description.json_access import finite_float
from nep.i18n import _, lazy, ngettext, number, plazy

MAX_MISSED_MESSAGES = 5
"""Number of consecutive missing messages after which a sensor counts as silent."""
LOW_BATTERY_PERCENT = 20
WARM_MOTOR_C = 60
"""Temperature in °C above which the motors of small robots begin to lose torque."""

CONNECTION, BATTERY, TEMPERATURE = lazy("Connection"), lazy("Battery"), lazy("Temperature")
STOP, CAMERA, SENSORS = plazy("row of a table", "Stop"), lazy("Camera"), lazy("Sensors")
REJECTED, ERRORS = lazy("Rejected messages"), lazy("Driver exceptions")
SAFETY_STOP, HEARTBEAT = lazy("Safety stop"), lazy("Heartbeat")
REPORTED_TITLES = frozenset({BATTERY, TEMPERATURE, CAMERA, SENSORS})

FormatAge = Callable[[float], str]


@dataclass(frozen=True, slots=True)
class HealthItem:
    """One item of a robot's health, such as the battery.

    Attributes:
        title: One of the constants of this module, to be translated with `nep.i18n`.
        status: "ok", "warn", "error", or "off" if the value is missing or unknown.
        text: Value as text.
    """

    title: str
    status: str
    text: str

    @property
    def needs_attention(self) -> bool:
        """True if the status is "warn" or "error"."""
        return self.status in ("warn", "error")


def health_items(
    link: RobotLink, topics: Topics, now: float, format_age: FormatAge
) -> tuple[HealthItem, ...]:
    """Return the health of a robot; items that need attention come first.

    Args:
        link: State of the robot.
        topics: Topics of the live network.
        now: Monotonic seconds, on the same clock as the times in ``link``.
        format_age: Formats a duration, such as "14 s".
    """
    items = [_connection(link, now, format_age)]
    if link.is_connected:
        items += [*_battery(link), *_temperature(link)]
    items.append(_stop(link))
    if link.is_connected:
        items += [*_camera(link, topics, format_age), *_sensors(link, topics, format_age)]
        items += [
            *_count_items(REJECTED, link.rejected_messages, now),
            *_count_items(ERRORS, link.driver_exceptions, now),
        ]
    items += [_watchdog_item(link), *_heartbeat_items(link)]
    return tuple(sorted(items, key=lambda item: not item.needs_attention))


def has_reported(link: RobotLink, items: Sequence[HealthItem]) -> bool:
    """Return True if the robot has sent a message; otherwise only its description is known."""
    return link.last_reply_s is not None or any(
        item.title in REPORTED_TITLES and item.status == "ok" for item in items
    )


def _connection(link: RobotLink, now: float, format_age: FormatAge) -> HealthItem:
    age = format_age(now - link.last_reply_s) if link.last_reply_s is not None else ""
    if not link.is_connected:
        if link.gone_s is None:
            template = (
                _("disconnected; restart it")
                if link.is_virtual
                else _("disconnected; check that it is switched on")
            )
            return HealthItem(CONNECTION, "warn", template)
        template = (
            _("disconnected {age} ago; restart it")
            if link.is_virtual
            else _("disconnected {age} ago; check that it is switched on")
        )
        return HealthItem(CONNECTION, "warn", template.format(age=format_age(now - link.gone_s)))
    if link.is_unresponsive:
        return HealthItem(CONNECTION, "error", _unresponsive_text(link, age))
    template = _("last response {age} ago").format(age=age) if age else _("connected; no request sent yet")
    return HealthItem(CONNECTION, "ok", template)


def _unresponsive_text(link: RobotLink, age: str) -> str:
    if not age:
        return (
            _("not responding; restart it")
            if link.is_virtual
            else _("not responding; check that it is switched on")
        )
    template = (
        _("not responding for {age}; restart it")
        if link.is_virtual
        else _("not responding for {age}; check that it is switched on")
    )
    return template.format(age=age)


def _battery(link: RobotLink) -> Iterable[HealthItem]:
    for sensor in link.robot.sensors:
        if "battery" not in f"{sensor.name} {sensor.title}".casefold() or sensor.unit != "%":
            continue
        value = finite_float(link.values.get(sensor.name))
        if value is None:
            yield HealthItem(BATTERY, "off", _("not reported yet"))
        elif value < LOW_BATTERY_PERCENT:
            yield HealthItem(BATTERY, "warn", _("{percent} %; charge it soon").format(percent=f"{value:.0f}"))
        else:
            yield HealthItem(BATTERY, "ok", f"{value:.0f} %")
        return


def _temperature(link: RobotLink) -> Iterable[HealthItem]:
    readings = [reading for sensor in link.robot.sensors for reading in _temperatures(sensor, link.values)]
    if readings:
        value, title = max(readings)
        if value >= WARM_MOTOR_C:
            yield HealthItem(
                TEMPERATURE,
                "warn",
                _("{what} warm, {degrees} °C; let it cool down").format(what=title, degrees=f"{value:.0f}"),
            )
        else:
            yield HealthItem(TEMPERATURE, "ok", f"{title} {value:.0f} °C")


def _temperatures(sensor: Sensor, values: Mapping[str, object]) -> Iterable[tuple[float, str]]:
    value = values.get(sensor.name)
    degrees = finite_float(value)
    if sensor.unit == "°C" and degrees is not None:
        yield degrees, sensor.title
    for field in sensor.fields:
        nested_value = value.get(field.name) if isinstance(value, Mapping) else None
        degrees = finite_float(nested_value)
        if field.unit == "°C" and degrees is not None:
            yield degrees, field.title


def _stop(link: RobotLink) -> HealthItem:
    if link.unended_actions:
        return HealthItem(STOP, "error", link.unended_actions)
    if link.motion_warning:
        return HealthItem(STOP, "error", link.motion_warning)
    if link.is_connected and not link.is_reachable:
        return HealthItem(STOP, "off", _("can't be sent yet: the robot is connecting"))
    if link.is_stopping:
        return HealthItem(STOP, "off", _("Stop sent; waiting for confirmation"))
    if link.last_stop is not None:
        return HealthItem(STOP, link.last_stop_status, link.last_stop)
    text = _("not used yet") if link.can_confirm_stop else _("not used yet; this robot can't confirm")
    return HealthItem(STOP, "off", text)


def _camera(link: RobotLink, topics: Topics, format_age: FormatAge) -> Iterable[HealthItem]:
    camera = next((sensor for sensor in link.robot.sensors if sensor.is_image), None)
    if camera is None:
        return
    topic = topics.get(camera.topic)
    if link.silence_reason is not None and topic is not None and topic.silent_s is not None:
        yield HealthItem(CAMERA, "error", _("silent for {age}").format(age=format_age(topic.silent_s)))
    elif topic is not None and topic.rate_hz:
        rate = round(topic.rate_hz)
        template = ngettext("sends {rate} image per second", "sends {rate} images per second", rate)
        yield HealthItem(CAMERA, "ok", template.format(rate=rate))
    elif topic is not None and topic.gone_s is None and topic.subscribed_since_s is None:
        yield HealthItem(CAMERA, "off", _("ready (not in use)"))
    else:
        yield HealthItem(CAMERA, "off", _("no image yet"))


def _sensors(link: RobotLink, topics: Topics, format_age: FormatAge) -> Iterable[HealthItem]:
    sensors = [sensor for sensor in link.robot.sensors if not sensor.is_image]
    silent = [(sensor, topic) for sensor in sensors if _is_silent(sensor, topic := topics.get(sensor.topic))]
    if not sensors:
        return
    if silent:
        age = format_age(max(topic.silent_s or 0.0 for _sensor, topic in silent if topic is not None))
        first_title, other_count = silent[0][0].title, len(silent) - 1
        template = (
            _("{sensor} silent for {age}")
            if not other_count
            else _("{sensor} and {more} more silent for {age}")
        )
        yield HealthItem(SENSORS, "warn", template.format(sensor=first_title, more=other_count, age=age))
        return
    sent_count = sum(1 for sensor in sensors if _has_sent(topics.get(sensor.topic)))
    if not sent_count:
        template = ngettext("has sent nothing yet", "none of {count} has sent anything yet", len(sensors))
        yield HealthItem(SENSORS, "off", template.format(count=len(sensors)))
    elif sent_count < len(sensors):
        yield HealthItem(
            SENSORS, "ok", _("{sent} of {count} have sent data").format(sent=sent_count, count=len(sensors))
        )
    else:
        yield HealthItem(
            SENSORS,
            "ok",
            ngettext("{count} sensor is sending", "all {count} are sending", len(sensors)).format(
                count=len(sensors)
            ),
        )


def _has_sent(topic: Topic | None) -> bool:
    return topic is not None and topic.gone_s is None and topic.age_s is not None


def _is_silent(sensor: Sensor, topic: Topic | None) -> bool:
    # Only sensors with a rate can be silent; others may have no change to report.
    if sensor.rate_hz is None or topic is None or topic.silent_s is None or topic.gone_s is not None:
        return False
    return topic.silent_s > max(SENSOR_SILENCE_TIMEOUT_S, MAX_MISSED_MESSAGES / sensor.rate_hz)


def _count_items(title: str, count: ReportedCount, now: float) -> Iterable[HealthItem]:
    if count.is_growing(now):
        yield HealthItem(title, "warn", _("{count} so far; see the driver's log").format(count=count.value))
    elif count.value:
        yield HealthItem(title, "off", _("{count} since the driver started").format(count=count.value))


def _watchdog_item(link: RobotLink) -> HealthItem:
    watchdog_s = link.robot.safe_stop.watchdog_s
    if watchdog_s is None:
        return HealthItem(SAFETY_STOP, "off", _("none; stay near the robot's power switch"))
    return HealthItem(
        SAFETY_STOP,
        "ok",
        _("stops {seconds} s after its program disappears").format(seconds=number(watchdog_s)),
    )


def _heartbeat_items(link: RobotLink) -> Iterable[HealthItem]:
    interval_s = link.robot.heartbeat_interval_s
    if interval_s is not None:
        yield HealthItem(
            HEARTBEAT, "ok", _("every {seconds} s during actions").format(seconds=number(interval_s))
        )
    elif dialect_of(link.robot).is_identified:
        yield HealthItem(HEARTBEAT, "off", _("none during actions"))
