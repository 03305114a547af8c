"""Tests of alerts: sorted by severity, removed when resolved."""

from __future__ import annotations

import pytest

from app.core.alerts.alerts import Alerts


def test_alerts_are_sorted_by_severity_then_age() -> None:
    times = iter([1.0, 2.0, 3.0, 4.0])
    alerts = Alerts(lambda: next(times))
    alerts.raise_alert("a", "info", "a")
    alerts.raise_alert("b", "warn", "b")
    alerts.raise_alert("c", "error", "c")
    alerts.raise_alert("d", "warn", "d")
    assert [alert.id for alert in alerts.active] == ["c", "b", "d", "a"]


def test_repeated_alert_updates_its_count_and_keeps_its_start_time() -> None:
    times = iter([1.0, 9.0])
    alerts = Alerts(lambda: next(times))
    alerts.raise_alert("a", "warn", "one message")
    alerts.raise_alert("a", "warn", "five messages", count=4)
    (alert,) = alerts.active
    assert (alert.count, alert.title, alert.since_s) == (5, "five messages", 1.0)


def test_repeated_alert_with_zero_count_changes_nothing() -> None:
    alerts = Alerts(lambda: 1.0)
    alerts.raise_alert("a", "warn", "same")
    revision = alerts.revision
    alerts.raise_alert("a", "warn", "same", count=0)
    assert alerts.revision == revision


def test_resolved_alert_is_removed_and_shown_again_when_it_recurs() -> None:
    alerts = Alerts(lambda: 1.0)
    alerts.raise_alert("a", "warn", "a")
    alerts.dismiss("a")
    assert alerts.is_dismissed("a")
    assert alerts.active
    alerts.resolve("a")
    assert not alerts.active
    alerts.raise_alert("a", "warn", "a")
    assert not alerts.is_dismissed("a")


def test_resolve_all_removes_alerts_by_id_prefix() -> None:
    alerts = Alerts(lambda: 1.0)
    for id in ("message:/a", "message:/b", "master"):
        alerts.raise_alert(id, "warn", id)
    alerts.resolve_all("message:")
    assert [alert.id for alert in alerts.active] == ["master"]


def test_unknown_severity_is_rejected() -> None:
    with pytest.raises(ValueError, match="no severity 'bad'"):
        Alerts().raise_alert("a", "bad", "a")
