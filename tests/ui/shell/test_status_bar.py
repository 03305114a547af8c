"""Tests of the status bar, which shows known values only."""

from __future__ import annotations

import time

import pytest

from app.core.network.master import MasterState
from app.ui.shell.bars.app_bar import robots_chip
from app.ui.shell.bars.status_bar import StatusBar, StatusFormatter
from app.ui.theme.theme import Theme
from tests.ui import fakes
from tests.ui.shell_parts import robots_in

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def session() -> fakes.Session:
    return fakes.Session.full()


def facts(session: object) -> StatusFormatter:
    return StatusFormatter(session, clock=time.gmtime)  # type: ignore[arg-type]


def test_health_item_shows_alerts_before_robots(session: fakes.Session) -> None:
    assert facts(session).health() == ("circle-x", "1 alert", "error")
    session.alerts.raise_alert("slow", "warn", "Slow.")
    assert facts(session).health()[1] == "2 alerts"
    session.alerts.resolve("slow")
    session.alerts.resolve("message:/faces")
    assert facts(session).health() == ("circle-check", "Pepper: no problems", "ok")


def test_health_item_counts_the_problems_of_the_robot(session: fakes.Session) -> None:
    session.alerts.resolve("message:/faces")
    link = session.fleet.links[0]
    link.values["battery"] = 7
    assert facts(session).health() == ("triangle-alert", "Pepper: needs attention (1)", "warn")
    link.last_stop, link.last_stop_status = "not confirmed, at 8:41", "error"
    assert facts(session).health() == ("circle-x", "Pepper: needs attention (2)", "error")


def test_robot_that_has_not_reported_is_connected_and_not_healthy(session: fakes.Session) -> None:
    session.alerts.resolve("message:/faces")
    link = session.fleet.links[0]
    link.last_reply_s, link.values = None, {}
    for topic in session.shown.topics:
        topic.rate_hz = topic.age_s = None
    assert facts(session).health() == ("circle-dashed", "Pepper is connected", "off")


def test_disconnected_robot_is_counted_as_needing_attention(session: fakes.Session) -> None:
    session.alerts.resolve("message:/faces")
    link = session.fleet.links[0]
    link.is_connected = False
    assert facts(session).health() == ("triangle-alert", "Pepper: needs attention (1)", "warn")


def test_health_item_shows_no_robot_when_none_is_connected() -> None:
    assert facts(fakes.Session()).health() == ("circle-dashed", "No robot", "off")


def test_save_state_shows_the_time_of_saving_or_that_work_is_backed_up(session: fakes.Session) -> None:
    assert facts(session).save_status()[1] == ""
    session.document.saved_s = 8 * 3600 + 41 * 60
    assert facts(session).save_status()[1] == "Saved 8:41"
    session.document.dirty = True
    assert facts(session).save_status()[1] == "Not saved · backed up"


def test_unsaved_work_that_cannot_be_backed_up_is_reported(session: fakes.Session) -> None:
    session.document.dirty = True
    session.document._journal_error = (
        "can't back up unsaved work (No space left on device); save the file now"
    )
    assert facts(session).save_status() == ("circle-x", "Not saved · no backup", "error")
    session.document._journal_error = None
    assert facts(session).save_status()[1] == "Not saved · backed up"


def test_traffic_item_counts_nodes_topics_and_messages_of_the_live_network(session: fakes.Session) -> None:
    session.traffic.messages_per_s = 268.6
    assert facts(session).traffic()[1] == "7 nodes, 12 topics, 269 messages/s"
    session.traffic.messages_per_s = None
    assert facts(session).traffic()[1] == "7 nodes, 12 topics"
    session.shown.graph = None
    assert facts(session).traffic()[1] == ""


def test_lost_messages_item_is_hidden_without_losses(session: fakes.Session) -> None:
    assert facts(session).lost()[1] == ""
    session.traffic.lost_30s = 12
    assert facts(session).lost() == ("triangle-alert", "12 lost in 30 s", "warn")


def test_status_bar_reports_displayed_and_received_messages_if_some_were_not_displayed(
    session: fakes.Session,
) -> None:
    session.traffic.shown_30s = session.traffic.sent_30s = 900
    assert facts(session).displayed_messages()[1] == ""
    session.traffic.sent_30s = 4900
    assert facts(session).displayed_messages()[1] == "900 of 4\u2009900 shown in 30 s"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("connected", "Master 127.0.0.1:7780"),
        ("searching", "Searching for the master 127.0.0.1:7780"),
        ("none", "No master"),
    ],
)
def test_master_item_shows_its_state(session: fakes.Session, kind: str, words: str) -> None:
    session.live.master = MasterState(kind, session.live.master.address)
    assert facts(session).master()[1] == words


def test_empty_status_items_leave_no_gap(qtbot, theme: Theme) -> None:
    bar = StatusBar(theme)
    qtbot.addWidget(bar)
    bar.resize(900, 26)
    bar.show()
    bar.show_entries((("", "one", None), ("", "", None), ("", "two", None)), (("", "right", None),))
    assert bar.texts() == ["one", "two", "right"]
    bar.show_entries((("", "one", None),), ())
    assert bar.texts() == ["one"]


@pytest.mark.parametrize(
    ("states", "run", "chip"),
    [
        ([], "ready", ("No robot", "off")),
        (["away"], "ready", ("No robot", "off")),
        (["ready"], "ready", ("Robot 1 ready", "ok")),
        (["ready"], "running", ("Robot 1 running", "ok")),
        (["busy"], "ready", ("Robot 1 moving", "ok")),
        (["ready", "ready"], "ready", ("2 robots", "ok")),
        (["ready", "silent"], "running", ("Robot 2: camera silent", "error")),
        (["silent"], "running", ("Camera silent", "error")),
        (["silent", "silent"], "running", ("2 robots not responding", "error")),
    ],
)
def test_robots_chip_summarises_the_robot_states(states: list[str], run: str, chip: tuple[str, str]) -> None:
    assert robots_chip(robots_in(*states, run=run, silent="camera silent")) == chip
