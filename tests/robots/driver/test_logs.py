"""Tests that the log records of a driver are published, so that Studio can show why an action failed."""

from __future__ import annotations

import logging
import threading

import pytest

import nep
from app.robots.driver.process import run
from app.robots.kit import Call, Kind, Link, action, safe_stop
from tests.robots.conftest import eventually

pytestmark = pytest.mark.usefixtures("patient")  # records and commands are published once


class Clumsy:
    """Fake robot whose only action fails."""

    def __init__(self, link: Link) -> None:
        logging.getLogger("clumsy.arm").warning("the arm is cold")

    @action("fall", category="Movement", icon="move")
    def fall(self, call: Call) -> None:
        """Fall over."""
        raise ValueError("no legs")

    @safe_stop(watchdog_s=0.5)
    def stop(self) -> None:
        """Stand still immediately."""


def test_driver_log_records_and_exceptions_are_published(master):
    ended, records = threading.Event(), []
    with nep.node("page") as page:
        page.new_sub("/nep/log", "nep/log", sink=lambda batch: records.extend(each.payload for each in batch))
        robot = threading.Thread(target=run, args=(Kind("clumsy", "Clumsy", Clumsy), "Bob", ended))
        robot.start()
        eventually(lambda: records)
        assert (records[0]["node"], records[0]["name"]) == ("Bob", "clumsy.arm")
        assert records[0]["text"] == "the arm is cold"
        eventually(lambda: "/Bob/command" in page.graph().topics)
        page.new_pub("/Bob/command", "robot/command").publish(
            {"id": "1", "op": "invoke", "from": "me", "action": "fall", "input": {}}
        )
        eventually(lambda: any("no legs" in record["text"] for record in records))
        ended.set()
        robot.join(60)
    (broke,) = [record for record in records if "no legs" in record["text"]]
    assert broke["level"] == "warning"
    assert "Traceback" in broke["text"]
    assert not any(
        isinstance(each, nep.nodes.log_handler.LogHandler) for each in logging.getLogger().handlers
    )
