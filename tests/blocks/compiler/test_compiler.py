from __future__ import annotations

import ast
from dataclasses import replace

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Program
from app.blocks.model.workspace import parse_workspace
from app.intents import AddTimeLimit, ConnectRobot
from tests.blocks.fakes import play
from tests.blocks.samples import (
    block,
    boolean,
    get,
    nao,
    number,
    robot,
    say,
    stack,
    started,
    text,
    workspace,
    write,
)


def picture() -> dict[str, object]:
    """Return the workspace of the example behaviour with three scripts."""
    return workspace(
        started(
            block("robot_pepper_do_light", ROBOT="Pepper", WHERE="eyes", COLOUR="#37B6FF"),
            say("Hello! I am Pepper."),
            block("control_wait_until", "w", CONDITION=block("robot_pepper_get_sees_face", ROBOT="Pepper")),
            block(
                "control_repeat",
                TIMES=number(3),
                BODY=[
                    block("robot_pepper_do_turn", "t", ROBOT="Pepper", DIRECTION="left", ANGLE=number(30)),
                    say("Touch my head."),
                    block("control_wait", "s", SECONDS=number(2)),
                ],
            ),
        ),
        stack(
            block("robot_pepper_when_touched", ROBOT="Pepper", PLACE="head"),
            say(block("messages_newest", FIELD="name", TOPIC="/faces")),
            block("robot_nao_do_wave", "n", ROBOT="NAO", HAND="right"),
        ),
        stack(
            block("events_message", TOPIC="/blackboard"),
            block(
                "control_if",
                CONDITION=block(
                    "values_compare",
                    RELATION="<",
                    A=block("robot_pepper_get_battery", ROBOT="Pepper"),
                    B=number(20),
                ),
                BODY=[
                    say("I need a rest."),
                    block("messages_publish", VALUE=text("tired"), TOPIC="/blackboard"),
                ],
            ),
        ),
    )


def test_generated_program_is_readable():
    program = compile_behaviour(picture(), [robot()], absent=[nao()], name="Greeting")
    imports, _, rest = program.source.partition("\n\n\n")
    rest = rest.replace("lambda :", "lambda:")  # Python 3.10 writes `lambda :`
    assert imports.startswith("from app.blocks.commands import newest, on_message, on_start, ")
    assert (
        rest
        == """@on_start
def when_started():
    robot('Pepper').do('light', where='eyes', colour='#37b6ff')
    robot('Pepper').do('say', text='Hello! I am Pepper.')
    wait_until(lambda: robot('Pepper').get('sees_face'))
    for _ in repeat(3):
        robot('Pepper').do('turn', direction='left', angle=30)
        robot('Pepper').do('say', text='Touch my head.')
        wait(2)


@robot('Pepper').on('touched', place='head')
def when_pepper_head_is_touched():
    robot('Pepper').do('say', text=newest('/faces', 'name'))


@on_message('/blackboard')
def when_a_message_arrives_on_blackboard(message):
    if robot('Pepper').get('battery') < 20:
        robot('Pepper').do('say', text='I need a rest.')
        publish('/blackboard', 'tired')


run('Greeting')
"""
    )
    assert program.lines[8] == "w"
    assert program.lines[10] == "t"
    assert "step" not in program.source
    assert program.robots == ("Pepper",)
    assert set(program.sensors) == {("Pepper", "sees_face"), ("Pepper", "battery")}
    assert program.events == (("Pepper", "touched"),)
    assert program.publishes == ("/blackboard",)
    assert set(program.listens) == {"/faces", "/blackboard"}
    assert program.readings["s"] == "wait 2 s"
    assert program.readings["t"] == "Pepper turn left by 30 °"


def test_absent_robot_and_missing_time_limit_are_reported_as_problems():
    program = compile_behaviour(picture(), [robot()], absent=[nao()])
    first, second = program.problems
    assert (first.severity, first.block_id, first.category, first.icon) == ("warning", "n", "robot", "hand")
    assert (first.subject, first.message) == ("wave", "NAO isn't connected, so wave will be skipped.")
    assert (first.fix, first.fix_action) == ("Show the robots", ConnectRobot("NAO"))
    assert (second.severity, second.block_id, second.category) == ("info", "w", "control")
    assert second.message == "wait until waits forever if no one appears."
    assert (second.subject, second.fix, second.fix_action) == (
        "wait until",
        "Add a time limit",
        AddTimeLimit("w"),
    )


def sentences(saved, robots=None) -> list[tuple[str, str]]:
    program = compile_behaviour(saved, [robot()] if robots is None else robots)
    ast.parse(program.source)
    return [(problem.severity, problem.message) for problem in program.problems]


def test_robot_never_seen_before_is_named_in_problem():
    saved = workspace(started(block("robot_nao_do_wave", ROBOT="NAO", HAND="left"), say("Hi")))
    assert sentences(saved) == [("warning", "NAO isn't connected, so wave will be skipped.")]
    assert play(saved).link.invoked == [("Pepper", "say", {"text": "Hi"})]


def test_unknown_block_is_skipped_with_warning():
    saved = workspace(started(block("magic_wave_wand"), say("Hi")))
    assert sentences(saved) == [
        (
            "warning",
            (
                "“magic wave wand” belongs to another program and can't run here. "
                "It stays in the file but is skipped."
            ),
        )
    ]
    assert play(saved).link.invoked == [("Pepper", "say", {"text": "Hi"})]


def test_block_with_sensor_of_absent_robot_is_skipped_entirely():
    condition = block("robot_nao_get_battery", ROBOT="NAO")
    saved = workspace(started(block("control_if", CONDITION=condition, BODY=[say("no")]), say("Hi")))
    assert sentences(saved) == [("warning", "NAO isn't connected, so if with battery will be skipped.")]
    assert play(saved).link.invoked == [("Pepper", "say", {"text": "Hi"})]


def test_all_blocks_of_absent_robot_are_listed_even_outside_scripts():
    inside = block("control_if", CONDITION=block("robot_nao_get_battery", ROBOT="NAO"),
                   BODY=[say("hidden", "NAO"), say("here")])  # fmt: skip
    loose = say("loose", "NAO")
    program = compile_behaviour(workspace(started(inside), loose), [robot()])
    types = {placed.id: placed for placed in parse_workspace(workspace(started(inside), loose)).all_blocks()}
    assert len(program.absent) == 3
    assert {types[id].fields["ROBOT"] for id in program.absent} == {"NAO"}
    assert not compile_behaviour(workspace(started(say("here"))), [robot()]).absent


def test_script_of_absent_robot_does_not_start():
    saved = workspace(stack(block("robot_nao_when_touched", ROBOT="NAO"), say("Hi")))
    found = sentences(saved)
    assert ("warning", "NAO isn't connected, so touched will be skipped.") in found
    assert compile_behaviour(saved, [robot()]).starts == 0


def test_action_missing_on_connected_robot_is_skipped_with_warning():
    saved = workspace(started(block("robot_pepper_do_say", ROBOT="NAO", TEXT=text("Hi"))))
    assert sentences(saved, [robot(), nao()]) == [("warning", "NAO can't do this, so say will be skipped.")]


@pytest.mark.parametrize(
    ("it", "sentence"),
    [
        (block("control_wait"), "wait needs a number. Drag one into its slot."),
        (block("control_if"), "if needs a condition. Drag one into its slot."),
        (
            block("robot_pepper_do_turn", ROBOT="Pepper", DIRECTION="left"),
            "turn needs a number. Drag one into its slot.",
        ),
        (block("messages_publish", TOPIC="/x"), "publish needs a value. Drag one into its slot."),
        (write(block("values_not")), "not needs a condition. Drag one into its slot."),
    ],
)
def test_empty_slot_is_an_error_and_ends_the_program_at_that_block(it, sentence):
    saved = workspace(started(say("before"), it, say("after")))
    assert sentences(saved) == [("error", sentence)]
    run = play(saved)
    assert run.link.invoked == [("Pepper", "say", {"text": "before"})]
    assert run.runtime.error is not None
    assert run.runtime.error.sentence == sentence
    assert run.runtime.error.block == compile_behaviour(saved, [robot()]).problems[0].block_id


def test_event_block_with_empty_slot_does_not_start():
    saved = workspace(stack(block("events_becomes_true"), say("Hi")), started())
    assert sentences(saved) == [("error", "when needs a condition. Drag one into its slot.")]
    assert compile_behaviour(saved, [robot()]).starts == 1


def test_input_outside_action_schema_is_an_error_before_run():
    turn = block("robot_pepper_do_turn", ROBOT="Pepper", DIRECTION="left", ANGLE=number(900))
    assert sentences(workspace(started(turn))) == [("error", "turn: angle must be between 0 and 360 °.")]
    assert sentences(workspace(started(say("")))) == [("error", "say: text must not be empty.")]


@pytest.mark.parametrize(
    ("it", "end"),
    [
        (block("messages_publish", VALUE=text("x"), TOPIC="two words"), "needs a topic name without spaces"),
        (
            block("robot_pepper_do_turn", ROBOT="Pepper", DIRECTION="up", ANGLE=number(1)),
            "has no option “up”",
        ),
        (block("robot_pepper_do_light", ROBOT="Pepper", WHERE="eyes", COLOUR="blue"), "needs a colour"),
        (write(number("three")), "needs a number"),
        (block("variables_set", VALUE=number(1)), "needs a variable"),
    ],
)
def test_block_with_invalid_field_value_is_an_error_with_its_reason(it, end):
    (problem,) = compile_behaviour(workspace(started(it)), [robot()]).problems
    assert problem.severity == "error"
    assert end in problem.message


def test_blocks_without_event_block_are_reported():
    saved = workspace(say("Hi"))
    assert sentences(saved) == [
        ("warning", "No event block starts these blocks, so they don't run. Put “when started” above them."),
        ("info", "say doesn't run. Put it below “when started”."),
    ]
    assert sentences(workspace()) == []
    assert [severity for severity, _ in sentences(workspace(started(), say("Hi")))] == ["info"]


def test_detached_value_block_is_reported():
    for value in (number(1), boolean(True), block("values_join", A=text("a"), B=text("b"))):
        ((severity, sentence),) = sentences(workspace(started(), value))
        assert severity == "info"
        assert sentence.endswith("isn't used. Drag it into an empty slot of another block.")


def test_message_block_outside_message_script_is_a_warning():
    saved = workspace(started(write(block("messages_message"))))
    assert sentences(saved) == [("warning", "message only works below “when a message arrives”.")]
    assert play(saved).lines == [""]


def test_user_disabled_block_is_skipped_but_block_marked_robot_absent_is_compiled():
    off = say("off") | {"enabled": False}
    manual = say("manual") | {"disabledReasons": ["MANUALLY_DISABLED"]}
    absent = say("on") | {"disabledReasons": ["robot absent"]}
    assert [each[2] for each in play(workspace(started(off, manual, absent))).link.invoked] == [
        {"text": "on"}
    ]


def test_shadow_block_is_used_until_replaced():
    shadow = {"shadow": number(7)}
    wait = block("control_wait") | {"inputs": {"SECONDS": shadow}}
    assert "wait(7)" in compile_behaviour(workspace(started(wait)), []).source
    both = block("control_wait") | {"inputs": {"SECONDS": shadow | {"block": number(8)}}}
    assert "wait(8)" in compile_behaviour(workspace(started(both)), []).source


def test_variable_names_are_kept_where_valid_in_python():
    names = ("score", "my score", "class", "wait", "点数", "ﬁt", "fit", "2nd", "")
    saved = workspace(
        started(*(block("variables_set", VAR={"id": name or "x"}, VALUE=number(1)) for name in names)),
        variables=names,
    )
    program = compile_behaviour(saved, [])
    assigned = [
        node.id
        for node in ast.walk(ast.parse(program.source))
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    ]
    assert len(set(assigned)) == len(names)
    assert {"score", "my_score", "点数", "fit", "fit_2"} <= set(assigned)
    assert not {"class", "wait"} & set(assigned)


def test_variable_is_set_changed_and_read_in_a_script():
    run = play(
        workspace(
            started(
                block("variables_set", VAR={"id": "score"}, VALUE=number(5)),
                block("variables_change", VAR={"id": "score"}, BY=number(2)),
                write(get("score")),
            ),
            variables=("score",),
        )
    )
    assert run.lines == ["7"]


def test_long_script_and_35_nested_blocks_compile_and_200_nested_blocks_are_an_error():
    long_ = compile_behaviour(workspace(started(*(say(f"{n}") for n in range(1500)))), [robot()])
    assert not long_.problems
    assert long_.source.count("'say'") == 1500

    deep = number(1)
    for _ in range(200):
        deep = block("values_not", A=deep)
    (problem,) = compile_behaviour(workspace(started(write(deep))), []).problems
    assert problem.severity == "error"
    assert "is nested too deeply" in problem.message

    allowed: dict[str, object] = number(1)
    for _ in range(35):
        allowed = block("values_round", HOW="up", NUMBER=allowed)
    assert play(workspace(started(write(allowed)))).lines == ["1"]

    loops: dict[str, object] = write(text("x"))
    for _ in range(35):
        loops = block("control_if", CONDITION=boolean(True), BODY=[loops])
    assert play(workspace(started(loops))).lines == ["x"]


def test_data_of_program_for_its_process_survives_json_round_trip():
    import json

    program = compile_behaviour(picture(), [robot()], name="Greeting")
    again = Program.from_json(json.loads(json.dumps(program.to_json())))
    assert again == replace(program, source="", lines={}, problems=(), absent=(), actions=None, starts=0)
    with pytest.raises((KeyError, TypeError)):
        Program.from_json({"name": "x"})


def test_invalid_workspace_compiles_to_empty_program():
    for nonsense in ({}, {"blocks": 3}, {"blocks": {"blocks": [1, {"type": 2}, None]}}, {"variables": "x"}):
        program = compile_behaviour(nonsense, [robot()])
        assert (program.starts, program.problems) == (0, ())
