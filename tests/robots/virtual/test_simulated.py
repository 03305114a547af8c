"""Tests of the virtual robot through the driver kit: every described action, and its published state."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import cv2
import pytest

import nep
from app.robots.driver.driver import Driver
from app.robots.simulated import ROBOT, create_room
from app.robots.virtual.simulation import Simulation
from tests.robots.conftest import Ears, eventually


class Pepper(Ears):
    """Listener and sender for a running virtual robot."""

    def __init__(self, node: nep.Node, driver: Driver) -> None:
        super().__init__(node, "Pepper")
        self.driver = driver
        self._world = node.new_pub("/Pepper/world", "json")

    def world(self, **change: object) -> None:
        self._world.publish(change)

    def newest(self, leaf: str) -> object:
        return self.heard[leaf][-1] if self.heard.get(leaf) else None

    def stopped(self, wanted: str) -> dict[str, object]:
        self.command(id=wanted, op="stop")
        return self.final(wanted, "stop")


@pytest.fixture
def pepper(node: nep.Node) -> Iterator[Pepper]:
    with nep.node("listener", "memory") as other:
        driver = Driver(ROBOT, "Pepper", node)
        ears = Pepper(other, driver)
        ears.listen("state")
        driver.start()
        try:
            eventually(lambda: ears.heard["state"])
            yield ears
        finally:
            driver.close()
    assert [t.name for t in threading.enumerate() if t.name.startswith("Pepper")] == []


QUICK = {
    "say": {"text": "Hi"},
    "play_sound": {"sound": "beep"},
    "play_tone": {"frequency": 440, "seconds": 0.1},
    "turn": {"angle": 5, "speed": 90},
    "walk": {"distance": 0.05},
    "look_at": {"target": "left"},
    "head": {"yaw": 10, "pitch": 0},
    "wave": {"hand": "left"},
    "stand": {},
    "show_emotion": {"emotion": "happy", "seconds": 0.5},
    "light": {"where": "both", "colour": "#ff0000"},
    "stop": {},
}


def test_every_action_succeeds(pepper):
    assert set(QUICK) == {action.name for action in pepper.driver.robot.actions}
    for name, given in QUICK.items():
        pepper.invoke(name, name, **given)
        assert pepper.final(name)["state"] == "succeeded", name
    lit = ["#ff0000", "#ff0000"]
    eventually(lambda: [pepper.newest("state")[where] for where in ("eyes", "shoulders")] == lit)


@pytest.mark.parametrize(
    ("action", "given"),
    [
        ("say", {"text": "x" * 200}),
        ("play_sound", {"sound": "cheer"}),
        ("play_tone", {"seconds": 10}),
        ("turn", {"angle": 360}),
        ("walk", {"distance": -1}),
        ("look_at", {"target": "left"}),
        ("head", {"yaw": -100}),
        ("wave", {}),
        ("show_emotion", {"seconds": 30}),
    ],
)
def test_every_long_action_can_be_canceled_and_stopped(pepper, action, given):
    pepper.invoke("1", action, **given)
    eventually(lambda: "running" in pepper.states("1"))
    pepper.command(id="1", op="cancel")
    assert pepper.final("1")["state"] == "canceled"
    pepper.invoke("2", action, **given)
    eventually(lambda: "running" in pepper.states("2"))
    assert pepper.stopped("s")["state"] == "succeeded"
    assert pepper.final("2")["state"] == "canceled"
    seen = len(pepper.heard["state"])
    eventually(lambda: len(pepper.heard["state"]) >= seen + 5)
    still = pepper.heard["state"][seen + 1 :]
    for value in ("x", "theta_deg", "head_yaw_deg", "arm_right_deg", "speech", "emotion"):
        assert len({state[value] for state in still}) == 1, value
    assert {str(state["sound"]) for state in still} == {"None"}
    assert not any(state["moving"] for state in still)


@pytest.mark.parametrize("action", [name for name in QUICK if name not in {"stand", "stop", "wave"}])
def test_list_as_the_first_parameter_of_an_action_is_rejected(pepper, action):
    parameter = pepper.driver.robot.action(action).parameters[0]
    pepper.invoke("1", action, **{parameter.name: [1, 2]})
    answer = pepper.final("1")
    assert answer["state"] == "failed"
    assert answer["error"].startswith(f"{action}: {parameter.title} must be ")
    assert pepper.states("1") == ["failed"]


def test_stop_ends_a_walk_and_a_turn(pepper):
    pepper.world(move="Aiko", x=0.0, y=2.0)
    for number, (action, given) in enumerate(
        [("walk", {"distance": 1, "speed": 0.35}), ("turn", {"angle": 360})]
    ):
        pepper.invoke(f"{number}", action, **given)
        eventually(lambda: pepper.newest("state")["moving"])
        assert pepper.stopped(f"s{number}")["state"] == "succeeded"  # bench/stop.py measures the delay
        eventually(lambda: not pepper.newest("state")["moving"])


def test_missing_heartbeat_of_the_program_stops_the_virtual_robot(pepper):
    pepper.invoke("1", "turn", program="p", angle=360, speed=20)
    assert pepper.final("1")["error"] == "its program hasn't responded for 1 s"
    eventually(lambda: not pepper.newest("state")["moving"])


def test_moving_robot_publishes_pose_and_distance(pepper):
    pepper.listen("pose")
    pepper.listen("distance")
    pepper.invoke("1", "turn", direction="left", angle=90, speed=90)
    assert pepper.final("1")["state"] == "succeeded"
    eventually(lambda: pepper.newest("pose") == {"x": -0.5, "y": 0.0, "theta": 90.0})
    eventually(lambda: pepper.newest("distance") == {"value": pytest.approx(2.5 - 0.27, abs=0.01)})


def test_walk_fails_when_a_person_blocks_the_path(pepper):
    bumps = pepper.listen("bumped")
    pepper.world(move="Aiko", x=0.1, y=0.0)
    eventually(lambda: any(o["x"] == 0.1 for o in pepper.newest("state")["objects"]))
    pepper.invoke("1", "walk", distance=1)
    assert pepper.final("1")["error"].startswith("walk: something is in the way after 0.")
    eventually(lambda: bumps == [{"side": "front"}])


def test_touch_and_heard_words_are_published(pepper):
    for leaf in ("touched", "released", "heard", "head_touched", "heard_word"):
        pepper.listen(leaf)
    board = pepper.listen("board", topic="/blackboard")
    pepper.world(touch="head", down=True)
    eventually(lambda: pepper.newest("head_touched") == {"value": True})
    pepper.world(touch="head", down=False)
    pepper.world(say="hello")
    pepper.world(touch="nose", down=True)
    pepper.world(move=5, x="a")
    eventually(lambda: pepper.newest("heard_word") == {"value": "hello"})
    eventually(lambda: pepper.newest("head_touched") == {"value": False})
    assert pepper.heard["touched"] == pepper.heard["released"] == [{"place": "head"}]
    assert pepper.heard["heard"] == [{"word": "hello"}]
    assert {"primitive": "touched", "input": {"head": 1}, "robot": "Pepper"} in board
    assert {"primitive": "word", "input": {"hello": 1}, "robot": "Pepper"} in board


def test_short_tap_is_visible_in_the_touch_sensor(pepper):
    told = pepper.listen("head_touched")
    pepper.world(touch="head", down=True)
    pepper.world(touch="head", down=False)
    eventually(lambda: {"value": True} in told)
    eventually(lambda: told[-1] == {"value": False})


def test_user_can_trigger_events_of_the_description_and_invalid_ones_are_ignored(pepper):
    for leaf in ("touched", "released", "heard", "bumped", "face_seen"):
        pepper.listen(leaf)
    pepper.world(happen="bumped", side="back")
    pepper.world(happen="heard", word="yes")
    pepper.world(happen="touched", place="left_hand")
    pepper.world(happen="face_seen", name="Ben")
    for wrong in ({"side": "top"}, {"side": 3}, {}, {"side": "front", "how": "hard"}):
        pepper.world(happen="bumped", **wrong)
    pepper.world(happen="heard", word="no", loud=True)
    pepper.world(happen="touched", place="head", how="softly")
    pepper.world(happen="flies")
    pepper.world(happen="touched", place="nose")
    eventually(lambda: pepper.heard["released"] == [{"place": "left_hand"}])
    assert pepper.heard["bumped"] == [{"side": "back"}]
    assert pepper.heard["heard"] == [{"word": "yes"}]
    assert {"name": "Ben"} in pepper.heard["face_seen"]
    assert pepper.heard["touched"] == [{"place": "left_hand"}]


def test_detections_of_faces_balls_and_markers_are_published(pepper):
    for leaf in ("faces", "balls", "markers", "sees_face", "sees_ball", "face_seen", "face_lost"):
        pepper.listen(leaf)
    eventually(lambda: pepper.newest("sees_face") == pepper.newest("sees_ball") == {"value": True})
    eventually(lambda: pepper.newest("faces") and pepper.newest("faces")["name"] == "Aiko")
    eventually(lambda: pepper.newest("balls") and pepper.newest("balls")["items"][0]["name"] == "ball")
    pepper.invoke("1", "turn", angle=60, speed=90)
    pepper.final("1")
    eventually(lambda: pepper.newest("markers")["name"] == "marker 7")
    eventually(lambda: pepper.heard["face_lost"] == [{"name": "Aiko"}])
    eventually(lambda: pepper.newest("sees_ball") == {"value": False})
    pepper.invoke("2", "look_at", target="ball")
    assert pepper.final("2")["error"] == "look at: no ball in the picture"


def test_robot_turns_its_head_to_the_ball(pepper):
    pepper.listen("balls")
    eventually(lambda: pepper.newest("balls"))
    pepper.invoke("1", "look_at", target="ball")
    assert pepper.final("1")["state"] == "succeeded"
    seen = len(pepper.heard["balls"])
    eventually(lambda: len(pepper.heard["balls"]) >= seen + 2)
    x, y, width, height = pepper.newest("balls")["items"][0]["box"]
    assert x + width / 2 == pytest.approx(160, abs=12)
    assert y + height / 2 == pytest.approx(120, abs=12)


def test_robot_sees_the_face_and_the_ball_before_its_first_camera_image(node, monkeypatch):
    monkeypatch.setattr(Simulation, "capture", lambda _simulation, *, publish: None)
    with nep.node("listener", "memory") as other, Driver(ROBOT, "Pepper", node) as driver:
        pepper = Pepper(other, driver)
        for target in ("face", "ball"):
            pepper.invoke(target, "look_at", target=target)
            assert pepper.final(target)["state"] == "succeeded"


def test_subscriber_receives_a_jpeg_camera_image(node, pepper):
    with nep.node("watcher", "memory") as watcher:
        camera = watcher.new_sub("/Pepper/camera", "image")
        picture = camera.receive(30.0)
        assert picture is not None
        assert picture.payload.shape == (240, 320, 3)
        assert picture.extension["encoding"] == "jpeg"
        assert picture.size_bytes < 40_000
        assert cv2.Laplacian(picture.payload, cv2.CV_64F).var() > 20  # the image isn't empty


def test_same_seed_gives_the_same_object_positions():
    assert create_room(5) == create_room(5)
    assert create_room(5) != create_room(6)
    assert create_room(None).balls[0].x == 1.95


def test_reset_restores_robot_and_room(pepper):
    pepper.invoke("1", "turn", angle=45, speed=90)
    pepper.final("1")
    pepper.world(move="ball", x=1.0, y=1.0)
    pepper.world(reset=True)
    eventually(lambda: pepper.newest("state")["theta_deg"] == 0)
    eventually(lambda: pepper.newest("state")["objects"][0]["x"] == 1.95)


def test_shipped_thing_model_matches_the_robot():
    from tests.robots.test_description import model

    assert model("pepper") == ROBOT.thing_model


def test_each_played_sound_is_published_with_a_unique_number(pepper):
    numbers = set()
    for call, (action, given, title) in enumerate(
        [
            ("play_sound", {"sound": "bell"}, "bell"),
            ("play_sound", {"sound": "bell"}, "bell"),
            ("play_tone", {"frequency": 262.5, "seconds": 0.4, "volume": 20}, "262.5 Hz"),
        ]
    ):
        seen = len(pepper.heard["state"])
        pepper.invoke(str(call), action, **given)
        assert pepper.final(str(call))["state"] == "succeeded"
        told = [state["sound"] for state in pepper.heard["state"][seen:] if state["sound"]]
        assert {sound["title"] for sound in told} == {title}
        numbers |= {sound["number"] for sound in told}
        assert [sound["played"] for sound in told] == sorted(sound["played"] for sound in told)
    assert len(numbers) == 3
    assert told[0]["notes"] == [[262.5, 0.4]]
    assert pepper.newest("state")["volume"] == 20
    eventually(lambda: pepper.newest("state")["sound"] is None)
