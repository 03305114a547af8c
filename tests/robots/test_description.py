from __future__ import annotations

import copy
import json

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app import resources
from app.errors import DescriptionError
from app.robots.description.description import (
    Parameter,
    parse,
    parse_announcement,
    thing_description,
    topic_of,
    validate,
)
from app.robots.description.inputs import check_input, format_for_editing, parameter_of, parse_value
from nep.errors import NepError
from nep.messages.message import UNDECODED, Message
from nep.text import first_control
from tests.examples import examples

MODELS = sorted(resources.path("robots").glob("*.tm.jsonld"))


def model(name: str) -> dict[str, object]:
    return json.loads(resources.path("robots", f"{name}.tm.jsonld").read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_shipped_thing_models_and_their_descriptions_are_valid(path):
    document = json.loads(path.read_text(encoding="utf-8"))
    assert validate(document) == ()
    described = thing_description(document, "My robot")
    assert validate(described) == ()
    robot = parse(described)
    assert robot.name == "My robot"
    assert {action.name for action in robot.actions} == set(document["actions"])
    assert all(action.text.count("%robot") == 1 for action in robot.actions)
    assert json.loads(json.dumps(described)) == described


def test_description_has_topics_derived_from_the_robot_name():
    robot = parse(thing_description(model("pepper"), "Miss Pepper"))
    assert robot.topics.command == "/Miss_Pepper/command"
    assert robot.topics.reply == "/Miss_Pepper/answer"
    assert robot.topics.state == "/Miss_Pepper/state"
    assert robot.sensor("camera").topic == "/Miss_Pepper/camera"
    assert robot.sensor("camera").is_image
    assert robot.event("touched").topic == "/Miss_Pepper/touched"
    assert topic_of("a/b {c}", "x") == "/a_b__c_/x"


def test_topics_are_read_from_the_forms():
    document = thing_description(model("pepper"), "Pepper")
    document["properties"]["camera"]["forms"] = [{"href": "nep:/elsewhere/eye"}]
    document["actions"]["say"]["forms"] = [{"href": "nep:/x/do", "rb:answer": "nep:/x/did"}]
    robot = parse(document)
    assert robot.sensor("camera").topic == "/elsewhere/eye"
    assert (robot.action("say").topic, robot.action("say").reply_topic) == ("/x/do", "/x/did")


def test_block_texts_units_and_categories_of_pepper_are_parsed():
    robot = parse(thing_description(model("pepper"), "Pepper"))
    texts = {action.name: action.text for action in robot.actions}
    assert texts["say"] == "%robot say %text"
    assert texts["turn"] == "%robot turn %direction by %angle °"
    assert texts["light"] == "%robot light %where %colour"
    assert texts["show_emotion"] == "%robot look %emotion for %seconds s"
    assert texts["wave"] == "%robot wave %hand hand"
    assert robot.sensor("sees_face").text == "%robot sees a face"
    assert robot.sensor("battery").text == "%robot battery"
    assert robot.event("touched").text == "when %robot %place is touched"
    assert robot.event("touched").fields[0].choices[0].title == "head"
    assert robot.action("turn").parameter("angle").unit == "°"
    assert {action.category for action in robot.actions} == {"Speech", "Movement", "Face and lights"}


def test_icons_of_every_shipped_thing_model_are_shipped_with_studio():
    text = resources.path("icons", "lucide.txt").read_text("utf-8")
    icons = {line.partition("\t")[0] for line in text.splitlines()}
    for path in MODELS:
        robot = parse(json.loads(path.read_text(encoding="utf-8")))
        for part in (*robot.actions, *robot.sensors, *robot.events):
            assert part.icon in icons, f"{path.stem}: {part.name}"


def test_safe_stop_is_read_from_the_description():
    robot = parse(model("pepper"))
    assert robot.safe_stop.action == "stop"
    assert (robot.safe_stop.watchdog_s, robot.safe_stop.within_s) == (1.0, 0.2)
    assert robot.safe_stop.can_confirm
    assert robot.virtual


def test_invalid_inputs_are_reported_with_readable_messages():
    robot = parse(model("pepper"))
    turn, say, light = robot.action("turn"), robot.action("say"), robot.action("light")
    assert turn.check({"angle": 400}) == ("turn: angle must be between -360 and 360 °",)
    assert turn.check({"angle": "x"}) == ("turn: angle must be a number",)
    assert turn.check({"angel": 3}) == ("turn: unknown name “angel”; did you mean “angle”?",)
    assert turn.check({"direction": "up"}) == ("turn: direction must be left or right",)
    assert turn.check([]) == ("turn: the input must be an object with named values",)
    assert say.check({}) == ("say: text is missing",)
    assert say.check({"text": ""}) == ("say: text must not be empty",)
    assert say.check({"text": "x" * 501}) == ("say: text must be at most 500 characters long",)
    assert say.check({"text": "x", "volume": 2.5}) == ("say: volume must be a whole number",)
    assert light.check({"colour": "red"}) == ("light: colour must be a colour such as #20c0e0",)
    assert turn.check({"angle": 90, "direction": "left"}) == ()
    assert turn.complete({"angle": 90}) == {"direction": "left", "angle": 90, "speed": 40.0}


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), True, None, 10**400, [1]])
def test_input_that_is_not_a_finite_number_is_rejected(wrong):
    assert parse(model("pepper")).action("turn").check({"angle": wrong}) == ("turn: angle must be a number",)


def broken(change) -> tuple[str, ...]:
    document = copy.deepcopy(model("pepper"))
    change(document)
    return validate(document)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d.pop("title"), "the description has no 'title'"),
        (lambda d: d.pop("actions"), "the description has no 'actions'"),
        (lambda d: d["actions"]["turn"].update({"rb:uses": ["wings"]}),
         "actions.turn.rb:uses names 'wings', which isn't in rb:resources"),
        (lambda d: d["actions"]["turn"].update({"rb:onBusy": "panic"}),
         "actions.turn.rb:onBusy must be one of queue, replace, reject"),
        (lambda d: d["actions"]["turn"]["input"]["properties"]["angle"].update(minimum="low"),
         "actions.turn.input.properties.angle.minimum must be a number"),
        (lambda d: d["actions"]["turn"]["input"]["properties"]["angle"].update(minimum=400),
         "actions.turn.input.angle: minimum 400 is greater than maximum 360"),
        (lambda d: d["actions"]["turn"]["input"]["properties"]["angle"].update(default=400),
         "actions.turn.input.angle: the default must be between -360 and 360 °"),
        (lambda d: d["actions"]["turn"]["rb:block"]["text"].update(en="turn %wings"),
         "actions.turn.rb:block.text.en uses %wings, which isn't defined"),
        (lambda d: d["events"]["touched"].update({"rb:filter": ["where"]}),
         "events.touched.rb:filter names 'where', which isn't in its data"),
        (lambda d: d["rb:safeStop"].update(action="halt"),
         "rb:safeStop.action names 'halt', which isn't an action"),
        (lambda d: d["rb:safeStop"].update(action="say"),
         "'say' is the safe stop, so its input must not have required fields"),
        (lambda d: d["actions"]["turn"]["input"].update({"$ref": "http://example.org"}),
         "actions.turn.input uses $ref, which isn't supported; write the definition inline"),
        (lambda d: d.update({"rb:profile": 2}), "rb:profile must be 1"),
        (lambda d: d["events"].update(state={}),
         ("'state' is reserved or used twice; each sensor and event needs a different name, "
          "because the name becomes a topic")),
    ],
)  # fmt: skip
def test_invalid_description_is_reported_with_a_message(change, sentence):
    assert sentence in broken(change)


def test_invalid_description_raises_an_error_with_all_problems():
    document = model("pepper")
    del document["rb:profile"], document["rb:safeStop"]
    with pytest.raises(DescriptionError) as caught:
        parse(document)
    assert len(caught.value.problems) == 2
    assert "the description of 'Pepper' can't be used" in str(caught.value)


def test_text_of_only_control_characters_is_reported_as_empty():
    document = copy.deepcopy(model("pepper"))
    document["properties"]["sees_ball"]["rb:block"]["category"] = "\x08"
    assert validate(document) == ("properties.sees_ball.rb:block.category must not be empty",)


# ---- untrusted input is validated, never crashes ---------------------------------------------------

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=8,
)


def places(value: object, path: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
    found = [path] if path else []
    if isinstance(value, dict):
        for key, item in value.items():
            found += places(item, (*path, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            found += places(item, (*path, index))
    return found


PLACES = places(model("pepper"))


@settings(max_examples=examples(300), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(st.sampled_from(PLACES), json_values), min_size=1, max_size=3))
def test_corrupt_description_never_crashes(changes):
    document = copy.deepcopy(model("pepper"))
    for path, value in changes:
        target = document
        try:
            for step in path[:-1]:
                target = target[step]
            target[path[-1]] = value
        except (KeyError, IndexError, TypeError):
            continue
    problems = validate(document)
    assert all(isinstance(sentence, str) and sentence for sentence in problems)
    if problems:
        with pytest.raises(DescriptionError):
            parse(document)
    else:
        robot = parse(thing_description(document, "X"))
        for action in robot.actions:
            action.check({})
            action.check({parameter.name: 10**400 for parameter in action.parameters})


@settings(max_examples=examples(200), deadline=None)
@given(json_values)
def test_arbitrary_json_is_reported_as_invalid_description(value):
    assert validate(value) != ()


@settings(max_examples=examples(100), deadline=None)
@given(st.dictionaries(st.text(max_size=8), json_values, max_size=4))
def test_arbitrary_input_is_checked_without_crash(value):
    for action in parse(model("pepper")).actions:
        assert all(sentence.startswith(action.name) for sentence in action.check(value))


# ---- lists and objects entered as text -------------------------------------------------------------


def parameter(**data: object) -> Parameter:
    return parameter_of("values", data)


NUMBERS = {"type": "array", "items": {"type": "number"}}


@pytest.mark.parametrize(
    ("described", "words", "value"),
    [
        (NUMBERS, "1, 2.5, 0.0, 0", [1, 2.5, 0.0, 0]),
        (NUMBERS, "1, far", [1, "far"]),
        (NUMBERS, "1,2,3", [1, 2, 3]),
        (NUMBERS, "1; 2,5; -0,2", [1, 2.5, -0.2]),
        (NUMBERS, "1.234,5; 2", ["1.234.5", 2]),
        (NUMBERS, "0,2, 0,5", "0,2, 0,5"),
        ({"type": "array"}, "a;b, c", ["a;b", "c"]),
        (NUMBERS, "", []),
        (NUMBERS, "[1, 2]", [1, 2]),
        ({"type": "array"}, "a, b", ["a", "b"]),
        ({"type": "array", "items": {"type": "boolean"}}, "yes, false, x", [True, False, "x"]),
        ({"type": "array", "items": {"oneOf": [{"const": 1, "title": "low"}]}}, "low, 1", [1, 1]),
        ({"type": "array", "items": [{"type": "number"}, {"type": "string"}]}, "1, 2, 3", [1, "2", "3"]),
        ({"type": "array", "items": NUMBERS}, "[[1], [2, 3]]", [[1], [2, 3]]),
        ({"type": "object"}, '{"x": 1}', {"x": 1}),
        ({"type": "object"}, "{x", "{x"),
        ({"type": "object"}, "[" * 100_000, "[" * 100_000),
    ],
)
def test_entered_text_is_parsed_to_a_list_or_object(described, words, value):
    made = parse_value(parameter(**described), words)
    assert made == value
    assert repr(made) == repr(value)  # repr distinguishes 1 from 1.0 and True


@pytest.mark.parametrize("value", [["a", "b"], [1, 2.5], [["x"], []], {"a": {"b": 1}}, ["a, b"], [" "]])
def test_formatted_list_or_object_parses_back_to_the_same_value(value):
    strings = isinstance(value, list) and all(isinstance(item, str) for item in value)
    described = {"type": "object" if isinstance(value, dict) else "array"}
    if isinstance(value, list) and not strings:
        described = NUMBERS if not isinstance(value[0], list) else {"type": "array", "items": NUMBERS}
    assert parse_value(parameter(**described), format_for_editing(value)) == value


@pytest.mark.parametrize(
    ("described", "value", "wrong"),
    [
        (NUMBERS, [1, "a"], "value 2 must be a number"),
        ({**NUMBERS, "minItems": 2}, [1], "must have at least 2 values"),
        ({**NUMBERS, "maxItems": 1}, [1, 2], "must have at most 1 value"),
        ({"type": "array"}, [object()], "value 1 can't be an item of a list"),
        ({"type": "array", "items": NUMBERS}, [[1], ["b"]], "value 2 value 1 must be a number"),
        ({"type": "object", "additionalProperties": {"type": "integer"}}, {"a": 1.5},
         "“a” must be a whole number"),
        ({"type": "number", "rb:nullable": True}, None, None),
    ],
)  # fmt: skip
def test_list_items_and_object_fields_are_validated(described, value, wrong):
    sentences = check_input("go", (parameter(**described),), {"values": value})
    assert sentences == (() if wrong is None else (f"go: values {wrong}",))


# ---- announced descriptions ------------------------------------------------------------------------


def message_of(data: bytes, codec: str = "json") -> Message:
    return Message("/Pepper/description", data, codec, "robot/description")


def test_announced_description_is_parsed():
    described = json.dumps(thing_description(model("pepper"), "Pepper")).encode()
    assert parse_announcement(message_of(described)).name == "Pepper"


@pytest.mark.parametrize(
    "data",
    [b"[" * 400_000 + b"]" * 400_000, b'{"a":' * 150_000 + b"1" + b"}" * 150_000, b"7", b"{", b"",
     b'{"title": "x"}', b'{"x": ' + b'{"a":' * 900 + b"1" + b"}" * 901],
    ids=["list", "object", "number", "half", "nothing", "no robot", "deep"],
)  # fmt: skip
def test_malformed_or_deeply_nested_announcement_raises_an_error(data):
    with pytest.raises((DescriptionError, NepError)):
        parse_announcement(message_of(data))


def test_huge_description_is_rejected_before_decoding():
    described = thing_description(model("pepper"), "Pepper")
    described["description"] = "x" * 1_000_000
    message = message_of(json.dumps(described).encode())
    with pytest.raises(DescriptionError, match="it is 1\\.0 MB in size; the limit is 1 MB"):
        parse_announcement(message)
    assert message.decoded is UNDECODED


def test_description_with_too_many_values_is_rejected_without_validation():
    """Its validation blocked the window, and with it the Stop button, for six seconds."""
    described = thing_description(model("pepper"), "Pepper")
    described["actions"] = {f"do {number}": {"title": number} for number in range(25_000)}
    with pytest.raises(DescriptionError, match="the description has more than 20000 values"):
        parse_announcement(message_of(json.dumps(described).encode()))


def test_number_of_reported_problems_is_limited():
    described = thing_description(model("pepper"), "Pepper")
    described["actions"] = {f"do {number}": {} for number in range(3000)}
    assert len(validate(described)) <= 20


@pytest.mark.parametrize("name", ["Arm\n", "Arm\u202e", "A\u200brm", "\x1b[2J"])
def test_robot_name_with_control_characters_is_rejected_with_an_escaped_message(name):
    described = {**thing_description(model("pepper"), "Pepper"), "title": name}
    with pytest.raises(DescriptionError, match=r"title: '.*' can't be used in a name") as refused:
        parse(described)
    assert first_control(str(refused.value)) == ""


def test_control_characters_are_removed_from_texts_of_a_description():
    """A character that reverses the writing direction would also reverse a question around the text."""
    described = thing_description(model("pepper"), "Pepper")
    say = described["actions"]["say"]
    say["title"] = "\u202esay\n"
    say["rb:block"] = {**say["rb:block"], "text": {"en": "s\u200bay\x1b %text"}, "category": "\u202eSpeech"}
    words = say["input"]["properties"]["text"]
    words |= {"title": "te\u2066xt", "description": "a\nb", "default": "a\n\u202eb"}
    action = parse(described).action("say")
    assert (action.title, action.category) == ("say ", "Speech")
    assert first_control(action.text) == ""
    assert action.parameters[0].title == "text"
    assert action.parameters[0].default == "a\n\u202eb"


def test_description_error_message_is_short_and_escaped():
    described = {**thing_description(model("pepper"), "Pepper"), "title": "\x1b" + "A" * 100_000}
    described["actions"] = {"B" * 100_000: {"rb:block": 7}}
    with pytest.raises(DescriptionError) as refused:
        parse(described)
    assert len(str(refused.value)) < 600
    assert first_control(str(refused.value)) == ""
