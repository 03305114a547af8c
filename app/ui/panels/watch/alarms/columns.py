"""Texts of alarm states and the columns of the history table."""

from __future__ import annotations

import csv
import datetime as dt
import io
from collections.abc import Callable, Iterable

from app.core.parts.alarms import SessionAlarms, severity_of
from app.ui.text.dates import clock_text, date_time_text
from app.ui.text.numbers import seconds_text
from app.ui.widgets.table.model import Cell, Column
from nep.i18n import _, lazy, ngettext
from nep.programs.alarms import AlarmRule, AlarmState
from nep.programs.alarms.history import AlarmRecord
from nep.programs.alarms.rule import problem_of
from nep.programs.alarms.sentences import current_value_text

PROBLEM_TEXTS = {
    "missing": lazy("the newest message has no such field"),
    "no_number": lazy("the value isn't a number"),
    "unreadable": lazy("the newest message can't be decoded"),
}


def local_datetime(seconds: float) -> dt.datetime:
    """Convert seconds since 1970 to a datetime in the local time zone."""
    return dt.datetime.fromtimestamp(seconds, tz=dt.timezone.utc).astimezone()


def state_chip(rule: AlarmRule, state: AlarmState, now_s: float) -> tuple[str, str, str | None]:
    """Return the contents of an alarm's state chip.

    Args:
        rule: Rule of the alarm.
        state: Current state of the alarm.
        now_s: Current time in seconds since 1970.

    Returns:
        Text, status and icon. An icon of None stands for the default icon of the status.
    """
    value_text = current_value_text(rule.condition, state.value)
    match state.phase:
        case "faulty":
            problem = problem_of(rule)
            if not rule.condition.name or problem is None:
                return _("not finished yet"), "off", None
            return problem.message, "warn", None
        case "off":
            return _("off"), "off", None
        case "waits":
            return _("waits for {name}").format(name=rule.condition.name), "off", None
    if rule.is_snoozed(now_s):
        snooze_end = clock_text(local_datetime(rule.snoozed_until_s))
        text = _("{seen}, snoozed until {clock}") if value_text else _("snoozed until {clock}")
        return text.format(seen=value_text, clock=snooze_end), "warn", "bell-off"
    if state.phase == "on":
        duration = _("active for {time}").format(time=seconds_text(state.on_duration_s))
        has_value = bool(value_text) and rule.condition.kind != "silent"
        text = _("{state}, {seen}").format(state=duration, seen=value_text) if has_value else duration
        return text, severity_of(rule.condition), None
    if state.phase == "pending":
        return value_text or _("pending"), "warn", None
    return value_text or _("OK"), "ok", None


def note_text(rule: AlarmRule, state: AlarmState, alarms: SessionAlarms, now: dt.datetime) -> str:
    """Return the note next to the state chip.

    The note consists of the failed action that will be retried, the reason why the condition can't be
    evaluated, and how often the alarm was triggered today or when it was triggered last.
    """
    parts = []
    retry_s = alarms.alarms.retry_in_s(rule.id)
    last = alarms.history.last(rule.id)
    if retry_s is not None and last is not None and last.action_results:
        parts.append(
            _("{what}; next try in {time}").format(
                what=last.action_results[-1].text, time=seconds_text(round(retry_s))
            )
        )
    if state.problem:
        parts.append(_(PROBLEM_TEXTS[state.problem]))
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0).timestamp()
    today = alarms.history.count_since(rule.id, midnight)
    if today:
        parts.append(ngettext("once today", "{count} times today", today).format(count=today))
    elif last is not None:
        parts.append(
            _("last active {when}").format(when=_lower_first(date_time_text(local_datetime(last.at_s), now)))
        )
    else:
        parts.append(_("never active"))
    return ", ".join(parts)


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]


def history_columns(
    severity: Callable[[AlarmRecord], str], now: Callable[[], dt.datetime]
) -> tuple[Column[AlarmRecord], ...]:
    """Return the columns of the history table.

    Args:
        severity: Returns the severity of a record's alarm, "error" or "warn".
        now: Returns the current local time.
    """

    def when_cell(record: AlarmRecord) -> Cell:
        recorded_at = local_datetime(record.at_s)
        is_today = recorded_at.date() == now().date()
        text = (
            recorded_at.strftime("%H:%M:%S").lstrip("0") if is_today else date_time_text(recorded_at, now())
        )
        return Cell(text, role="textSecondary", mono=is_today)

    def alarm_cell(record: AlarmRecord) -> Cell:
        icon = "check"
        if record.is_on:
            icon = "circle-x" if severity(record) == "error" else "triangle-alert"
        return Cell(record.cause, icon, severity(record) if record.is_on else "text")

    def duration_cell(record: AlarmRecord) -> Cell:
        if record.is_on:
            on_s = max(0.0, now().timestamp() - record.at_s)
            return Cell(_("{time}, active").format(time=seconds_text(on_s)), role=severity(record))
        return Cell(seconds_text(record.duration_s) if record.duration_s is not None else "")

    return (
        Column("when", lazy("When"), 136, when_cell, key=lambda record: record.at_s, is_numeric=False),
        Column("alarm", lazy("Alarm"), 180, alarm_cell, stretch=True, tip=lambda record: record.cause),
        Column("times", lazy("Count"), 56, lambda record: Cell(str(record.count) if record.count > 1 else ""),
               key=lambda record: record.count, is_numeric=True, hide_order=2),
        Column("lasted", lazy("Duration"), 84, duration_cell, key=lambda record: record.duration_s,
               is_numeric=True),
        Column("did", lazy("Actions"), 210, lambda record: Cell(actions_text(record), role="textSecondary"),
               tip=actions_text, hide_order=1),
    )  # fmt: skip


def actions_text(record: AlarmRecord) -> str:
    """Format the results of a record's actions, such as "restart_lidar did not answer, sound"."""
    if record.was_snoozed and not record.action_results:
        return _("none, snoozed")
    return ", ".join(result.text for result in record.action_results)


def csv_text(records: Iterable[AlarmRecord]) -> str:
    """Format records as CSV (RFC 4180) with a header row and ISO 8601 times, in the given order."""
    output = io.StringIO()
    writer = csv.writer(output)
    writer.writerow(("at", "alarm", "lasted_s", "times", "did"))
    for record in records:
        duration = "" if record.duration_s is None else f"{record.duration_s:.3f}"
        cells = [_escape_formula(text) for text in (record.cause, actions_text(record))]
        writer.writerow((local_datetime(record.at_s).isoformat(), cells[0], duration, record.count, cells[1]))
    return output.getvalue()


def _escape_formula(text: str) -> str:
    # Prevent CSV injection: spreadsheets evaluate such cells as formulas.
    return f"'{text}" if text[:1] in {"=", "+", "-", "@", "\t", "\r"} else text
