"""Test of a recording that is read back to its last message."""

from __future__ import annotations

import pytest

import nep
from nep.recordings.reader import Recording
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def test_recording_contains_every_message_published_meanwhile(studio: Studio) -> None:
    with nep.node("talker", wait_s=60.0) as node:
        publisher = node.new_pub("/distance", "json")
        studio.screen.key("2", ["Alt"])
        studio.row("Topics", "/distance")
        studio.screen.key("r", ["Ctrl"])
        until(lambda: studio.all("Recording", kind="RecordButton"), "it records")
        until(lambda: publisher.subscribers > 0, "the recorder listens")
        for number in range(50):
            publisher.publish({"range": number})
        studio.says("Recording 0:")
        folder = studio.home / "Recordings"
        until(lambda: [each for each in folder.glob("*.mcap") if each.stat().st_size], "a file is there")
        studio.screen.key("r", ["Ctrl"])
        studio.says("Saved recording recording-")
        (path,) = folder.glob("*.mcap")
        with Recording(path) as recording:
            assert recording.is_complete
            heard = [each.message.payload for each in recording.read(topics=("/distance",))]
            assert heard == [{"range": number} for number in range(50)]
            assert recording.stats()["/distance"].lost == 0
        studio.click("Show")
        studio.find(path.stem, kind="ElidedLabel")
        studio.screen.key("F2")
        studio.find("Recording name")
        studio.screen.type("my tour")
        studio.screen.key("Return")
        until((folder / "my tour.mcap").exists, "it has another name")
