"""Tests of arming: off by default, limited to some minutes and to chosen targets."""

from __future__ import annotations

from app.core.run.acting.arming import MAX_ARMED_S, MAX_TARGETS, MIN_ARMED_S, Arming, Target

TOPIC = Target("topic", "/cmd_vel")


def made() -> tuple[Arming, list[float]]:
    now = [100.0]
    return Arming(lambda: now[0]), now


def test_sending_requires_arming_and_an_allowed_target() -> None:
    arming, _now = made()
    done: list[int] = []
    assert not arming.allow(TOPIC)
    assert not arming.run_if_armed(arming.turn, TOPIC, lambda: done.append(1))
    arming.arm()
    assert not arming.allows(TOPIC)
    assert arming.allow(TOPIC)
    assert arming.run_if_armed(arming.turn, TOPIC, lambda: done.append(2))
    assert not arming.run_if_armed(arming.turn, Target("service", "/cmd_vel"), lambda: done.append(3))
    assert done == [2]


def test_arming_expires_and_sending_does_not_extend_it() -> None:
    arming, now = made()
    arming.arm(60)
    arming.allow(TOPIC)
    now[0] += 59
    assert arming.run_if_armed(arming.turn, TOPIC, lambda: None)
    assert arming.remaining_s == 1
    now[0] += 1
    assert not arming.is_on
    assert not arming.run_if_armed(arming.turn, TOPIC, lambda: None)


def test_remaining_time_never_exceeds_the_duration() -> None:
    for hundredths in range(5000):
        arming, now = made()
        now[0] = 1000 + hundredths / 100
        arming.arm(300)
        assert arming.remaining_s == 300
        now[0] += 0.1
        assert 299 < arming.remaining_s < 300


def test_request_of_previous_arming_is_rejected_after_rearming() -> None:
    arming, _now = made()
    arming.arm()
    arming.allow(TOPIC)
    turn = arming.turn
    assert arming.disarm()
    assert not arming.disarm()
    arming.arm()
    arming.allow(TOPIC)
    assert not arming.run_if_armed(turn, TOPIC, lambda: None)
    assert arming.run_if_armed(arming.turn, TOPIC, lambda: None)


def test_target_count_and_duration_are_limited_and_targets_can_be_removed() -> None:
    arming, _now = made()
    for seconds, left in ((-1, MIN_ARMED_S), (1e9, MAX_ARMED_S), (300, 300)):
        arming.arm(seconds)
        assert arming.remaining_s == left
    names = [Target("topic", f"/t{number}") for number in range(MAX_TARGETS + 1)]
    assert [arming.allow(each) for each in names] == [True] * MAX_TARGETS + [False]
    arming.deny(names[0])
    assert not arming.allows(names[0])
    assert arming.allow(names[-1])


def test_motion_confirmation_ends_with_disarming() -> None:
    arming, _now = made()
    arming.arm()
    arming.allow(TOPIC, is_confirmed=True)
    assert arming.is_confirmed(TOPIC.name)
    arming.disarm()
    arming.arm()
    assert not arming.is_confirmed(TOPIC.name)
