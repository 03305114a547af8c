"""Tests of tasks: only the robot's own replies to the invoke change a task, and nothing after its end."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from app.robots.client.limits import MIN_SILENCE_S, max_silence_s, stop_timeout_s
from app.robots.client.reply import FINAL_STATES, RobotReply, parse_reply
from app.robots.client.task import RobotTask, is_silent
from tests.blocks.samples import robot

replies = st.builds(
    lambda op, id, state, more: {"op": op, "id": id, "state": state, **more},
    st.sampled_from([None, "invoke", "invoke", "cancel", "stop", "alive", 7]),
    st.sampled_from(["t1", "t1", "t1", "t2", "", None, ["t1"]]),
    st.sampled_from(["accepted", "running", "succeeded", "failed", "canceled", "dancing", None, ["failed"]]),
    st.fixed_dictionaries(
        {},
        optional={
            "output": st.sampled_from([{}, {"moved": 1}, 7]),
            "feedback": st.sampled_from([{}, {"to_go": 1}, "far"]),
            "error": st.sampled_from([None, "", "stuck", 7]),
            "waits_for": st.sampled_from([[], ["look"], "look"]),
            "replaces": st.sampled_from([[], ["turn"], None]),
        },
    ),
)


@given(st.lists(replies, max_size=12))
def test_task_follows_its_own_replies_and_ends_once(payloads: list[dict[str, object]]) -> None:
    task = RobotTask("t1", "Pepper", "walk")
    ended: list[tuple[object, ...]] = []
    for now, payload in enumerate(payloads, 100):
        reply = parse_reply(payload)
        assert reply is not None
        before = replace(task)
        is_own = payload["id"] == "t1" and payload["op"] in (None, "invoke") and reply.state != ""
        if task.apply(reply, now):
            ended.append((payload["state"], now))
        if not is_own or ended[:-1] or not before.is_running:
            assert vars(task) == vars(before)
        else:
            assert task.state == payload["state"]
    assert len(ended) <= 1
    assert task.is_running is not bool(ended)
    if ended:
        assert (task.state, task.ended_s) == ended[0]
        assert task.state in FINAL_STATES


def test_newest_values_that_are_not_empty_are_kept() -> None:
    task = RobotTask("t1", "Pepper", "walk")
    for fields in (
        {"waits_for": ["look", "look"], "replaces": ["turn"], "feedback": {"to_go": 2}},
        {"waits_for": [], "replaces": [], "feedback": {}, "output": {}},
        {"feedback": {"to_go": 1}, "output": {"moved": 1}},
    ):
        task.apply(RobotReply("invoke", "t1", "accepted", fields), 5.0)
    assert (task.waits_for, task.replaces) == (("look", "look"), ("turn",))
    assert (task.feedback, task.output) == ({"to_go": 1}, {"moved": 1})
    assert not task.has_started
    task.apply(RobotReply("invoke", "t1", "running"), 6.0)
    task.apply(RobotReply("invoke", "t1", "running"), 7.0)
    assert (task.has_started, task.execution_start_s) == (True, 6.0)


def test_robot_is_silent_after_missed_heartbeats() -> None:
    slow, mute = (replace(robot(), heartbeat_interval_s=each) for each in (1.0, None))
    quick = replace(robot(), heartbeat_interval_s=0.1)
    assert [max_silence_s(each) for each in (slow, quick, mute)] == [4.0, MIN_SILENCE_S, None]
    assert [is_silent(slow, 10.0, now) for now in (14.0, 14.1)] == [False, True]
    assert not is_silent(mute, 10.0, 1e9)


def test_stop_waits_longer_than_the_drivers_of_its_robots_but_not_without_end() -> None:
    def stops_within(seconds: float) -> float:
        safe_stop = replace(robot().safe_stop, within_s=seconds)
        return stop_timeout_s([replace(robot(), safe_stop=safe_stop)])

    assert [stops_within(each) for each in (0.2, 2.0, 60.0)] == [1.0, 2.5, 10.0]
    assert stop_timeout_s([]) == 1.0
