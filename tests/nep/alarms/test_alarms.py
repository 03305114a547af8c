"""Tests of the actions of an alarm and their results, and of snooze and history."""

from __future__ import annotations

from nep.programs.alarms import AlarmAction
from nep.programs.alarms.alarms import RETRY_DELAY_S
from nep.programs.alarms.history import MAX_RECORDS, AlarmHistory, AlarmRecord
from tests.nep.alarms.scene import MIDNIGHT_S, Scene, rule

CALL = AlarmAction("call", "restart", {})


class Hands:
    """Fake carrier that records actions and reports success or failure, as `well` determines."""

    def __init__(self) -> None:
        self.done = []
        self.well = True

    def __call__(self, event, action, done) -> None:
        self.done.append((event.kind, action.kind))
        done(self.well, "answered" if self.well else "not responding")


def near(scene: Scene) -> None:
    scene.send("/d", {"r": 0})


def far(scene: Scene) -> None:
    scene.send("/d", {"r": 9})


def scene_with(*actions: AlarmAction, hands: Hands, **more: object) -> Scene:
    kinds = ("banner", "call", "stop")
    made = Scene(
        rule("below", "/d", *actions, path="r", limit=1, **more), action_starters=dict.fromkeys(kinds, hands)
    )
    made.graph(("/d",))
    return made


def test_actions_run_once_in_order_and_are_recorded() -> None:
    hands = Hands()
    scene = scene_with(AlarmAction("stop"), AlarmAction("banner"), AlarmAction("sound"), hands=hands)
    near(scene)
    near(scene)
    scene.wait(0.2)
    assert hands.done == [("on", "stop"), ("on", "banner")]
    (record,) = scene.alarms.history
    assert [deed.kind for deed in record.action_results] == ["stop", "banner", "sound"]
    assert record.action_results[-1].text == "this action isn't available here"  # no handler for sounds
    assert record.cause == "r of /d is 0, below 1"
    assert not scene.alarms.is_busy


def test_failed_call_is_retried_while_the_alarm_is_active() -> None:
    hands = Hands()
    hands.well = False
    scene = scene_with(CALL, hands=hands)
    near(scene)
    scene.wait(0.1)
    assert 0 < (scene.alarms.retry_in_s("r") or 0) <= RETRY_DELAY_S
    scene.wait(RETRY_DELAY_S + 1)
    assert len(hands.done) == 2
    hands.well = True
    scene.wait(RETRY_DELAY_S + 1)
    assert scene.alarms.retry_in_s("r") is None
    assert [deed.text for deed in scene.alarms.history.records[-1].action_results] == ["answered"]
    scene.wait(3 * RETRY_DELAY_S)
    assert len(hands.done) == 3


def test_retry_is_cancelled_when_the_alarm_clears_or_the_rule_is_removed() -> None:
    hands = Hands()
    hands.well = False
    scene = scene_with(CALL, hands=hands)
    near(scene)
    far(scene)
    scene.wait(RETRY_DELAY_S + 5)
    assert len(hands.done) == 1
    near(scene)
    scene.wait(1)
    scene.alarms.remove("r")
    scene.wait(RETRY_DELAY_S + 5)
    assert len(hands.done) == 2


def test_action_that_raises_does_not_block_the_next_one() -> None:
    def broken(_event, _action, _done) -> None:
        raise RuntimeError("no arm")

    hands = Hands()
    condition = rule("below", "/d", AlarmAction("stop"), AlarmAction("banner"), path="r", limit=1)
    scene = Scene(condition, action_starters={"stop": broken, "banner": hands})
    scene.graph(("/d",))
    near(scene)
    scene.wait(0.1)
    assert hands.done == [("on", "banner")]
    assert [deed.text for deed in scene.alarms.history.records[0].action_results] == ["no arm", "answered"]


def test_snoozed_alarm_is_recorded_and_runs_its_actions_once_the_snooze_ends() -> None:
    hands = Hands()
    scene = scene_with(AlarmAction("banner"), hands=hands, snoozed_until_s=MIDNIGHT_S + 110)
    near(scene)
    assert hands.done == []
    assert [record.was_snoozed for record in scene.alarms.history] == [True]
    scene.wait(11)  # the snooze ends while the condition still holds
    assert hands.done == [("still", "banner")]
    assert len(scene.alarms.history) == 1
    scene.wait(60)
    assert len(hands.done) == 1


def test_snooze_that_ends_after_the_alarm_cleared_runs_no_action() -> None:
    hands = Hands()
    scene = scene_with(AlarmAction("banner"), hands=hands, snoozed_until_s=MIDNIGHT_S + 110)
    near(scene)
    far(scene)
    scene.wait(30)
    assert hands.done == []
    scene.alarms.snooze("r", 0.0)
    near(scene)
    assert hands.done == [("on", "banner")]


def test_history_is_bounded_and_counts_occurrences() -> None:
    history = AlarmHistory()
    for number in range(MAX_RECORDS + 10):
        history.add(AlarmRecord("a" if number % 2 else "b", "x", float(number), is_on=number == 509))
    assert len(history) == MAX_RECORDS
    assert history.count_since("a", 500.0) == 5
    last = history.last("a")
    assert last is not None
    assert last.at_s == 509.0
    assert history.current("a") is last
    assert history.current("b") is None
    history.clear()
    assert [record.at_s for record in history] == [509.0]
