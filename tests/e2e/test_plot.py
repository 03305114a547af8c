"""Test of a plot in the real window: a value dragged from the Inspector and a typed field path."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

import nep
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = [pytest.mark.long, pytest.mark.timeout(400)]


@contextmanager
def odometry(address: str) -> Iterator[None]:
    """Program that publishes /odom 50 times per second."""
    ended = threading.Event()
    with nep.node("wheels", master=address) as node:
        publisher = node.new_pub("/odom", "json")

        def run() -> None:
            count = 0
            while not ended.wait(0.02):
                count += 1
                publisher.publish(
                    {"speed": math.sin(count / 20), "mode": "up" if count % 200 < 100 else "down"}
                )

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


def curves(studio: Studio) -> list[str]:
    return [row["texts"][2] for row in studio.rows("Curves and their values")]


def coloured(studio: Studio) -> int:
    """Return the number of saturated pixels of the canvas; curves have them, axes don't."""
    picture = studio.picture(studio.find("Curves")).astype(int)[..., :3]
    return int((np.ptp(picture, axis=2) > 60).sum())


def test_plot_shows_a_value_dragged_from_the_inspector_and_a_typed_field_path(
    studio: Studio, address: str
) -> None:
    studio.find("Use the virtual robot", enabled=True)
    studio.screen.key("2", held=["Alt"])
    studio.says(f"Master {address}")
    with odometry(address):
        studio.click_row("Topics", "/odom")
        until(lambda: "speed" in studio.values("Newest message"), "the inspector shows the message")
        studio.click("Panels")
        studio.pick("Plot")
        studio.says("No curves yet")
        studio.screen.move(*middle(studio.still_row("Newest message", "speed")["rect"]))
        studio.screen.press()
        x, y = middle(studio.still("Add a curve", kind="AddCurveField")["rect"])
        studio.screen.glide(x + 20, y + 200)
        studio.screen.release()
        until(lambda: curves(studio) == ["/odom.speed"], "the value is plotted")
        until(lambda: coloured(studio) > 100, "its curve is drawn")

        studio.click("Add a curve", kind="AddCurveField")
        studio.screen.type("mean(/odom.speed, 1 s)")
        studio.screen.key("Return")
        until(lambda: len(curves(studio)) == 2, "what was typed is plotted")
        studio.screen.key(" ")
        studio.says("paused; still collecting data")
        studio.screen.key("m")
        studio.says("Min, max and mean between A and B")
        studio.click("Resume")
    assert studio.quit() == 0
