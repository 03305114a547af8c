"""Tests of program logs in the session's console and of the alerts' link to the doctor.

Each record is shown once, and their number is bounded.
"""

from __future__ import annotations

import re
import threading
import time
from pathlib import Path

import pytest

import nep
from app.core.alerts.alerts import Alerts
from app.core.network.source import MasterFound, MasterLost
from app.core.robots.launcher import LaunchFailed
from app.core.session import Session
from app.core.storage.settings import Settings
from app.intents import Intent, OpenDoctor
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, MAX_BURST, MAX_RATE_HZ
from tests.blocks.samples import block, number, stack, started, text, workspace, write
from tests.core.waiting import tick_until
from tests.nep.programs import eventually

pytestmark = pytest.mark.usefixtures("patient")  # records are published once


def told(session: Session, origin: str) -> list[str]:
    return [line.text for line in session.console.records if line.origin == origin]


def listening(session: Session, node: nep.Node) -> None:
    """Wait until Studio has subscribed to the log topic, so that no record is published before."""

    def subscribed() -> bool:
        topic = node.graph().topics.get("/nep/log")
        return topic is not None and bool(topic.subscribers)

    tick_until(session, subscribed)


def test_first_log_record_of_a_node_arrives_and_the_log_topic_is_not_reported_as_new(
    session: Session,
) -> None:
    with nep.node("driver") as node:
        listening(session, node)
        node.log.warning("low battery")
        tick_until(session, lambda: told(session, "driver"))
        tick_until(session, lambda: "/nep/log" in session.live.topics)
        assert told(session, "driver") == ["low battery"]
        assert not any("/nep/log" in line for line in told(session, "master"))
    tick_until(session, lambda: "driver left" in told(session, "master"))


def test_session_that_starts_late_shows_the_last_errors_once(
    master: nep.Master, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    with nep.node("driver") as node:
        node.log.error("the brake is hot")
        eventually(lambda: LAST_ERRORS_TOPIC in node.graph().topics)
        late = Session(
            Settings(tmp_path), address=master.address, journal_folder=tmp_path, start_processes=False
        )
        late.start()
        try:
            tick_until(late, lambda: told(late, "driver"))
            node.log.error("the brake is gone")
            tick_until(late, lambda: len(told(late, "driver")) > 1)

            def is_over() -> bool:
                node.log.info("over")  # repeated, because the late session may not be connected yet
                return "over" in told(late, "driver")

            tick_until(late, is_over)
            errors = [line for line in told(late, "driver") if line != "over"]
            assert errors == ["the brake is hot", "the brake is gone"]
        finally:
            late.close()


def test_flood_of_log_records_is_bounded_and_drops_are_counted_exactly(session: Session) -> None:
    shown: list[str] = []

    def count() -> int:
        nonlocal shown
        lines = told(session, "storm") + told(session, "studio")
        shown = [line for line in lines if not re.search("left out|dropped", line)]
        left_out = sum(int(line.split()[0]) for line in lines if re.search("left out|dropped", line))
        return len(shown) + left_out

    with nep.node("storm") as node:
        listening(session, node)
        began = time.monotonic()
        for number in range(10_000):
            node.log.info("%d", number)
        flooded_s = time.monotonic() - began
        # first what is queued, because a node that closes waits only a second for its records
        tick_until(session, lambda: count() + node.log_handler.unreported_drops == 10_000)
    tick_until(session, lambda: count() == 10_000)
    assert 0 < len(shown) <= MAX_BURST + MAX_RATE_HZ * (flooded_s + 1.0)


def test_program_output_is_shown_once_even_if_it_is_also_published_as_log(session: Session) -> None:
    heard: list[object] = []
    waits = block("control_wait", SECONDS=number(600))  # after an exit, only 1 s is left for log records

    def printed() -> list[tuple[str, str]]:
        return [(line.origin, line.text) for line in session.console.records if line.text in {"hello", "7"}]

    with nep.node("page") as page, page.new_sub("/nep/log", "nep/log") as records:
        tick_until(session, lambda: session.live.master.kind == "connected")
        session.document.apply_edit(
            workspace(stack(started(), write(text("hello")), write(number(7)), waits))
        )
        session.runs.run()

        def by_both_ways() -> bool:
            heard.extend(payload for ok, payload in [records.listen()] if ok)
            return len(heard) >= 2 and len(printed()) >= 2

        tick_until(session, by_both_ways)
        name = session.document.name
        assert [record["text"] for record in heard] == ["hello", "7"]  # type: ignore[index]
        assert {record["node"] for record in heard} == {f"program {name}"}  # type: ignore[index]
        session.runs.stop()
        tick_until(session, lambda: not session.runs.active)
    session.tick()
    assert printed() == [(name, "hello"), (name, "7")]


def test_connection_alerts_link_to_the_doctor(session: Session) -> None:
    def next_steps(alerts: Alerts) -> dict[str, Intent | None]:
        return {alert.id: alert.intent for alert in alerts.active}

    session._on_event(MasterFound("127.0.0.1:1"))
    session._on_event(MasterLost("127.0.0.1:1", "no master answers"))
    session._on_event(LaunchFailed("master", "The master can't be started.", "Port …", False))
    assert next_steps(session.alerts) == {"master": OpenDoctor(), "companion:master": OpenDoctor()}
    assert {alert.button for alert in session.alerts.active} == {"Open the connection doctor"}


def test_doctor_ends_with_the_session(session: Session) -> None:
    session.doctor.start()
    session.close()
    assert not any(thread.name == "studio-doctor" for thread in threading.enumerate())
