"""The switch: off at first, on for some minutes and for names that were chosen."""

from __future__ import annotations

from app.core.run.acting.arming import MAX_NAMES, MAX_S, MIN_S, Arming, Target

TOPIC = Target("topic", "/cmd_vel")


def made() -> tuple[Arming, list[float]]:
    now = [100.0]
    return Arming(lambda: now[0]), now


def test_nothing_is_allowed_before_it_is_armed_and_named() -> None:
    arming, _now = made()
    done: list[int] = []
    assert not arming.allow(TOPIC)
    assert not arming.if_armed(arming.turn, TOPIC, lambda: done.append(1))
    arming.arm()
    assert not arming.allows(TOPIC)
    assert arming.allow(TOPIC)
    assert arming.if_armed(arming.turn, TOPIC, lambda: done.append(2))
    assert not arming.if_armed(arming.turn, Target("service", "/cmd_vel"), lambda: done.append(3))
    assert done == [2]


def test_its_time_goes_by_and_sending_does_not_lengthen_it() -> None:
    arming, now = made()
    arming.arm(60)
    arming.allow(TOPIC)
    now[0] += 59
    assert arming.if_armed(arming.turn, TOPIC, lambda: None)
    assert arming.left_s == 1
    now[0] += 1
    assert not arming.is_on
    assert not arming.if_armed(arming.turn, TOPIC, lambda: None)


def test_what_was_asked_in_one_turn_is_not_done_in_the_next() -> None:
    arming, _now = made()
    arming.arm()
    arming.allow(TOPIC)
    turn = arming.turn
    assert arming.disarm()
    assert not arming.disarm()
    arming.arm()
    arming.allow(TOPIC)
    assert not arming.if_armed(turn, TOPIC, lambda: None)
    assert arming.if_armed(arming.turn, TOPIC, lambda: None)


def test_names_and_minutes_are_bounded_and_names_can_be_taken_away() -> None:
    arming, _now = made()
    for seconds, left in ((-1, MIN_S), (1e9, MAX_S), (300, 300)):
        arming.arm(seconds)
        assert arming.left_s == left
    names = [Target("topic", f"/t{number}") for number in range(MAX_NAMES + 1)]
    assert [arming.allow(each) for each in names] == [True] * MAX_NAMES + [False]
    arming.forbid(names[0])
    assert not arming.allows(names[0])
    assert arming.allow(names[-1])


def test_that_a_person_knows_what_moves_ends_with_the_turn() -> None:
    arming, _now = made()
    arming.arm()
    arming.allow(TOPIC, is_confirmed=True)
    assert arming.is_confirmed(TOPIC.name)
    arming.disarm()
    arming.arm()
    assert not arming.is_confirmed(TOPIC.name)
