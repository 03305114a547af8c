"""Tests of broadcasts and of the ways in which they end another script."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.fixes import fix
from tests.blocks.fakes import FakeLink, Play, play, until
from tests.blocks.samples import (
    block,
    boolean,
    get,
    number,
    robot,
    say,
    stack,
    started,
    text,
    workspace,
    write,
)


def broadcast(name: str, *, wait: bool = False) -> dict[str, object]:
    return block("events_broadcast_wait" if wait else "events_broadcast", NAME=name)


def received(name: str, *blocks: dict[str, object]) -> dict[str, object]:
    return stack(block("events_received", NAME=name), *blocks)


def pause(seconds: float) -> dict[str, object]:
    return block("control_wait", SECONDS=number(seconds))


def until_so(variable: str) -> dict[str, object]:
    return block("control_wait_until", CONDITION=get(variable))


def put(variable: str, value: object) -> dict[str, object]:
    return block("variables_set", VAR={"id": variable}, VALUE=value)


def begin(saved: dict[str, object], link: FakeLink | None = None) -> Play:
    return Play(compile_behaviour(saved, [robot()]), (robot(),), link).start()


def test_several_scripts_receive_broadcast_and_program_ends_after_all():
    run = play(
        workspace(
            started(broadcast("quiz"), write(text("sent"))),
            received("quiz", pause(0.05), write(text("one"))),
            received("quiz", pause(0.05), broadcast("more")),
            received("more", pause(0.05), write(text("two"))),
            received("other", write(text("never"))),
        )
    )
    assert run.runtime.error is None
    assert run.lines == ["sent", "one", "two"]


def test_broadcast_and_wait_waits_for_all_receivers():
    run = play(
        workspace(
            started(broadcast("quiz", wait=True), broadcast("nobody", wait=True), write(text("after"))),
            received("quiz", pause(0.05), write(text("one"))),
            received("quiz", pause(0.1), write(text("two"))),
        )
    )
    assert run.lines == ["one", "two", "after"]


def test_repeated_broadcast_restarts_its_script():
    again = received("go", write(text("begin")), until_so("ready"), write(text("end")))
    run = play(
        workspace(
            started(broadcast("go"), pause(0.05), broadcast("go"), pause(0.05), put("ready", boolean(True))),
            again,
            variables=("ready",),
        )
    )
    assert run.lines == ["begin", "begin", "end"]


def test_two_simultaneous_broadcasts_run_script_once():
    run = play(workspace(started(broadcast("go"), broadcast("go")), received("go", write(text("ran")))))
    assert run.lines == ["ran"]


def test_script_that_broadcasts_to_itself_restarts_until_stopped():
    run = begin(workspace(started(broadcast("go")), received("go", write(text("x")), broadcast("go"))))
    until(lambda: len(run.lines) > 3)
    assert not run.runtime.finished.is_set()
    run.stop()
    run.end()


def test_broadcast_and_wait_ends_when_awaited_script_restarts():
    run = play(
        workspace(
            started(broadcast("go", wait=True), write(text("first is over")), put("ready", boolean(True))),
            started(pause(0.05), broadcast("go", wait=True), write(text("second is over"))),
            received("go", until_so("ready")),
            variables=("ready",),
        )
    )
    assert run.lines == ["first is over", "second is over"]


def test_restarted_script_cancels_its_robot_task():
    link = FakeLink()
    link.held = {"say"}
    run = begin(
        workspace(started(broadcast("go"), until_so("again"), broadcast("go")), received("go", say("Hi"))),
        link,
    )
    until(lambda: len(link.calls) == 1)
    run.names["again"] = True
    until(lambda: len(link.calls) == 2)
    assert link.canceled == link.calls[:1]
    link.answer(link.calls[1], "succeeded")
    run.end()
    assert run.runtime.error is None


def test_stop_other_scripts_ends_other_scripts_and_cancels_robot_tasks():
    link = FakeLink()
    link.held = {"say"}
    run = begin(
        workspace(
            started(say("a long story"), write(text("never"))),
            started(block("control_forever", BODY=[pause(0.01)])),
            started(until_so("go"), block("control_stop_others"), write(text("alone"))),
            variables=("go",),
        ),
        link,
    )
    until(lambda: len(link.calls) == 1)
    run.names["go"] = True
    run.end()
    assert (run.lines, link.canceled, run.runtime.error) == (["alone"], link.calls, None)


def test_stop_other_scripts_ends_script_not_yet_started():
    for _ in range(20):  # the result must not depend on which script runs first
        run = play(
            workspace(
                started(block("control_stop_others"), write(text("one"))),
                started(block("control_stop_others"), write(text("two"))),
            )
        )
        assert run.lines in (["one"], ["two"])


def test_event_restarts_stopped_script():
    link = FakeLink()
    run = begin(
        workspace(
            stack(
                block("events_message", TOPIC="/x"),
                write(text("begin")),
                until_so("ready"),
                write(text("end")),
            ),
            stack(block("events_message", TOPIC="/stop"), block("control_stop_others"), write(text("ended"))),
            variables=("ready",),
        ),
        link,
    )
    link.happen("/x", 1)
    until(lambda: run.lines == ["begin"])
    link.happen("/stop", 1)
    until(lambda: run.lines == ["begin", "ended"])
    link.happen("/x", 1)
    until(lambda: run.lines == ["begin", "ended", "begin"])
    run.stop()
    run.end()


def test_script_that_waits_for_receivers_can_be_paused():
    run = begin(
        workspace(
            started(broadcast("go", wait=True), write(text("after"))), received("go", until_so("ready")),
            variables=("ready",),
        )
    )  # fmt: skip
    until(lambda: len(run.runtime.scheduler.snapshot().blocks) == 2)
    run.runtime.scheduler.pause()
    until(lambda: run.runtime.scheduler.snapshot().is_paused)
    run.names["ready"] = True
    run.runtime.scheduler.resume()
    run.end()
    assert run.lines == ["after"]


@pytest.mark.parametrize("name", ["", "  ", "\n"])
def test_broadcast_without_a_name_is_skipped_with_an_error(name):
    (problem,) = [
        p
        for p in compile_behaviour(workspace(started(broadcast(name))), []).problems
        if p.severity == "error"
    ]
    assert problem.message == "broadcast needs the name of a message. It stays in the file but is skipped."


@pytest.mark.parametrize(
    "name", ["start quiz", "👍", "Olé “x”", "-1", str(2**64 - 1), "x" * 500, "{name}", "%NAME"]
)
def test_broadcast_name_may_be_any_text_and_surrounding_spaces_are_ignored(name):
    run = play(workspace(started(broadcast(f" {name} ")), received(name, write(text("ran")))))
    assert (run.program.problems, run.lines) == ((), ["ran"])


def test_broadcast_without_receiver_is_reported_with_fix():
    saved = workspace(started(broadcast("start quiz") | {"id": "b"}) | {"x": 10, "y": 30})
    (problem,) = compile_behaviour(saved, []).problems
    assert (problem.severity, problem.block_id) == ("warning", "b")
    assert problem.message == "Nothing receives “start quiz”."
    assert problem.subject in problem.message
    fixed = fix(saved, problem.fix_action)
    assert fixed is not None
    assert compile_behaviour(fixed, []).problems == ()
    assert fixed["blocks"]["blocks"][1]["x"] > 400


def test_receiver_without_broadcast_is_reported():
    (problem,) = compile_behaviour(workspace(started(), received("quiz", write(text("x")))), []).problems
    assert problem.message == "Nothing broadcasts “quiz”, so this script doesn't run."
    assert problem.severity == "info"
