from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from app import resources
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.definitions import editor_definitions
from app.robots.description.description import parse
from tests.blocks.fakes import FakeLink, Play, until

EXAMPLES = sorted(resources.path("examples").glob("*.nepb"))


def read(path):
    saved = json.loads(path.read_text("utf-8"))
    return saved, parse(saved["robots"]["Pepper"])


def test_examples_have_the_expected_names_and_descriptions():
    named = [(read(path)[0]["name"], read(path)[0]["description"]) for path in EXAMPLES]
    assert named == [
        ("Greeting", "Waves when it sees a face"),
        ("Reaction to touch", "Laughs when its head is touched"),
        ("Tour guide", "Walks to three stations and speaks"),
        ("A quiz", "Touch its head to answer “yes”"),
        ("A dance", "Sways and blinks, using functions"),
        ("A careful walk", "Walks while nothing is in its way"),
        ("The finder", "Looks for the ball and for a face"),
        ("Weather station", "Sends messages and reacts to them"),
    ]


# Words in a title or note, and the block types of which the example must use at least one.
CLAIMS = {
    r"\bwav(e|es|ing)\b": {"robot_pepper_do_wave"},
    r"\bface\b": {"robot_pepper_get_sees_face"},
    r"\bball\b": {"robot_pepper_get_sees_ball"},
    r"\btouch": {"robot_pepper_when_touched", "robot_pepper_get_head_touched"},
    r"\bwalk": {"robot_pepper_do_walk"},
    r"\b(turns?|sways?)\b": {"robot_pepper_do_turn"},
    r"\b(says?|speaks?|asks?|laughs?|tell)\b": {"robot_pepper_do_say"},
    r"\b(eyes|blinks?|colour|light)\b": {"robot_pepper_do_light"},
    r"\bfunctions?\b": {"functions_call"},
    r"\bmessages?\b": {"messages_publish_field"},
    r"\bin its way\b|\broom\b.*\bwalk|\bthere is room\b": {"robot_pepper_get_distance"},
    r"\b(listens?|hears?|microphone)\b": {"robot_pepper_when_hears"},
    r"\bbattery\b": {"robot_pepper_get_battery"},
    r"\bConsole\b": {"messages_write"},
}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_descriptions_and_notes_match_their_blocks(path):
    saved, _pepper = read(path)
    used = set(types(saved["workspace"]["blocks"]["blocks"]))
    (note,) = saved["workspace"]["workspaceComments"]
    for claim, needed in CLAIMS.items():
        if re.search(claim, f"{saved['description']}\n{note['text']}"):
            assert used & needed, (claim, saved["description"], note["text"])
    for robot in saved["robots"]:
        assert robot in note["text"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_note_has_description_and_two_tasks_with_existing_values(path):
    saved, _pepper = read(path)
    (note,) = saved["workspace"]["workspaceComments"]
    about, tries = note["text"].split("\n\nTry this:\n")
    assert about
    first, second = tries.split("\n")
    assert first.startswith("1. ")
    assert second.startswith("2. ")
    values = re.findall(r"instead of ([\d.]+)", tries)
    there = [
        block["fields"]["NUMBER"] for block in blocks(saved["workspace"]) if block["type"] == "values_number"
    ]
    for value in values:
        assert there.count(float(value)) == 1, f"{value} is there {there.count(float(value))} times"


def blocks(saved):
    if isinstance(saved, dict):
        if "type" in saved:
            yield saved
        for inner in saved.values():
            yield from blocks(inner)
    elif isinstance(saved, list):
        for inner in saved:
            yield from blocks(inner)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_compiles_without_problems_and_editor_knows_its_blocks(path):
    saved, pepper = read(path)
    assert (saved["format"], saved["version"]) == ("nep-behaviour", 1)
    program = compile_behaviour(saved["workspace"], [pepper], name=saved["name"])
    assert program.problems == ()
    assert program.starts > 0
    known = {definition["type"] for definition in editor_definitions([pepper])["blocks"]}
    assert set(types(saved["workspace"]["blocks"]["blocks"])) <= known


def types(saved):
    if isinstance(saved, dict):
        if "type" in saved:
            yield saved["type"]
        for inner in saved.values():
            yield from types(inner)
    elif isinstance(saved, list):
        for inner in saved:
            yield from types(inner)


def test_sample_behaviour_has_the_expected_problems():
    saved = json.loads(Path("tests/data/behaviours/picture-02.nepb").read_text("utf-8"))
    pepper, absent = (parse(saved["robots"][name]) for name in ("Pepper", "NAO"))
    program = compile_behaviour(saved["workspace"], [pepper], absent=[absent], name=saved["name"])
    assert [problem.message for problem in program.problems] == [
        "NAO isn't connected, so wave will be skipped.",
        "wait until waits forever if no one appears.",
    ]
    assert program.starts == 3


def run(number: int, link: FakeLink | None = None) -> tuple[Play, FakeLink]:
    saved, pepper = read(EXAMPLES[number])
    if link is None:
        link = FakeLink()
        link.sensors = {("Pepper", "sees_face"): True, ("Pepper", "distance"): 2.0}
    return Play(
        compile_behaviour(saved["workspace"], [pepper], name=saved["name"]), (pepper,), link
    ).start(), link


def said(link: FakeLink) -> list[object]:
    return [given["text"] for _, action, given in link.invoked if action == "say"]


def test_greeting_example_speaks_and_turns():
    play, link = run(0)
    play.end()
    assert play.runtime.error is None
    assert said(link) == ["Hello! I am Pepper.", "Nice to see you."]
    assert [action for _, action, _ in link.invoked].count("turn") == 4


def test_touch_reaction_example_counts_touches():
    play, link = run(1)
    until(lambda: len(said(link)) == 1)
    for times in (1, 2, 3):
        link.happen(("Pepper", "touched"), {"place": "head"})
        until(lambda times=times: said(link).count("Ha ha! That tickles.") == times)
    until(lambda: said(link)[-1] == "Number of touches: 3")
    link.happen(("Pepper", "touched"), {"place": "right_hand"})
    until(lambda: link.invoked[-1][1] == "turn")
    play.stop()
    play.end()
    assert play.runtime.error is None


def test_tour_guide_example_publishes_each_station():
    play, link = run(2)
    play.end()
    assert said(link)[-1] == "Thank you for coming."
    assert link.published == [("/tour", {"station": station}) for station in (1, 2, 3)]
    assert said(link)[1] == "This is station 1"
    assert play.runtime.error is None


def actions(link: FakeLink) -> list[str]:
    return [action for _, action, _ in link.invoked]


def test_quiz_example_counts_correct_answers():
    link = FakeLink()
    link.sensors[("Pepper", "head_touched")] = True  # always true
    play, link = run(3, link)
    play.end()
    assert play.runtime.error is None
    assert said(link)[-1] == "Right answers: 2 of 3"
    assert actions(link).count("show_emotion") == 3


def test_dance_example_calls_its_functions():
    play, link = run(4)
    play.end()
    assert play.runtime.error is None
    turns = [given["angle"] for _, action, given in link.invoked if action == "turn"]
    assert turns == [20, 20, 20, 20, 40, 40]
    assert actions(link).count("light") == 4
    assert said(link)[-1] == "Thank you."


@pytest.mark.parametrize(("distance", "steps", "last"), [(2.0, 5, "enough"), (0.5, 0, "after 0 steps.")])
def test_careful_walk_example_checks_distance_before_each_step(distance, steps, last):
    link = FakeLink()
    link.sensors |= {("Pepper", "distance"): distance, ("Pepper", "battery"): 15}
    play, link = run(5, link)
    play.end()
    assert play.runtime.error is None
    assert actions(link).count("walk") == steps
    assert last in said(link)[-2]
    assert said(link)[-1] == "My battery is low."


def test_finder_example_reports_detected_ball_and_face():
    link = FakeLink()
    link.sensors |= {("Pepper", "sees_ball"): True, ("Pepper", "sees_face"): True}
    play, link = run(6, link)
    play.end()
    assert play.runtime.error is None
    assert said(link) == ["I am looking for the ball.", "There is the ball.", "Hello! Did you lose a ball?"]
    assert actions(link).count("look_at") == 2


def test_weather_station_example_publishes_temperatures_and_reacts_to_messages():
    play, link = run(7)
    until(lambda: bool(link.published))
    topic, message = link.published[0]
    assert topic == "/weather"
    link.happen("/weather", {"temperature": 25})
    until(lambda: "It is warm, 25 degrees." in said(link))
    link.happen("/weather", {"temperature": 12})
    until(lambda: "It is cold, 12 degrees." in said(link))
    assert 10 <= message["temperature"] <= 30
    play.stop()
    play.end()
    assert play.lines == ["temperature: 25", "temperature: 12"]
