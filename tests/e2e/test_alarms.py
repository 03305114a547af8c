"""Test of an alarm created by a right click on a topic: its banner, and its end without a user."""

from __future__ import annotations

import threading

import pytest

import nep
from tests.e2e.studio import Studio
from tests.e2e.waiting import until
from tests.e2e.x11 import RIGHT

pytestmark = pytest.mark.timeout(400)


def test_alarm_created_by_right_click_shows_a_banner_and_clears_by_itself(studio: Studio) -> None:
    with nep.node("talker", wait_s=60.0) as node:
        publisher = node.new_pub("/distance", "json")
        studio.screen.key("2", ["Alt"])
        studio.click_row("Topics", "/distance", RIGHT)
        studio.pick("New alarm")
        studio.find("/distance is silent for 2 s", kind="AlarmRow")
        studio.says("/distance has been silent for")
        talking = threading.Event()

        def talk() -> None:
            while not talking.wait(0.1):
                publisher.publish({"range": 0.3})

        thread = threading.Thread(target=talk)
        thread.start()
        try:
            until(lambda: not studio.all("Dismiss"), "the banner goes")
            studio.click("Condition: silent")
            studio.pick("A topic's message rate is too high")
            studio.find("/distance has more than 100 messages per second for 2 s", kind="AlarmRow")
        finally:
            talking.set()
            thread.join()
