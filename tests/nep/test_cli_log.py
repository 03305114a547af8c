"""`nep log`, and what the master logs."""

from __future__ import annotations

import json
import threading

import pytest
import typer

import nep
from nep.cli.alert_printer import AlertLog
from nep.cli.log import log
from nep.logs import LOG_TOPIC, LOG_TYPE


@pytest.fixture
def busy(master):
    """A robot and another node that log as soon as somebody listens."""
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


def test_records_are_lines_for_people(busy, capfd):
    log("warning", "Pepper", 1, busy)
    (line,) = capfd.readouterr().out.splitlines()
    assert line.split()[1:] == ["warning", "Pepper", "the", "battery", "is", "low"]


def test_records_are_json_for_programs_and_what_is_none_is_told(busy, capfdbinary):
    log("info", None, 4, busy, as_json=True)
    records = [json.loads(line) for line in capfdbinary.readouterr().out.splitlines()]
    assert {record["text"] for record in records} >= {"not mine", "quiet", "the battery is low"}
    assert any("cannot decode" in record["text"] for record in records)


def test_a_wrong_level_is_a_sentence():
    with pytest.raises(typer.BadParameter, match=r"no level 'eror'; did you mean 'error'\?"):
        log("eror")


def test_a_master_logs_its_alerts_and_when_they_are_cured():
    with (
        nep.Master("127.0.0.1:0", learn_s=0.0, attachments=[AlertLog()]) as master,
        nep.node("page", master=master.address) as page,
        page.new_sub(LOG_TOPIC, LOG_TYPE) as records,
    ):
        assert {node.name for node in page.graph().nodes.values()} == {
            "page"
        }  # nothing to tell, nobody there
        with nep.node("twin", master=master.address) as one, nep.node("twin", master=master.address) as two:
            pubs = one.new_pub("a"), two.new_pub("b")
            first = records.listen(timeout_s=5)[1]
            assert first["node"] == "master"
            assert first["level"] == "warning"
            assert "2 programs call themselves" in first["text"]
            assert pubs
        cured = records.listen(timeout_s=5)[1]
        assert (cured["level"], cured["text"][:6]) == ("info", "cured:")
