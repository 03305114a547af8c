"""Tests of publishing by a click in an image and by a replay: only armed topics are sent.

The window and the programs are real.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import nep
from nep.messages.message import Message
from nep.recordings.writer import RecordingWriter
from tests.e2e.fingers import Fingers
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.waiting import until
from tests.nep.recordings.messages import START_NS, TestClock, limits

pytestmark = [pytest.mark.long, pytest.mark.timeout(400)]
WIDTH, HEIGHT = 320, 240
LAMP, WHEELS = "/lamp", "/base/cmd_vel"


@contextmanager
def program(address: str, *topics: str, camera: str = "") -> Iterator[dict[str, list[object]]]:
    """Start a program that subscribes to topics and may publish a grey image ten times per second.

    ``camera`` is the topic of the images; "" means no camera.
    """
    heard: dict[str, list[object]] = {topic: [] for topic in topics}
    with nep.node("program", master=address) as node:
        for topic in topics:
            node.new_callback(topic, "json", heard[topic].append)
        if camera:
            pictures = node.new_pub(camera, "image")
            grey = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
            node.new_timer(0.1, lambda: pictures.publish(grey))
        thread = threading.Thread(target=node.spin)
        thread.start()
        try:
            yield heard
        finally:
            node.stop_spin()
            thread.join()


def texts(studio: Studio) -> list[str]:
    """Return the texts in the window, for the message of a failed test."""
    return [each["text"] for each in studio.look() if each["text"]]


def test_click_in_an_image_publishes_its_pixel_only_after_arming(studio: Studio, address: str) -> None:
    studio.find("Use the virtual robot", enabled=True)
    studio.screen.key("2", held=["Alt"])
    studio.says(f"Master {address}")
    with program(address, "/webcam/point", camera="/webcam") as heard:
        studio.row("Topics", "/webcam")
        studio.click("Image", kind="ClickablePicture")
        studio.screen.key("p")
        studio.says("Clicks aren't sent until you arm sending")
        studio.click("Image", kind="ClickablePicture")
        studio.click(kind="Switch", name="Armed")
        studio.says("left")
        assert heard["/webcam/point"] == []
        picture = studio.click("Image", kind="ClickablePicture")
        (point,) = until(lambda: heard["/webcam/point"], "the point is heard")
        assert isinstance(point, dict)
        assert (point["width"], point["height"], point["topic"]) == (WIDTH, HEIGHT, "/webcam")
        assert abs(point["x"] - WIDTH / 2) <= 2
        assert abs(point["y"] - HEIGHT / 2) <= 2
        studio.says("1 point sent, 1 subscriber")
        Fingers(studio).press("F12")
        studio.says("Clicks aren't sent until you arm sending")
        studio.screen.click(*middle(picture["rect"]))
        Fingers(studio).do("sent", "Sent")
        listed = until(lambda: studio.rows("Sent messages, newest first"), "what was sent is listed")
        words = [" ".join(row["texts"]) for row in listed]
        assert [" /webcam/point Point (" in line for line in words] == [False, True, False]
        assert len(heard["/webcam/point"]) == 1
    assert studio.quit() == 0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Recording with alternating messages of the lamp and the wheels, 0.1 s apart."""
    path = tmp_path / "Tour.mcap"
    with RecordingWriter(path, clock=TestClock(START_NS, 100_000_000), limits=limits()) as writer:
        for seq in range(120):
            data = b'{"n": %d}' % seq
            topic = (LAMP, WHEELS)[seq % 2]
            stamp_ns = START_NS + seq * 100_000_000
            writer.post([Message(topic, data, "json", "json", stamp_ns=stamp_ns, seq=seq, publisher=7)])
    return path


def test_replay_publishes_the_armed_topic_and_no_robot_command_without_confirmation(
    start: Callable[..., Studio], address: str, path: Path
) -> None:
    studio = start(str(path))
    studio.says(f"Master {address}", 60)
    with program(address, LAMP, WHEELS) as heard:
        studio.says("Sending is off", 60)
        fingers = Fingers(studio)
        studio.click(kind="Switch", name="Armed")
        studio.find("Topics that can be sent", focus=True)
        rows = [row["texts"] for row in studio.rows("Topics that can be sent")]
        names = [name for name in itertools.chain(*rows) if name in heard]
        assert sorted(names) == sorted(heard)
        fingers.press("Return", "Down", "Return")
        studio.click("Arm and send")
        studio.says(f"{WHEELS} commands robots.")
        studio.click("Cancel")
        until(lambda: not studio.all("Arm sending"), "the question is replied")
        studio.click("Play")
        until(lambda: len(heard[LAMP]) >= 5, lambda: f"the lamp hears: {heard}; {texts(studio)}")
        fingers.press("F12")
        studio.says("Sending is off")
        numbers = [each["n"] for each in heard[LAMP]]  # type: ignore[index]
        assert numbers == sorted(set(numbers))
        assert all(number % 2 == 0 for number in numbers)
        assert heard[WHEELS] == []
    assert studio.quit() == 0
