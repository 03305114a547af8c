from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.robots.virtual.body import MIN_TOUCH_S, RADIUS, Body
from app.robots.virtual.motion import Joint, Motion
from app.robots.virtual.room import Room
from app.robots.virtual.simulation import drawing_state
from tests.examples import examples

STEP = 1 / 30


def run(body: Body, until, limit_s: float = 60.0) -> float:
    passed = 0.0
    while not until():
        body.step(STEP)
        passed += STEP
        assert passed < limit_s
    return passed


def events(body: Body) -> list[tuple[str, dict[str, object]]]:
    return [(event.name, event.data) for event in body.events]


def test_robot_turns_by_the_angle_within_the_requested_speed():
    body = Body()
    motion = body.turn(90, 45)
    seconds = run(body, lambda: motion.done)
    assert body.theta_deg == pytest.approx(90, abs=1e-6)
    assert seconds >= 90 / 45
    back = body.turn(-180, 90)
    run(body, lambda: back.done)
    assert body.theta_deg == pytest.approx(-90, abs=1e-6)


def test_robot_walks_in_its_heading():
    body = Body(theta_deg=180.0)
    motion = body.walk(1.0, 0.3)
    run(body, lambda: motion.done)
    assert (body.x, body.y) == (pytest.approx(-1.5), pytest.approx(0.0, abs=1e-9))
    assert motion.moved == pytest.approx(1.0)
    back = body.walk(-0.5, 0.3)
    run(body, lambda: back.done)
    assert body.x == pytest.approx(-1.0)


def test_robot_stops_in_front_of_a_person_and_publishes_a_bump_event():
    body = Body()
    motion = body.walk(2.0, 0.35)
    run(body, lambda: motion.done)
    assert motion.is_blocked
    gap = math.hypot(body.x - body.room.people[0].x, body.y - body.room.people[0].y)
    assert gap >= RADIUS + body.room.people[0].radius
    assert events(body) == [("bumped", {"side": "front"})]
    assert body.distance < 0.05
    assert body.is_still


@pytest.mark.parametrize("start", [lambda b: b.walk(2.0, 0.35), lambda b: b.turn(360, 90)])
def test_robot_brakes_from_full_speed_within_a_tenth_of_a_second(start):
    body = Body(room=Room().with_moved("person", 0.0, 2.0))
    start(body)
    for _ in range(30):
        body.step(STEP)
    assert body.is_rolling
    body.halt()
    before = (body.x, body.theta_deg)
    assert run(body, lambda: body.is_still) <= 0.1 + 1e-9
    assert abs(body.x - before[0]) < 0.03
    assert abs(body.theta_deg - before[1]) < 6
    standing = (body.x, body.y, body.theta_deg)
    body.step(1.0)
    assert (body.x, body.y, body.theta_deg) == standing


def test_head_stays_within_its_speed_and_angle_limits():
    body = Body()
    body.head_yaw.set_target(200)
    body.step(0.5)
    assert body.head_yaw.angle == pytest.approx(60.0)
    assert not body.is_still
    run(body, lambda: body.is_still)
    assert body.head_yaw.angle == 119.0


def test_speech_of_fifty_characters_takes_three_seconds_and_a_new_speech_replaces_it():
    body = Body()
    speech = body.speak("x" * 50)
    assert body.speech == "x" * 50
    seconds = run(body, lambda: speech.done)
    assert seconds == pytest.approx(3.0, abs=2 * STEP)
    assert body.speech is None
    first, second = body.speak("one two"), body.speak("three")
    assert first.done
    assert body.speech == "three"
    assert second.word == "three"
    body.halt()
    assert (body.speech, second.done) == (None, True)


def test_robot_waves_and_lowers_its_arm():
    body = Body()
    wave = body.wave("right")
    body.step(0.8)
    assert body.arms["right"].angle == 140
    assert body.arms["left"].angle == 0
    run(body, lambda: wave.done)
    assert (body.arms["right"].angle, body.elbows["right"].angle) == (0, 0)
    assert body.is_still


def test_touch_and_release_are_each_published_once():
    body = Body()
    body.touch("head", down=True)
    body.touch("head", down=True)
    body.step(MIN_TOUCH_S + 0.1)
    body.touch("head", down=False)
    body.touch("left_hand", down=False)
    body.hear("hello")
    assert events(body) == [
        ("touched", {"place": "head"}),
        ("released", {"place": "head"}),
        ("heard", {"word": "hello"}),
    ]


def test_short_tap_lasts_a_minimum_time_and_a_held_touch_lasts_longer():
    body = Body()
    body.touch("head", down=True)
    body.touch("head", down=False)
    body.step(MIN_TOUCH_S - 0.05)
    assert list(body.touch_durations_s) == ["head"]
    body.step(0.1)
    assert events(body) == [("touched", {"place": "head"}), ("released", {"place": "head"})]
    assert not body.touch_durations_s
    body.touch("head", down=True)
    body.touch("head", down=False)
    body.step(0.1)
    body.touch("head", down=True)  # pressed during the tap: held from now on
    body.step(5)
    assert list(body.touch_durations_s) == ["head"]


def test_drawing_state_contains_the_speech_progress():
    body = Body()
    speech = body.speak("x" * 100)
    body.step(speech.duration_s / 2)
    assert drawing_state(body)["spoken"] == pytest.approx(0.5, abs=0.02)
    run(body, lambda: speech.done)
    assert body.spoken_fraction == 0.0


def test_heard_word_is_shown_for_some_seconds():
    body = Body()
    assert drawing_state(body)["heard"] == ""
    body.hear("hello")
    body.step(1)
    assert drawing_state(body)["heard"] == "hello"
    body.step(4)
    assert drawing_state(body)["heard"] == ""
    assert body.last_word == "hello"  # the sensor keeps its last value


def test_battery_drains_faster_while_moving():
    standing, walking = Body(), Body(theta_deg=180.0)
    walking.walk(1.5, 0.3)
    standing.step(4)
    walking.step(4)
    assert 84 < walking.battery < standing.battery < 84.4


def test_reset_restores_pose_touches_and_room():
    body = Body()
    body.turn(90, 90)
    body.step(1)
    body.touch("head", down=True)
    body.room = body.room.with_moved("ball", 0.5, 1.0)
    body.reset(Room())
    run(body, lambda: body.is_still)
    assert (body.x, body.theta_deg, body.touch_durations_s, body.room) == (-0.5, 0.0, {}, Room())


def test_drawing_state_has_position_speech_touches_and_objects():
    body = Body()
    body.touch("head", down=True)
    body.speak("Hi")
    drawn = drawing_state(body)
    assert {k: drawn[k] for k in ("x", "speech", "touched", "moving")} == {
        "x": -0.5, "speech": "Hi", "touched": ["head"], "moving": False,
    }  # fmt: skip
    kinds = [thing["kind"] for thing in drawn["objects"]]
    assert kinds == ["ball", "person", "marker", "table", "shelf"]
    assert drawn["room"]["x_max"] == 3.0


@settings(max_examples=examples(60), deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from(["walk", "turn"]), st.floats(-2, 2), st.floats(0.1, 2)), max_size=6)
)
def test_robot_never_overlaps_obstacles(plan):
    body = Body()
    for what, amount, seconds in plan:
        if what == "walk":
            body.walk(amount, 0.35)
        else:
            body.turn(amount * 90, 90)
        body.step(seconds)
        assert body.room.is_free(body.x, body.y, RADIUS - 1e-6)
    body.halt()
    body.step(0.2)
    assert body.is_still


@given(st.floats(-3, 3), st.floats(0.05, 0.5))
def test_motion_ends_exactly_at_the_requested_distance(amount, speed):
    motion = Motion.walk(amount, speed)
    total = 0.0
    for _ in range(20000):
        way = motion.step(0.01)
        assert abs(way) <= speed * 0.01 + 0.0021
        total += way
        if motion.done:
            break
    assert total == pytest.approx(amount, abs=1e-9)


def test_stopped_joint_keeps_its_angle():
    joint = Joint(100, -10, 10)
    joint.set_target(5)
    joint.step(0.01)
    joint.stop()
    joint.step(1)
    assert joint.angle == 1.0
