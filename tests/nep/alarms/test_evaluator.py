"""Tests of the conditions that trigger and clear an alarm."""

from __future__ import annotations

import json
import math
import threading

import pytest

from nep.cli.values import encode_json
from nep.programs.alarms.evaluator import LARGE_MESSAGE_BYTES
from nep.programs.alarms.losses import TopicLosses
from nep.programs.alarms.sentences import condition_text, current_value_text
from nep.protocol.graph_view import SubscriberInfo, TopicInfo
from tests.nep.alarms.scene import MIDNIGHT_S, Scene, message, rule


def test_topic_that_never_existed_does_not_trigger_a_silence_alarm() -> None:
    scene = Scene(rule("silent", "/cam", for_s=2.0))
    scene.graph(("/other",))
    assert scene.wait(10) == []
    assert scene.state() == "waits"


def test_silence_alarm_reports_its_duration_and_clears_on_a_message() -> None:
    scene = Scene(rule("silent", "/cam", for_s=2.0))
    scene.graph(("/cam",))
    assert scene.wait(1.5) == []
    scene.send("/cam", 1)
    assert scene.wait(1.9) == []
    ((kind, seen),) = scene.wait(0.2)
    assert kind == "on"
    assert seen == pytest.approx(2.0, abs=0.11)
    scene.wait(2)
    assert scene.state() == "on"
    scene.send("/cam", 1)
    assert scene.happened() == []
    scene.wait(1.5)
    scene.send("/cam", 1)
    (record,) = scene.alarms.history
    assert [kind for kind, _seen in scene.wait(1)] == ["off"]
    assert record.duration_s == pytest.approx(2.1, abs=0.25)
    assert not record.is_on


def test_silence_alarm_is_evaluated_while_the_master_is_missing() -> None:
    scene = Scene(rule("silent", "/cam", for_s=1.0))
    scene.graph(("/cam",))
    scene.send("/cam", 1)
    scene.alarms.evaluator.update_graph(None)
    scene.wait(0.5)
    scene.send("/cam", 1)
    assert scene.wait(0.8) == []
    assert [kind for kind, _ in scene.wait(0.5)] == ["on"]


@pytest.mark.parametrize(
    ("kind", "limit", "well", "bad"),
    [
        ("below", 0.4, 0.4, 0.39), ("above", 20, 20, 20.5), ("equals", "stuck", "well", "stuck"),
        ("equals", True, 1, True), ("equals", 0, False, 0), ("equals", None, 0, None),
        ("is_not", "ok", "ok", "hot"), ("above", 2**53, 2**53, 2**64 - 1),
    ],
)  # fmt: skip
def test_value_is_compared_with_the_limit(kind: str, limit: object, well: object, bad: object) -> None:
    scene = Scene(rule(kind, "/d", path="a.v[1]", limit=limit))
    scene.graph(("/d",))
    assert scene.send("/d", {"a": {"v": [0, well]}}) == []
    assert scene.send("/d", {"a": {"v": [0, bad]}}) == [("on", bad)]


def test_integer_beyond_float_range_is_treated_as_infinite() -> None:
    scene = Scene(rule("below", "/d", path=".", limit=-1))
    scene.graph(("/d",))
    huge = message("/d", 0)
    huge.decoded = -(10**400)
    assert scene.send("/d", huge) == [("on", -math.inf)]


@pytest.mark.parametrize("kind", ["changes", "equals", "is_not"])
@pytest.mark.parametrize("huge", [10**400, -(10**400), 2**64, 2**64 - 1, -(2**63)])
def test_huge_integer_triggers_the_alarm_with_a_description(kind: str, huge: int) -> None:
    scene = Scene(rule(kind, "/d", path=".", limit=1 if kind == "is_not" else huge))
    scene.graph(("/d",))
    told = message("/d", 0)
    told.decoded = huge
    scene.send("/d", 1)
    ((what, seen),) = scene.send("/d", told)
    assert what == "on"
    assert json.loads(encode_json(seen)) == (None if abs(huge) > 1e308 else seen)
    (record,) = scene.alarms.history
    assert record.cause
    state = scene.alarms.evaluator.state(scene.alarms.rules[0])
    assert current_value_text(scene.alarms.rules[0].condition, state.value)
    assert condition_text(scene.alarms.rules[0].condition)


def test_repeated_nan_is_not_a_change() -> None:
    scene = Scene(rule("changes", "/d", path="r"))
    scene.graph(("/d",))
    nan = b'{"r": NaN}'
    assert scene.send("/d", nan, nan) == []
    assert [kind for kind, _seen in scene.send("/d", {"r": 1}, nan)] == ["on"]


def test_brief_violation_within_a_batch_triggers_the_alarm() -> None:
    scene = Scene(rule("below", "/d", path="r", limit=0.4))
    scene.graph(("/d",))
    assert scene.send("/d", {"r": 1}, {"r": 0.3}, {"r": 1}) == [("on", 0.3)]


@pytest.mark.parametrize(
    "payload", [b"{oops", {"r": "near"}, {"r": True}, {"other": 0}, b'{"r": NaN}', [], 0]
)
def test_incomparable_value_triggers_no_alarm_and_is_reported(payload: object) -> None:
    scene = Scene(rule("below", "/d", path="r", limit=0.4))
    scene.graph(("/d",))
    assert scene.send("/d", payload) == []
    state = scene.alarms.evaluator.state(scene.alarms.rules[0])
    assert state.problem in {"missing", "no_number", "unreadable"}
    assert scene.send("/d", {"r": 0.3}) == [("on", 0.3)]
    assert scene.alarms.evaluator.state(scene.alarms.rules[0]).problem == ""


def test_condition_must_hold_without_interruption_for_its_duration() -> None:
    scene = Scene(rule("below", "/d", path="r", limit=1, for_s=1.0))
    scene.graph(("/d",))
    scene.send("/d", {"r": 0})
    assert scene.state() == "pending"
    scene.wait(0.8)
    scene.send("/d", {"r": 2})
    assert scene.wait(3) == []
    scene.send("/d", {"r": 0.5})
    assert scene.wait(1.2) == [("on", 0.5)]


def test_flapping_condition_is_one_alarm_with_a_count() -> None:
    scene = Scene(rule("below", "/d", path="r", limit=1, calm_s=1.0))
    scene.graph(("/d",))
    events = []
    for value in (0, 2, 0, 2, 0, 2):
        events += scene.send("/d", {"r": value}) + scene.wait(0.5)
    events += scene.wait(2)
    assert [kind for kind, _seen in events] == ["on", "off"]
    (record,) = scene.alarms.history
    assert record.count == 3
    assert record.duration_s == pytest.approx(2.5, abs=0.2)


def test_alarm_stays_active_within_the_hysteresis_margin() -> None:
    scene = Scene(rule("below", "/d", path="r", limit=1, margin=0.5, calm_s=1.0))
    scene.graph(("/d",))
    scene.send("/d", {"r": 0.9})
    scene.send("/d", {"r": 1.2})
    assert scene.wait(5) == []
    scene.send("/d", {"r": 1.5})
    assert scene.wait(1.2) == [("off", 1.5)]


def test_change_triggers_the_alarm_but_the_first_value_does_not() -> None:
    scene = Scene(rule("changes", "/mode", path="."))
    scene.graph(("/mode",))
    assert scene.send("/mode", "idle", "idle") == []
    assert scene.send("/mode", "run") == [("on", "run")]
    assert scene.wait(6) == [("off", "run")]


def test_node_left_alarm_requires_a_known_node_and_a_complete_graph() -> None:
    scene = Scene(rule("leaves", "lidar"))
    scene.graph(nodes=("other",))
    scene.wait(5)
    assert scene.state() == "waits"
    scene.graph(nodes=("lidar",))
    assert scene.state() == "well"
    scene.graph(nodes=(), epoch=2)  # a new master that doesn't know the node yet
    assert scene.wait(2) == []
    scene.graph(nodes=("lidar",), epoch=2)
    scene.alarms.evaluator.update_graph(None)
    assert scene.wait(20) == []
    assert scene.graph(nodes=(), epoch=2) == [("on", None)]
    scene.graph(nodes=("lidar",), epoch=2)
    assert scene.wait(3) == [("off", None)]


def test_joining_node_and_appearing_topic_are_momentary_alarms() -> None:
    scene = Scene(rule("comes", "arm"), rule("appears", "/debug/*", id="t"))
    scene.graph(("/debug/old",), ("arm",))
    scene.wait(4)
    assert scene.graph(("/debug/old",), ()) == []
    assert scene.graph(("/debug/old", "/debug/new", "/else"), ("arm",)) == [
        ("on", None),
        ("on", "/debug/new"),
    ]
    assert [kind for kind, _ in scene.wait(6)] == ["off", "off"]


def test_rate_alarm_triggers_only_after_the_rate_is_measured() -> None:
    scene = Scene(rule("rate_below", "/odom", limit=8.0, calm_s=1.0))
    scene.graph(("/odom",))
    events = []
    for _ in range(40):
        events += scene.send("/odom", 1) + scene.wait(0.1)
    assert events == []
    events = scene.wait(3)
    assert [kind for kind, _ in events] == ["on"]
    assert events[0][1] < 8.0


def test_loss_alarm_triggers_at_a_lost_percentage_and_clears_after_its_time_window() -> None:
    scene = Scene(rule("loses", "/cmd", limit=1.0, for_s=10.0))
    events = []
    for second in range(20):
        lost = 5 if second >= 5 else 0
        events += scene.graph(("/cmd",), losses={"/cmd": (lost, second * 20)}) + scene.wait(1)
    assert [kind for kind, _ in events] == ["on", "off"]
    assert 1.0 < events[0][1] < 20.0


def test_restarted_subscriber_does_not_count_as_loss() -> None:
    losses = TopicLosses()
    assert losses.percent(10, 0.0) is None

    def told(id: int, lost: int, received: int) -> TopicInfo:
        return TopicInfo("/t", "json", "json", (), (SubscriberInfo(id, "n", received, lost),))

    losses.add(told(1, 50, 100), 0.0)
    losses.add(told(1, 51, 109), 1.0)
    assert losses.percent(10, 1.0) == pytest.approx(10.0)
    losses.add(told(2, 900, 0), 2.0)
    losses.add(told(2, 900, 0), 3.0)
    losses.add(told(2, 0, 5), 4.0)
    losses.add(None, 5.0)
    assert losses.percent(10, 5.0) == pytest.approx(100 * 1 / 15)
    assert losses.percent(10, 50.0) == 0.0


def test_only_one_large_message_per_batch_is_decoded_and_the_others_counted() -> None:
    scene = Scene(rule("above", "/big", path="n", limit=5))
    scene.graph(("/big",))
    large = [message("/big", {"n": n, "x": "x" * LARGE_MESSAGE_BYTES}) for n in (9, 9, 1)]
    assert scene.send("/big", *large) == []
    assert scene.alarms.evaluator.skipped_count == 2
    assert scene.send("/big", large[0]) == [("on", 9)]


def test_unchanged_rules_keep_their_state_and_a_removed_rule_clears_its_alarm() -> None:
    stays = rule("below", "/d", path="r", limit=1)
    scene = Scene(stays, rule("above", "/d", path="r", limit=-1, id="goes"))
    scene.graph(("/d",))
    assert len(scene.send("/d", {"r": 0})) == 2
    scene.alarms.snooze("r", MIDNIGHT_S + 500)
    scene.alarms.remove("goes")
    assert [kind for kind, _ in scene.happened()] == ["off"]
    assert scene.state() == "on"
    scene.alarms.set_rule(rule("below", "/d", path="other", limit=1))
    assert [kind for kind, _ in scene.happened()] == ["off"]
    assert scene.state() == "well"  # the topic was received before


def test_disabled_or_invalid_rule_is_not_watched() -> None:
    scene = Scene(
        rule("silent", "/cam", for_s=1.0, is_enabled=False), rule("silent", "", for_s=1.0, id="new")
    )
    scene.graph(("/cam",))
    assert scene.wait(5) == []
    phases = [state.phase for state in scene.alarms.evaluator.states.values()]
    assert phases == ["off", "faulty"]
    assert scene.alarms.evaluator.topics == frozenset()


def test_concurrent_messages_and_ticks_lose_no_event() -> None:
    scene = Scene(rule("changes", "/n", path=".", calm_s=0.5))
    scene.graph(("/n",))
    batches = [[message("/n", number) for number in range(start, start + 50)] for start in range(0, 2000, 50)]

    def arrive() -> None:
        for batch in batches:
            scene.alarms.evaluator.evaluate("/n", batch)

    thread = threading.Thread(target=arrive)
    thread.start()
    kinds = []
    while thread.is_alive():
        kinds += [kind for kind, _ in scene.happened()]
    thread.join()
    kinds += [kind for kind, _ in scene.happened()]
    assert kinds == ["on"]
    assert scene.alarms.evaluator.state(scene.alarms.rules[0]).count == 1999
    assert not math.isnan(scene.now)
