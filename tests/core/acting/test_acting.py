"""Tests of sending and calling by hand in a real session: its network, Stop, and the saved file."""

from __future__ import annotations

import json
import re
from pathlib import Path

import nep
from app.core.run.acting.acting import FILE_NAME, call_text, result_text
from app.core.run.acting.arming import Target
from app.core.run.acting.sending import SendOrder, SendResult
from app.core.run.acting.shelf import SavedMessage
from app.core.session import Session
from app.core.storage.settings import Settings
from tests.core.waiting import tick_until

STILL = SavedMessage("a", "Stand still", "/cmd_vel", "json", '{"x": 0, "id": {new id}}', (), 20.0)


def ended_count(session: Session) -> int | None:
    """Return how often the repeated message was sent, or None before its end."""
    found = (re.search(r"(\d+) sent", each.result_text) for each in session.acting.sent_log.records)
    return next((int(match[1]) for match in found if match), None)


def test_messages_and_calls_are_sent_and_stop_disarms(session: Session) -> None:
    acting = session.acting
    acting.saved_messages.set_message(STILL)
    with nep.node("robot") as node:
        heard = node.new_sub("/cmd_vel", "json")
        node.new_server("sum", lambda asked: {"sum": asked["a"] + asked["b"]}, threads=1)
        tick_until(session, lambda: "sum" in getattr(session.live.graph, "services", {}))
        assert acting.send(STILL) == ""
        assert acting.arming.targets == (Target("topic", "/cmd_vel"),)
        (armed,) = acting.sent_log.records
        assert (armed.origin, armed.result_text) == ("switch", "armed for 5 min")
        is_there, first = heard.listen(timeout_s=20.0)
        assert is_there
        tick_until(session, lambda: "a" in acting.last_results)
        assert result_text(acting.last_results["a"]) == "1 subscriber"
        assert acting.call("sum", '{"a": 2, "b": 3}', 20.0) == ""
        tick_until(session, lambda: acting.calls.in_flight is None)
        assert acting.calls.records[-1].reply == {"sum": 5}
        assert call_text(acting.calls.records[-1]).startswith("replied in ")
        assert acting.saved_messages.requests["sum"] == '{"a": 2, "b": 3}'
        sent, called = list(acting.sent_log.records)[1:]
        assert (sent.origin, sent.name, sent.result_text) == (
            "publish",
            "/cmd_vel",
            "Stand still, 1 subscriber",
        )
        assert json.loads(sent.text) == first
        assert (called.origin, called.name, called.is_error) == ("service", "sum", False)
        assert called.text == '{"a": 2, "b": 3}'
        assert acting.sent_log.total == 2
        assert acting.resend(sent.number) == acting.resend(called.number) == ""
        is_there, again = heard.listen(timeout_s=20.0)
        assert is_there
        assert again["id"] != first["id"]
        tick_until(session, lambda: acting.sent_log.total == 4)
        assert acting.resend(armed.number) == "This can't be sent again."
        assert acting.send(STILL, rate_hz=20.0) == ""
        is_there, second = heard.listen(timeout_s=20.0)
        assert is_there
        assert first["id"] != second["id"]
        session.runs.stop()
        assert not acting.arming.is_on
        assert acting.outbox.repeated_messages == ()
        tick_until(session, lambda: ended_count(session) is not None)
        for _ in range(1, ended_count(session) or 0):  # the first one is `second`
            assert heard.listen(timeout_s=20.0)[0]
        assert acting.resend(sent.number) == "Sending to /cmd_vel isn't armed. Arm it first."
        assert not acting.arming.is_on
        assert heard.receive(0.1) is None
    said = [each.text for each in session.console.records]
    assert "armed for 5 min" in said
    assert "/cmd_vel: Stand still, 1 subscriber" in said
    assert "no longer armed" in said


def test_invalid_message_is_rejected_with_reason_without_arming(session: Session) -> None:
    acting = session.acting
    for message, sentence in (
        (SavedMessage("b", "No topic", " "), "Choose a topic first."),
        (
            SavedMessage("b", "Wrong", "/t", "json", '{"a": }'),
            "Line 1, column 6: a value is missing after the colon.",
        ),
        (SavedMessage("b", "Open", "/t", "json", '{"a": {yaw}}'), "Fill in “yaw” first."),
        (SavedMessage("b", "Picture", "/t", "image"), "Messages of type image can't be edited by hand."),
    ):
        assert acting.send(message) == sentence
    assert acting.call("sum", '{"a"', 1.0) == "Line 1, column 5: a colon is missing after the name."
    assert not acting.arming.is_on


def test_saved_messages_are_written_to_file_and_file_damage_is_reported(tmp_path: Path) -> None:
    first = Session(Settings(tmp_path), address="127.0.0.1:1", start_processes=False)
    first.acting.saved_messages.set_message(STILL)
    first.acting.check()
    first.close()
    path = tmp_path / FILE_NAME
    again = Session(Settings(tmp_path), address="127.0.0.1:1", start_processes=False)
    assert again.acting.saved_messages.messages == (STILL,)
    assert not again.acting.arming.is_on
    again.close()
    told = json.loads(path.read_text("utf-8"))
    path.write_text(json.dumps({**told, "messages": [*told["messages"], 7]}), "utf-8")
    third = Session(Settings(tmp_path), address="127.0.0.1:1", start_processes=False)
    assert third.acting.saved_messages.messages == (STILL,)
    assert any("1 message can't be read" in each.detail for each in third.alerts.active)
    assert (tmp_path / "messages.damaged.json").is_file()
    third.close()


def test_file_of_saved_messages_of_newer_version_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / FILE_NAME
    data = json.dumps({"format": 99, "messages": []})
    path.write_text(data, "utf-8")
    session = Session(Settings(tmp_path), address="127.0.0.1:1", start_processes=False)
    session.acting.saved_messages.set_message(STILL)
    session.acting.check()
    session.close()
    assert path.read_text("utf-8") == data


def test_send_results_are_formatted() -> None:
    order = SendOrder("a", "Drive", "/cmd_vel", "json", dict)
    for result, words in (
        (SendResult(order, "sent", subscriber_count=2), "2 subscribers"),
        (SendResult(order, "sent"), "no subscribers"),
        (SendResult(order, "began"), "started"),
        (SendResult(order, "ended", count=412, dropped_count=3), "412 sent, 3 late messages skipped"),
        (SendResult(order, "failed", "not sent: no master was running"), "not sent: no master was running"),
        (SendResult(order, "failed", "it is closed", count=2), "2 sent, it is closed"),
        (SendResult(order, "ended"), "0 sent"),
    ):
        assert result_text(result) == words
