"""Tests of the trace: what it records, its bound, its encoding, and virtual time."""

from __future__ import annotations

import threading
from collections.abc import Callable

import msgspec
import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.events import AnyEvent, BlocksTraced
from app.blocks.runtime.scheduler import Scheduler
from app.blocks.runtime.trace import (
    AnyRecord,
    BlockBegan,
    BlockEnded,
    BlockInterrupted,
    BlockResumed,
    BlockSkipped,
    BlockWaiting,
    RecordsLost,
    RunningBlocks,
    Trace,
)
from app.clock import VirtualClock
from app.robots import simulated
from app.robots.description.description import parse, thing_description
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.samples import (
    block,
    number,
    robot,
    say,
    stack,
    started,
    text,
    workspace,
    write,
)

WAIT_BLOCK = "control_wait"


def wait(id: str, seconds: float) -> dict[str, object]:
    return block(WAIT_BLOCK, id, SECONDS=number(seconds))


def traced(play: Play, condition: Callable[[list[AnyRecord]], object]) -> list[AnyRecord]:
    """Take the records of a running program until a condition on them is true."""
    records: list[AnyRecord] = []

    def found() -> bool:
        records.extend(play.runtime.scheduler.take_trace())
        return bool(condition(records))

    until(found)
    return records


def test_blocks_of_every_script_are_recorded_with_exact_virtual_times() -> None:
    minutes = started(wait("a", 180), wait("b", 90.25), write(text("done")) | {"id": "c"})
    repeated = started(
        block("control_repeat", "r", TIMES=number(3), BODY=[wait("t", 20)]), write(text("rang")) | {"id": "d"}
    )
    runs = []
    for _ in range(3):
        play = Play(compile_behaviour(workspace(minutes, repeated), []), clock=VirtualClock()).start().end()
        records = traced(play, lambda records: sum(isinstance(each, BlockEnded) for each in records) == 2)
        runs.append((play.lines, records))
    assert runs[0][0] == ["rang", "done"]
    assert runs[0][1] == [
        BlockBegan(0.0, 1, "a"), BlockBegan(0.0, 2, "r"), BlockWaiting(0.0, 1, "a", "time"),
        BlockBegan(0.0, 2, "t"), BlockWaiting(0.0, 2, "t", "time"),
        BlockBegan(20.0, 2, "r"), BlockBegan(20.0, 2, "t"), BlockWaiting(20.0, 2, "t", "time"),
        BlockBegan(40.0, 2, "r"), BlockBegan(40.0, 2, "t"), BlockWaiting(40.0, 2, "t", "time"),
        BlockBegan(60.0, 2, "r"), BlockBegan(60.0, 2, "d"), BlockEnded(60.0, 2, "d"),
        BlockBegan(180.0, 1, "b"), BlockWaiting(180.0, 1, "b", "time"),
        BlockBegan(270.25, 1, "c"), BlockEnded(270.25, 1, "c"),
    ]  # fmt: skip
    assert runs[1:] == runs[:1] * 2


def test_conditions_and_timer_run_in_virtual_time() -> None:
    timer = block("values_compare", A=block("sensing_timer"), RELATION=">", B=number(300))
    until_late = started(block("control_wait_until", "w", CONDITION=timer), write(text("late")) | {"id": "l"})
    play = Play(compile_behaviour(workspace(until_late), []), clock=VirtualClock()).start().end()
    assert play.lines == ["late"]
    records = traced(play, lambda records: any(isinstance(each, BlockEnded) for each in records))
    assert records[1] == BlockWaiting(0.0, 1, "w", "condition")
    assert records[-1] == BlockEnded(pytest.approx(300.02, abs=0.011), 1, "l")


def test_robot_pause_and_skip_are_recorded_with_causes() -> None:
    pepper = parse(thing_description(simulated.ROBOT.thing_model, "Pepper"))
    link = FakeLink()
    link.held = {"walk"}
    walk = block("robot_pepper_do_walk", "w", ROBOT="Pepper", DISTANCE=number(1), SPEED=number(0.3))
    play = Play(compile_behaviour(workspace(started(walk)), [pepper]), (pepper,), link).start()
    until(lambda: bool(link.calls))
    play.runtime.scheduler.pause()
    until(lambda: bool(link.canceled))
    link.calls[0].has_started = True
    link.answer(link.calls[0], "canceled")
    until(lambda: play.runtime.scheduler.snapshot().is_paused)
    play.runtime.scheduler.resume()
    play.end()
    records = traced(play, lambda records: isinstance(records[-1], BlockEnded))
    assert [type(each) for each in records] == [
        BlockBegan, BlockWaiting, BlockInterrupted, BlockResumed, BlockSkipped, BlockEnded,
    ]  # fmt: skip
    causes = [
        each.cause for each in records if isinstance(each, BlockWaiting | BlockInterrupted | BlockSkipped)
    ]
    assert causes == ["robot", "pause", "unknown_remainder"]


def test_replaced_and_canceled_actions_are_interruptions() -> None:
    pepper, link = robot(), FakeLink()
    link.answers["say"] = ("canceled", {}, "")
    play = Play(compile_behaviour(workspace(started(say("Hi") | {"id": "s"})), [pepper]), (pepper,), link)
    play.start().end()
    records = traced(play, lambda records: any(isinstance(each, BlockEnded) for each in records))
    (interrupted,) = [each for each in records if isinstance(each, BlockInterrupted)]
    assert (interrupted.block, interrupted.cause) == ("s", "canceled")


def test_failed_block_ends_with_its_message_and_other_scripts_are_stopped() -> None:
    half = block("values_arithmetic", "v", A=number(1), SIGN="/", B=number(0))
    saved = workspace(started(wait("w", 1000)), started(wait("x", 0.01), write(half) | {"id": "f"}))
    play = Play(compile_behaviour(saved, [])).start().end()
    records = traced(play, lambda records: sum(isinstance(each, BlockEnded) for each in records) == 2)
    w, f = sorted((each for each in records if isinstance(each, BlockEnded)), key=lambda each: each.script)
    assert (w.block, w.cause, w.text, w.value_block) == ("w", "stopped", "", "")
    assert (f.block, f.cause, f.text, f.value_block) == ("f", "failed", "“÷” can't divide by 0.", "v")
    running = RunningBlocks()
    running.apply(records)
    assert running.blocks == ("w", "f"), "they stopped there"
    assert running.failure == f


def test_trace_is_bounded_in_bytes_and_marks_losses() -> None:
    change = block("variables_change", "c", VAR={"id": "n"}, BY=number(1))
    loop = block("control_forever", "loop", BODY=[change])
    play = Play(compile_behaviour(workspace(started(loop), variables=("n",)), [])).start()
    until(lambda: play.runtime.scheduler.trace.is_full)  # also on a slow computer
    batches: list[tuple[AnyRecord, ...]] = []
    until(lambda: bool(batches.append(play.runtime.scheduler.take_trace()) or len(batches) == 50))
    play.stop()
    assert all(len(msgspec.json.encode(each)) < 32_000 for each in batches)
    lost = [batch[-1] for batch in batches if batch and isinstance(batch[-1], RecordsLost)]
    assert lost
    assert all(isinstance(each, RecordsLost) and each.blocks[1] in ("loop", "c") for each in lost)
    assert all(each.count > 0 for each in lost)
    assert sum(isinstance(each, RecordsLost) for batch in batches for each in batch) == len(lost)


def test_records_after_a_loss_are_recorded_again() -> None:
    trace = Trace(lambda: 0.0, max_bytes=200)
    for index in range(5):
        trace.began(1, f"{index}")
    assert trace.take({1: "4"}) == (
        BlockBegan(0.0, 1, "0"), BlockBegan(0.0, 1, "1"), RecordsLost(0.0, 3, {1: "4"}),
    )  # fmt: skip
    trace.began(1, "5")
    assert trace.take({1: "5"}) == (BlockBegan(0.0, 1, "5"),)
    trace.began(1, "x" * 1000)
    assert trace.take({1: "x"}) == (RecordsLost(0.0, 1, {1: "x"}),)


def test_estimated_size_is_an_upper_bound() -> None:
    trace = Trace(lambda: 86_400.123456, max_bytes=10_000)
    for index in range(1000):
        trace.began(1000 + index, "🤖" * (index % 30))
    records = trace.take({})[:-1]
    assert len(msgspec.json.encode(records)) <= 10_000


def test_running_blocks_follow_the_trace() -> None:
    running = RunningBlocks()
    running.apply([BlockBegan(0.0, 2, "b"), BlockBegan(0.0, 1, "a"), BlockBegan(0.1, 2, "c")])
    assert (running.blocks, running.begun) == (("a", "c"), {"a", "b", "c"})
    running.apply([BlockEnded(0.2, 1, "a"), BlockWaiting(0.2, 2, "c", "time")])
    assert running.blocks == ("c",)
    running.apply([RecordsLost(0.3, 7, {1: "d", 3: "d"})])
    assert (running.blocks, running.begun) == (("d",), {"a", "b", "c", "d"})
    running.apply([BlockEnded(0.4, 1, "d", "stopped"), BlockEnded(0.4, 3, "d", "canceled")])
    assert running.blocks == ("d",)


def test_every_record_is_encoded_as_an_array_and_decoded() -> None:
    records: tuple[AnyRecord, ...] = (
        BlockBegan(0.5, 1, "a"), BlockEnded(0.5, 1, "a", "failed", "ouch", "b"),
        BlockWaiting(0.5, 1, "a", "robot"),
        BlockInterrupted(0.5, 1, "a", "replaced"), BlockResumed(0.5, 1, "a"),
        BlockSkipped(0.5, 1, "a", "unknown_remainder"), RecordsLost(0.5, 3, {1: "a"}),
    )  # fmt: skip
    event = BlocksTraced(records=records)
    line = msgspec.json.encode(event)
    assert line.startswith(b'{"is":"trace","records":[["began",0.5,1,"a"],["ended"')
    assert msgspec.json.decode(line, type=AnyEvent) == event
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(line.replace(b'"robot"', b'"dance"'), type=AnyEvent)


def test_question_and_broadcast_are_waits() -> None:
    asking = threading.Event()
    ask = block("asking_ask", "q", QUESTION=text("Name?"))
    send = block("events_broadcast_wait", "b", NAME="go")
    receiver = stack(block("events_received", NAME="go"), wait("w", 0.01))
    program = compile_behaviour(workspace(started(ask, send), receiver), [])
    play = Play(program, asked=lambda question: asking.set()).start()
    assert asking.wait(60)
    play.runtime.questions.set_answer(1, "Ada")
    play.end()
    records = traced(play, lambda records: sum(isinstance(each, BlockEnded) for each in records) == 2)
    waits = {each.block: each.cause for each in records if isinstance(each, BlockWaiting)}
    assert waits == {"q": "answer", "b": "broadcast", "w": "time"}


def test_script_that_another_one_stops_is_canceled() -> None:
    saved = workspace(started(wait("w", 1000)), started(wait("x", 0.01), block("control_stop_others", "o")))
    play = Play(compile_behaviour(saved, [])).start().end()
    records = traced(play, lambda records: sum(isinstance(each, BlockEnded) for each in records) == 2)
    assert {each.block: each.cause for each in records if isinstance(each, BlockEnded)} == {
        "w": "canceled",
        "o": "",
    }


def test_slow_motion_is_recorded_as_a_wait() -> None:
    scheduler = Scheduler(VirtualClock(0.0))
    scheduler.set_pace(0.5)

    def body() -> None:
        scheduler.start_run()
        scheduler.step("a")
        scheduler.step("b")

    scheduler.start("s", body).join(60)
    assert scheduler.take_trace() == (
        BlockBegan(0.0, 1, "a"), BlockWaiting(0.0, 1, "a", "pace"), BlockBegan(0.5, 1, "b"),
        BlockWaiting(0.5, 1, "b", "pace"), BlockEnded(1.0, 1, "b"),
    )  # fmt: skip
