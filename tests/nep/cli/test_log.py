"""Tests of `nep log` and of the master's own log records."""

from __future__ import annotations

import json
import threading

import pytest
import typer

import nep
from nep.cli.alert_printer import AlertLog
from nep.cli.graph.log import log
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LOG_TOPIC, LOG_TYPE
from tests.nep.programs import eventually

pytestmark = pytest.mark.usefixtures("patient")


@pytest.fixture
def busy(master):
    """Master with a robot and another node that log as soon as the log topic has a subscriber."""
    with nep.node("Pepper") as robot, nep.node("other") as other, nep.node("raw") as raw:
        pub = raw.new_pub(LOG_TOPIC, LOG_TYPE)

        def talk():
            while not pub.subscribers:
                if end.wait(0.02):
                    return
            other.log.error("not mine")
            robot.log.info("quiet")
            robot.log.warning("the %s is low", "battery")
            pub.publish_bytes(b"{oops")

        end = threading.Event()
        thread = threading.Thread(target=talk)
        thread.start()
        yield master.address
        end.set()
        thread.join()


def test_records_are_printed_as_lines(busy, capfd):
    log("warning", "Pepper", 1, busy)
    (line,) = capfd.readouterr().out.splitlines()
    assert line.split()[1:] == ["warning", "Pepper", "the", "battery", "is", "low"]


def test_records_are_printed_as_json_and_undecodable_messages_reported(busy, capfdbinary):
    log("info", None, 4, busy, as_json=True)
    records = [json.loads(line) for line in capfdbinary.readouterr().out.splitlines()]
    assert {record["text"] for record in records} >= {"not mine", "quiet", "the battery is low"}
    assert any("can't decode" in record["text"] for record in records)


def test_late_start_shows_the_last_errors_first_and_each_once(master, capfd):
    with nep.node("Pepper") as robot, nep.node("other") as other:
        robot.log.error("the brake is hot\n12:00:00 error  forged\x1b[2J")
        robot.log.info("fine")
        other.log.critical("on fire")
        eventually(lambda: LAST_ERRORS_TOPIC in robot.graph().topics)
        eventually(lambda: len(robot.graph().topics[LAST_ERRORS_TOPIC].publishers) == 2)
        log("info", None, 2, master.address)
        lines = capfd.readouterr().out.splitlines()
        assert lines[0].endswith("error     Pepper  the brake is hot")
        assert lines[1] == "    12:00:00 error  forged\\x1b[2J"
        assert lines[2].endswith("critical  other  on fire")
        assert len(lines) == 3
        log("info", "other", 1, master.address)
        assert "on fire" in capfd.readouterr().out


def test_error_logged_during_the_command_is_shown_once(busy, capfd):
    log("error", "other", 1, busy)
    with nep.node("looker", master=busy) as looker:  # errors are stored shortly after they are published
        eventually(lambda: LAST_ERRORS_TOPIC in looker.graph().topics)
        with looker.new_sub(LAST_ERRORS_TOPIC) as kept:
            assert kept.listen(timeout_s=30.0)[0]
    log("error", "other", 1, busy)  # the same error, now a stored one
    assert capfd.readouterr().out.count("not mine") == 2


def test_unknown_level_is_rejected_with_a_suggestion():
    with pytest.raises(typer.BadParameter, match=r"unknown level 'eror'; did you mean 'error'\?"):
        log("eror")


def test_master_logs_its_alerts_and_their_resolution():
    with (
        nep.Master("127.0.0.1:0", learn_s=0.0, attachments=[AlertLog()]) as master,
        nep.node("page", master=master.address) as page,
        page.new_sub(LOG_TOPIC, LOG_TYPE) as records,
    ):
        assert {node.name for node in page.graph().nodes.values()} == {
            "page"
        }  # without alerts, no master node is registered
        with nep.node("twin", master=master.address) as one, nep.node("twin", master=master.address) as two:
            pubs = one.new_pub("a"), two.new_pub("b")
            first = records.listen(timeout_s=30.0)[1]
            assert first["node"] == "master"
            assert first["level"] == "warning"
            assert "2 programs are named “twin”" in first["text"]
            assert pubs
        resolved = records.listen(timeout_s=30.0)[1]
        assert (resolved["level"], resolved["text"][:9]) == ("info", "resolved:")
