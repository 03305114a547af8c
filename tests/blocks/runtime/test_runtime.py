from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
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


def begin(saved, link: FakeLink | None = None, *, paused: bool = False) -> Play:
    pepper = robot()
    return Play(compile_behaviour(saved, [pepper]), (pepper,), link).start(paused=paused)


@pytest.fixture
def running():
    """Function that starts programs; they are stopped after the test."""
    begun: list[Play] = []

    def start(saved, link: FakeLink | None = None, *, paused: bool = False) -> Play:
        begun.append(begin(saved, link, paused=paused))
        return begun[-1]

    yield start
    for run in begun:
        run.stop()


# ---- robots


def test_block_waits_for_its_robot(running):
    link = FakeLink()
    link.held = {"turn"}
    turn = block("robot_pepper_do_turn", "t", ROBOT="Pepper", DIRECTION="left", ANGLE=number(30))
    run = running(workspace(started(turn, say("done"))), link)
    until(lambda: bool(link.calls))
    assert link.invoked == [("Pepper", "turn", {"direction": "left", "angle": 30})]
    assert run.runtime.scheduler.snapshot().blocks == ("t",)
    assert run.runtime.status_text.text(["t"]) == "Pepper turns left by 30°"
    link.answer(link.calls[0], "succeeded")
    run.end()
    assert link.invoked[1] == ("Pepper", "say", {"text": "done"})


def test_status_text_of_running_action_remains_when_another_script_ends(running):
    link = FakeLink()
    link.held = {"say"}
    words = block("values_join", A=text("Touch my "), B=text("head."))
    other = block("robot_pepper_do_light", "l", ROBOT="Pepper", WHERE="eyes", COLOUR="#37b6ff")
    run = running(workspace(started(say(words) | {"id": "x"}), started(other)), link)
    until(lambda: len(link.calls) == 2)
    # The other script ends in the meantime and must not clear the status text.
    until(lambda: run.runtime.scheduler.snapshot().blocks == ("x",))
    assert run.runtime.status_text.text(["x"]) == "Pepper says “Touch my head.”"
    link.answer(next(call for call in link.calls if call.action == "say"), "succeeded")
    run.end()
    assert run.runtime.status_text.text(["l"]) == "Pepper light eyes #37b6ff"


def test_failed_action_is_reported_on_its_block_with_robot_message():
    link = FakeLink()
    link.answers = {"say": ("failed", {}, "the speaker is off")}
    run = play(workspace(started(say("Hi") | {"id": "x"}, write(text("never")))), link)
    assert run.runtime.error is not None
    assert (run.runtime.error.block, run.runtime.error.sentence) == ("x", "Pepper: the speaker is off.")
    assert run.lines == []


def test_canceled_action_is_not_an_error():
    link = FakeLink()
    link.answers = {"say": ("canceled", {}, "")}
    run = play(workspace(started(say("Hi"), write(text("after")))), link)
    assert (run.runtime.error, run.lines) == (None, ["after"])


def test_robot_that_does_not_reply_is_named(monkeypatch):
    monkeypatch.setattr("app.robots.client.limits.FIRST_REPLY_TIMEOUT_S", 0.05)
    link = FakeLink()
    link.answers = {"say": ("sent", {}, "")}
    run = play(workspace(started(say("Hi") | {"id": "x"})), link)
    assert run.runtime.error is not None
    assert run.runtime.error.block == "x"
    assert run.runtime.error.sentence == "Pepper isn't responding. Start the virtual robot again."


def test_action_that_never_ends_is_canceled(monkeypatch):
    monkeypatch.setattr("app.robots.client.limits.ACTION_MARGIN_S", -29.95)
    link = FakeLink()
    link.held = {"say"}
    run = play(workspace(started(say("Hi"))), link)
    assert run.runtime.error is not None
    assert run.runtime.error.sentence == "Pepper didn't finish “say” within 30 s."
    assert link.canceled == link.calls


def test_values_are_converted_to_parameter_type():
    score = block(
        "variables_set", VAR={"id": "n"}, VALUE=block("values_arithmetic", A=number(1), SIGN="/", B=number(2))
    )
    listen = block("robot_pepper_do_listen", ROBOT="Pepper", WORDS=text("yes, no ,maybe"))
    link = FakeLink()
    link.answers = {"listen": ("succeeded", {"word": "no"}, "")}
    run = play(
        workspace(started(score, say(get("n")), say(boolean(True)), write(listen)), variables=("n",)), link
    )
    assert [given for _, _, given in link.invoked] == [
        {"text": "0.5"},
        {"text": "yes"},
        {"words": ["yes", "no", "maybe"]},
    ]
    assert run.lines == ["no"]


def test_computed_input_is_validated_before_invoking_robot():
    far = block("values_arithmetic", A=number(400), SIGN="*", B=number(2))
    link = FakeLink()
    run = play(workspace(started(block("robot_pepper_do_turn", ROBOT="Pepper", ANGLE=far))), link)
    assert run.runtime.error is not None
    assert run.runtime.error.sentence == "Pepper can't do this: turn: angle must be between 0 and 360 °."
    assert link.invoked == []


def test_unknown_value_as_action_input_is_an_error():
    run = play(workspace(started(say(block("messages_newest", FIELD="name", TOPIC="/faces")))))
    assert run.runtime.error is not None
    assert run.runtime.error.sentence == "Can't run “say”: the value for “text” isn't known yet."


def test_sensor_values_and_fields_are_read(running):
    link = FakeLink()
    link.sensors = {("Pepper", "battery"): 84, ("Pepper", "pose"): {"x": 0.5, "y": 2.0}}
    run = play(
        workspace(
            started(
                write(block("robot_pepper_get_battery", ROBOT="Pepper")),
                write(block("robot_pepper_get_pose", ROBOT="Pepper", FIELD="y")),
            )
        ),
        link,
    )
    assert run.lines == ["84", "2"]


def test_script_waits_for_first_sensor_value(running):
    link = FakeLink()
    run = running(workspace(started(write(block("robot_pepper_get_battery", ROBOT="Pepper")))), link)
    until(lambda: run.runtime.scheduler.snapshot().blocks != ())
    link.sensors["Pepper", "battery"] = 50
    link.on_change()
    run.end()
    assert run.lines == ["50"]


def test_program_ends_when_another_program_stops_the_robot(running):
    link = FakeLink()
    link.held = {"say"}
    run = running(workspace(started(say("Hi"), say("again"))), link)
    until(lambda: bool(link.calls))
    link.on_external_stop("Pepper")
    run.end()
    assert run.runtime.error is not None
    assert run.runtime.error.sentence == "Pepper was stopped by another program, so the behaviour ended."
    assert len(link.calls) == 1


# ---- event blocks


def test_matching_event_starts_its_script_each_time(running):
    hat = block("robot_pepper_when_touched", ROBOT="Pepper", PLACE="head")
    run = running(workspace(stack(hat, write(text("ouch")))))
    for data in ({"place": "head", "down": True}, {"place": "head", "down": False}, {"place": "left_hand"}):
        run.link.happen(("Pepper", "touched"), data)
    until(lambda: run.lines == ["ouch"])
    run.link.happen(("Pepper", "touched"), {"place": "HEAD ", "down": True})
    until(lambda: run.lines == ["ouch", "ouch"])
    assert not run.runtime.finished.is_set()


def test_messages_start_their_script_in_order_with_payload(running):
    hat = block("events_message", TOPIC="/x")
    name = block("messages_field", FIELD="name")
    run = running(workspace(stack(hat, write(name), write(block("messages_message")))))
    for who in ("Ada", "Bo"):
        run.link.happen("/x", {"name": who})
    until(lambda: len(run.lines) == 4)
    assert run.lines == ["Ada", '{"name": "Ada"}', "Bo", '{"name": "Bo"}']


def test_skipped_events_of_slow_script_are_counted(running):
    link = FakeLink()
    link.held = {"say"}
    run = running(workspace(stack(block("events_message", TOPIC="/x"), say("Hi"))), link)
    link.happen("/x", 0)
    until(lambda: bool(link.calls))
    for each in range(20):
        link.happen("/x", each)
    link.held.clear()
    link.answer(link.calls[0], "succeeded")
    link.on_change()
    until(lambda: len(link.calls) == 17)
    until(
        lambda: run.lines == ["“when a message arrives on /x” couldn't keep up: 4 of its events were skipped"]
    )


def test_condition_starts_script_only_on_change_to_true(running):
    low = block(
        "values_compare",
        A=block("messages_newest", FIELD="value", TOPIC="/level"),
        RELATION="<",
        B=number(20),
    )
    run = running(workspace(stack(block("events_becomes_true", CONDITION=low), write(text("low")))))
    for value, lines in ((50, 0), (10, 1), (5, 1), (30, 1), (15, 2)):
        run.link.topics["/level"] = value
        until(lambda lines=lines: len(run.lines) == lines)
        seen = len(run.lines)
        # After more checks of the condition, the script must not have run again.
        waited = [0]
        run.runtime.scheduler.wake_scripts()
        until(lambda waited=waited: waited.__setitem__(0, waited[0] + 1) or waited[0] > 25)
        assert len(run.lines) == seen == lines


def test_sensor_change_and_sensor_threshold_start_scripts(running):
    changes = block("robot_pepper_changes", ROBOT="Pepper", SENSOR="battery")
    passes = block("robot_pepper_passes", ROBOT="Pepper", SENSOR="battery", SIDE="below", LIMIT=20)
    run = running(workspace(stack(changes, write(text("new"))), stack(passes, write(text("low")))))
    expected: list[str] = []
    for value, more in (
        (50, []),
        (50, []),
        (40, ["new"]),
        (19, ["low", "new"]),
        (18, ["new"]),
        (30, ["new"]),
    ):
        run.link.happen(("Pepper", "battery"), value)
        expected += more
        until(lambda expected=tuple(expected): sorted(run.lines) == sorted(expected))


def test_scripts_run_concurrently(running):
    link = FakeLink()
    link.held = {"say"}
    run = running(workspace(started(say("slow")), started(write(text("1")), write(text("2")))), link)
    until(lambda: run.lines == ["1", "2"])
    assert not run.runtime.finished.is_set()
    until(lambda: bool(link.calls))
    link.answer(link.calls[0], "succeeded")
    run.end()


def test_concurrent_variable_changes_are_not_lost():
    change = block("variables_change", VAR={"id": "n"}, BY=number(1))
    loops = [started(block("control_repeat", TIMES=number(300), BODY=[dict(change)])) for _ in range(3)]
    run = play(workspace(*loops, variables=("n",)))
    assert run.runtime.error is None
    assert run.names["n"] == 900


# ---- control


def test_while_loop_if_else_and_stop_blocks_run():
    count = block("variables_change", VAR={"id": "n"}, BY=number(1))
    below = block("values_compare", A=get("n"), RELATION="<", B=number(3))
    loop = block("control_while", MODE="while", CONDITION=below, BODY=[count])
    choose = block(
        "control_if_else", CONDITION=boolean(False), BODY=[write(text("no"))], ELSE=[write(get("n"))]
    )
    run = play(workspace(started(loop, choose, block("control_stop_script")), variables=("n",)))
    assert run.lines == ["3"]


def test_stop_behaviour_ends_all_scripts():
    forever = block("control_forever", BODY=[])
    run = play(workspace(started(forever), started(block("control_stop_program"))))
    assert run.runtime.error is None


def test_empty_endless_loop_can_be_stopped(running):
    run = running(workspace(started(block("control_forever", "loop", BODY=[]))))
    until(lambda: run.runtime.scheduler.snapshot().blocks == ("loop",))
    run.stop()
    run.end()


def test_wait_until_treats_unknown_value_as_false(running):
    value = block("messages_newest", FIELD="value", TOPIC="/level")
    above = block("values_compare", A=value, RELATION=">", B=number(3))
    run = running(workspace(started(block("control_wait_until", CONDITION=above), write(text("there")))))
    until(lambda: run.runtime.scheduler.snapshot().blocks != ())
    assert run.lines == []
    run.link.topics["/level"] = {"value": 4}
    run.end()
    assert (run.lines, run.runtime.error) == (["there"], None)


# ---- errors


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        (block("values_arithmetic", "v", A=number(1), SIGN="/", B=number(0)), "“÷” can't divide by 0."),
        (
            block("values_compare", "v", A=text("a"), RELATION="<", B=number(0)),
            "“is below” doesn't work with a number and a text.",
        ),
        (
            block(
                "values_compare",
                "v",
                A=block("messages_newest", FIELD="x", TOPIC="/x"),
                RELATION="<",
                B=number(0),
            ),
            "“is below” can't run: one of its values isn't known yet.",
        ),
        (
            block("values_arithmetic", "v", A=text("a"), SIGN="+", B=text("b")),
            "“+” needs numbers, not text.",
        ),
        (
            block("values_arithmetic", "v", A=number(-8), SIGN="**", B=number(0.5)),
            "“to the power of” has no result for these numbers.",
        ),
        (block("values_round", "v", HOW="round", NUMBER=text("x")), "“round” needs a number, not a text."),
    ],
)
def test_error_in_value_block_names_value_block(value, sentence):
    outer = block("values_join", A=text("is "), B=value)
    run = play(workspace(started(write(outer))))
    assert run.runtime.error is not None
    assert (run.runtime.error.block, run.runtime.error.sentence) == ("v", sentence)


def test_error_in_statement_names_statement_block():
    wait = block("control_wait", "w", SECONDS=text("long"))
    run = play(workspace(started(block("control_repeat", TIMES=number(1), BODY=[wait]))))
    assert run.runtime.error is not None
    assert (run.runtime.error.block, run.runtime.error.sentence) == (
        "w",
        "“wait” needs a number, not a text.",
    )


def test_paused_program_executes_one_block_per_step(running):
    run = running(workspace(started(*(write(text(f"{n}")) | {"id": f"w{n}"} for n in range(3)))), paused=True)
    scheduler = run.runtime.scheduler
    for n in range(3):
        until(lambda: scheduler.snapshot().is_paused)
        assert scheduler.snapshot().next_block == f"w{n}"
        assert run.lines == [f"{done}" for done in range(n)]
        assert run.runtime.status_text.block_text(f"w{n}") == f"write “{n}” to the console"
        scheduler.step_once()
    run.end()
    assert run.lines == ["0", "1", "2"]
