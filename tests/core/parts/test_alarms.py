"""Tests of a session's alarms: their alerts, their actions on a real network and their file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import nep
from app.core.parts.alarms import FILE_NAME, MAX_MESSAGE_AGE_S
from app.core.session import Session
from app.core.storage.settings import Settings
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule
from nep.programs.alarms.rule_file import encode_alarms, read_alarms
from tests.core.robots.test_motion_gate import TOPIC, real_robot
from tests.core.waiting import tick_until
from tests.nep.alarms.scene import message

BELOW = AlarmCondition("below", "/distance", "range", 0.4)


def alert(session: Session, rule: AlarmRule):
    return next((each for each in session.alerts.active if each.id == f"alarm:{rule.id}"), None)


@pytest.mark.usefixtures("patient")
def test_alarm_triggered_by_a_value_calls_a_service_and_publishes(session: Session) -> None:
    asked, answer = [], "fine"

    def restart(request: object) -> object:
        asked.append(request)
        return answer

    with nep.node("robot") as node:
        node.new_server("restart", restart, threads=1)
        heard = node.new_sub("/say", "json")
        publisher = node.new_pub("/distance", "json")
        actions = (
            AlarmAction("banner"),
            AlarmAction("call", "restart", {"n": 1}),
            AlarmAction("send", "/say", {"say": "near"}),
            AlarmAction("keep"),
            AlarmAction("run", "Greeting"),
            AlarmAction("console"),
        )
        rule = AlarmRule("d", BELOW, actions)
        session.alarms.set_rule(rule)
        tick_until(session, lambda: publisher.subscribers == 1)
        publisher.publish({"range": 0.36})
        tick_until(session, lambda: alert(session, rule) is not None)
        record = session.alarms.history.records[0]
        tick_until(session, lambda: len(record.action_results) == 4)
        assert asked == [{"n": 1}]
        assert heard.listen(timeout_s=60.0) == (True, {"say": "near"})
        assert {deed.kind: deed.text for deed in record.action_results} == {
            "call": "restart replied",
            "send": "sent to /say",
            "keep": "nothing saved: the flight recorder is off",
            "run": "“Greeting” wasn't started: no window is open",
        }
        said = alert(session, rule)
        assert said.title == "Range of /distance is 0.36, below 0.4."
        assert not session.alerts.is_dismissed(said.id)
        assert any(line.text.startswith("range of /distance") for line in session.console.records)
        publisher.publish({"range": 2})
        tick_until(session, lambda: alert(session, rule) is None)
        assert record.duration_s is not None


@pytest.mark.usefixtures("patient")
def test_alarm_moves_a_real_robot_only_after_confirmation(session: Session, master) -> None:
    moved: list[tuple[object, str]] = []
    session.alarms.on_moved = lambda robots, by: moved.append((robots, by))
    rule = AlarmRule("d", BELOW, (AlarmAction("send", TOPIC, {"op": "invoke"}),))
    session.alarms.set_rule(rule)
    with real_robot(session, master.address) as told, nep.node("sensor") as node:
        publisher = node.new_pub("/distance", "json")
        tick_until(session, lambda: publisher.subscribers == 1)
        permission = session.fleet.permission

        def come_on() -> list[str]:
            """Trigger the alarm again and return the results of its actions."""
            publisher.publish({"range": 0.1})
            tick_until(session, lambda: session.alarms.active)
            return [deed.text for deed in session.alarms.history.records[0].action_results]

        assert come_on() == []
        tick_until(session, lambda: permission.question is not None)
        assert permission.question.title == "Allow Rover to move?"
        assert f"An alarm wants to send a message on {TOPIC}" in permission.question.message
        permission.answer(is_allowed=False)
        tick_until(session, lambda: session.alarms.history.records[0].action_results)
        assert (
            session.alarms.history.records[0].action_results[0].text
            == "not sent: no permission to move Rover"
        )
        session.alarms.set_rule(AlarmRule("e", BELOW, rule.actions))
        publisher.publish({"range": 0.1})
        tick_until(session, lambda: permission.question is not None)
        assert (told, moved) == ([], [])
        permission.answer(is_allowed=True)
        tick_until(session, lambda: told == [{"op": "invoke"}])
        assert moved == [(("Rover",), "alarm")]


def test_alarm_without_banner_is_shown_only_in_the_alert_list(session: Session) -> None:
    with nep.node("robot") as node:
        publisher = node.new_pub("/distance", "json")
        rule = AlarmRule("d", BELOW, ())
        session.alarms.set_rule(rule)
        tick_until(session, lambda: publisher.subscribers == 1)
        publisher.publish({"range": 0.1})
        tick_until(session, lambda: alert(session, rule) is not None)
        assert session.alerts.is_dismissed("alarm:d")
        assert [each.id for each in session.alarms.active] == ["d"]
        session.alarms.remove("d")
        tick_until(session, lambda: alert(session, rule) is None)
        assert publisher.subscribers == 1 or not session.alarms.alarms.evaluator.topics
        session.alarms.restore()
        assert [each.id for each in session.alarms.rules] == ["d"]


def at_rest(folder: Path) -> Session:
    """Return a session that has joined no network."""
    return Session(Settings(folder), address="127.0.0.1:1", start_processes=False)


def test_complete_alarms_and_their_snooze_are_restored_after_a_restart(tmp_path: Path) -> None:
    first = at_rest(tmp_path)
    kept = first.alarms.create(BELOW)
    first.alarms.create(AlarmCondition("silent", "", for_s=2.0))  # incomplete: no topic
    first.alarms.create(AlarmCondition("below", "/distance", "", 1))  # ... or no field path
    first.alarms.snooze(kept.id, 4e9)
    first.close()
    assert [rule.id for rule in read_alarms(tmp_path / FILE_NAME).rules] == [kept.id]
    second = at_rest(tmp_path)
    assert [(rule.id, rule.snoozed_until_s) for rule in second.alarms.rules] == [(kept.id, 4e9)]
    assert [each.id for each in second.alerts.active if each.id.startswith("alarms:")] == []
    second.close()


def test_number_of_alarms_is_limited_to_the_file_capacity(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("app.core.parts.alarms.MAX_ALARMS", 5)
    session = at_rest(tmp_path)
    for _ in range(5):
        session.alarms.create(BELOW)
    first = session.alarms.rules[-1]
    session.alarms.remove(first.id)
    session.alarms.create(BELOW)
    assert all(each.id != "alarms:most" for each in session.alerts.active)
    one_more = session.alarms.create(BELOW)
    session.alarms.restore()  # the limit is reached, so nothing is restored
    assert not {one_more.id, first.id} & {rule.id for rule in session.alarms.rules}
    assert any(each.id == "alarms:most" for each in session.alerts.active)
    session.alarms.remove(session.alarms.rules[0].id)
    assert all(each.id != "alarms:most" for each in session.alerts.active)
    session.alarms.restore()
    session.close()
    assert len(read_alarms(tmp_path / FILE_NAME).rules) == 5


def test_active_alarm_is_shown_even_if_its_history_record_was_evicted(tmp_path: Path) -> None:
    session = at_rest(tmp_path)
    rule = AlarmRule("d", BELOW, (AlarmAction("banner"),))
    session.alarms.set_rule(rule)
    session.alarms.evaluate("/distance", [message("/distance", {"range": 0.1})])
    session.tick()
    session.alarms.history.records.clear()
    session.alarms.check()
    said = alert(session, rule)
    assert said is not None
    assert said.title == "Range of /distance is 0.1, below 0.4."
    session.close()


@pytest.mark.parametrize("data", [b"{oops", b"\xff", b"[]", b""])
def test_damaged_alarm_file_is_backed_up_and_reported(tmp_path: Path, data: bytes) -> None:
    (tmp_path / FILE_NAME).write_bytes(data)
    session = at_rest(tmp_path)
    assert session.alarms.rules == ()
    assert (tmp_path / "alarms.damaged.json").read_bytes() == data
    (said,) = [each for each in session.alerts.active if each.id == "alarms:file"]
    assert "alarms.damaged.json" in said.detail
    session.alarms.create(BELOW)
    session.close()
    assert len(read_alarms(tmp_path / FILE_NAME).rules) == 1


def test_invalid_alarm_in_the_file_does_not_disable_the_others(tmp_path: Path) -> None:
    text = json.loads(encode_alarms([AlarmRule("good", BELOW)]))
    text["alarms"].append({"when": {"topic": "/t", "is": "sielnt"}})
    (tmp_path / FILE_NAME).write_text(json.dumps(text), encoding="utf-8")
    session = at_rest(tmp_path)
    assert [rule.id for rule in session.alarms.rules] == ["good"]
    assert json.loads((tmp_path / "alarms.damaged.json").read_text(encoding="utf-8")) == text
    session.close()


def test_alarm_file_of_a_newer_version_is_not_modified(tmp_path: Path) -> None:
    data = b'{"format": 2, "alarms": [], "more": true}'
    (tmp_path / FILE_NAME).write_bytes(data)
    session = at_rest(tmp_path)
    session.alarms.create(BELOW)
    session.close()
    assert (tmp_path / FILE_NAME).read_bytes() == data
    assert not (tmp_path / "alarms.damaged.json").exists()


def test_alarm_message_expires_if_no_master_is_found_in_time(tmp_path: Path) -> None:
    now = [0.0]
    session = Session(Settings(tmp_path), address="127.0.0.1:1", start_processes=False, clock=lambda: now[0])
    jobs = []
    session.live.source.submit = lambda _what, job: jobs.append(job)  # type: ignore[method-assign]
    told: list[tuple[bool, str]] = []
    session.alarms._submit_command(None, AlarmAction("send", "/cmd", 1), lambda *said: told.append(said))  # type: ignore[arg-type]
    now[0] += MAX_MESSAGE_AGE_S + 1
    jobs[0](None)
    assert told == [(False, "no master was running")]
    session.close()
