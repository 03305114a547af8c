"""Tests of the main workflow by mouse and keyboard: connect a robot, watch topics, run blocks, press Stop."""

from __future__ import annotations

import json

import numpy as np
import pytest

import nep
from tests.e2e.person import amber
from tests.e2e.shared_studio import SharedStudio
from tests.e2e.studio import Studio
from tests.e2e.waiting import until
from tests.e2e.x11 import Picture

pytestmark = pytest.mark.timeout(400)


def test_topics_inspector_and_images_update_live(shared: SharedStudio) -> None:
    studio = shared.studio
    studio.click("Developer")
    with nep.node("weather", master=studio.master) as node:
        publisher = node.new_pub("/weather", "json")
        new = studio.row("Topics", "/weather")
        assert new["chip"] == "new"
        assert publisher.subscribers == 0, "nothing is subscribed until somebody looks"
        studio.click_row("Topics", "/weather")
        until(lambda: publisher.subscribers == 1, "a click on the topic subscribes to it")
        for degrees in (21.5, -3):
            publisher.publish({"degrees": degrees, "sky": {"clouds": [1, 2]}})
            until(
                lambda shown=str(degrees): studio.values("Newest message").get("degrees") == shown,
                f"the inspector shows {degrees}",
            )
        until(lambda: studio.row("Topics", "/weather")["chip"] is None, "it isn't new any more")
    until(lambda: studio.row("Topics", "/weather")["struck"], "a topic without a publisher is struck through")

    studio.click_row("Topics", "/Pepper/camera")
    studio.says("shown")
    view = studio.still(kind="ClickablePicture")
    until(lambda: studio.picture(view)[::3, ::3].std() > 20, "the picture is painted")
    first = studio.picture(view)
    with nep.node("pusher", master=studio.master) as node:
        world = node.new_pub("/Pepper/world", "json")
        until(lambda: world.subscribers, "the robot's world hears")
        world.publish({"move": "Aiko", "x": 1.0, "y": -0.4})
        until(
            lambda: (abs(studio.picture(view).astype(int) - first).max(axis=2) > 40).mean() > 0.02,
            "the picture shows that the person has moved",
        )


def test_blocks_dragged_with_the_mouse_run_on_the_robot(shared: SharedStudio) -> None:
    studio = shared.studio
    studio.open_category("Events")
    view = studio.find(kind="QWebEngineView")["rect"]
    studio.drag(".blocklyFlyout .events_started", view[0] + 420, view[1] + 90)
    (hat,) = until(studio.blocks, "the hat is in the workspace")
    studio.open_category("Movement")
    left, _, _, _ = studio.spot(f"[data-id='{hat}'] > .blocklyPath")
    _, top, _, height = studio.spot(f"[data-id='{hat}'] > .blocklyPath")
    studio.drag(".blocklyFlyout .robot_pepper_do_turn", left + 16, top + height + 20)
    until(
        lambda: studio.page(f"!!document.querySelector(\"[data-id='{hat}'] .robot_pepper_do_turn\")"),
        "the block is snapped under the hat",
    )
    type_angle(studio, f"[data-id='{hat}'] .robot_pepper_do_turn .blocklyInputField", 360)  # takes 9 s
    with nep.node("listener", master=studio.master) as node:
        pose = node.new_sub("/Pepper/pose", "json", keep="latest", max_messages=1)
        before = until(lambda: pose.listen()[1], "the robot says where it is")["theta"]
        answers = node.new_sub("/Pepper/answer", "robot/answer")
        quiet = studio.picture(studio.find(kind="QWebEngineView"))
        studio.click("Run", kind="RunButton")
        (turning,) = until(lambda: [i for i in studio.outlined("running") if i != hat], "its block glows")
        web = studio.find(kind="QWebEngineView")
        until(lambda: amber(studio.picture(web)) > amber(quiet) + 200, "the glow can be seen on the screen")
        studio.says("Pepper turns left by 360°")
        until(lambda: (pose.listen()[1] or {}).get("theta", 0) not in (0, before), "the robot turns")
        studio.click("Stop", kind="StopButton")
        studio.says("Pepper stopped (")
        proof = studio.find(kind="StopResultLabel")
        until(lambda: green(studio.picture(proof)), "the result of the stop stands on green")
        answered = until(lambda: _stops(answers), "the robot answers the stop")
        assert {answer["state"] for answer in answered} <= {"accepted", "succeeded"}
        until(lambda: turning in studio.outlined("stopped"), "the block where it stopped is outlined")
        until(lambda: not studio.outlined("running"), "nothing glows any more")
        resting = until(lambda: pose.listen()[1], "the robot says where it is")["theta"]
        assert abs(resting - before) > 1, "it had not come round"


def type_angle(studio: Studio, field: str, angle: int) -> None:
    """Click the number of a block and replace it."""
    studio.point(field, dx=10, dy=10)
    typing = "document.activeElement && document.activeElement.classList.contains('blocklyHtmlInput')"
    until(lambda: studio.page(typing), "the number is edited")
    studio.screen.type(str(angle))
    studio.screen.key("Return")
    shown = f"document.querySelector({json.dumps(field)}).textContent"
    until(lambda: str(studio.page(shown)).startswith(str(angle)), "the block has the number")


def green(picture: Picture) -> bool:
    """Return whether the median colour of a picture is a green tint."""
    red, green, blue = (int(value) for value in np.median(picture.reshape(-1, 3), axis=0))
    return green > red + 5 and green > blue


def _stops(answers: nep.Subscriber) -> list[dict]:
    """Return the stop replies received so far, or an empty list until one has succeeded."""
    found = []
    while (message := answers.receive(0.0)) is not None:
        if message.payload["op"] == "stop":
            found.append(message.payload)
    return found if any(answer["state"] == "succeeded" for answer in found) else []
