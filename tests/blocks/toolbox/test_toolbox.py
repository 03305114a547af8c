from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.blocks.toolbox.catalogue import categories
from app.blocks.toolbox.definitions import editor_definitions
from tests.blocks.samples import nao, robot
from tools.blocks_page import page

DEFINITIONS = editor_definitions([robot()], [nao()], ["/faces"])
BLOCKS = {definition["type"]: definition for definition in DEFINITIONS["blocks"]}  # type: ignore[attr-defined]


def words(block_type: str) -> str:
    """Return the text on a block, with the names of its fields and slots in brackets."""
    definition = BLOCKS[block_type]
    lines = []
    for number in range(4):
        text = str(definition.get(f"message{number}", ""))
        for place, argument in enumerate(definition.get(f"args{number}", []), 1):
            text = text.replace(f"%{place}", f"[{argument['name']}]")
        lines.append(text.strip())
    return " / ".join(line for line in lines if line)


@pytest.mark.parametrize(
    ("block_type", "expected"),
    [
        ("events_started", "[ICON] when started"),
        ("events_message", "[ICON] when a message arrives on [TOPIC]"),
        ("robot_pepper_when_touched", "[ICON] when [ROBOT] [PLACE] is touched"),
        ("robot_pepper_do_light", "[ICON] [ROBOT] light [WHERE] [COLOUR]"),
        ("robot_pepper_do_say", "[ICON] [ROBOT] say [TEXT]"),
        ("robot_pepper_do_turn", "[ICON] [ROBOT] turn [DIRECTION] by [ANGLE] °"),
        ("robot_pepper_do_look", "[ICON] [ROBOT] look [EMOTION] for [SECONDS] s"),
        ("robot_pepper_get_sees_face", "[ICON] [ROBOT] sees a face"),
        ("robot_pepper_get_battery", "[ICON] [ROBOT] battery [LIVE]"),
        ("robot_nao_do_wave", "[ICON] [ROBOT] wave [HAND] hand"),
        ("control_wait", "[ICON] wait [SECONDS] s"),
        ("control_wait_until", "[ICON] wait until [CONDITION]"),
        ("control_repeat", "[ICON] repeat [TIMES] times / [BODY]"),
        ("control_if", "[ICON] if [CONDITION] / [BODY]"),
        ("control_if_else", "[ICON] if [CONDITION] / [BODY] / else / [ELSE]"),
        ("messages_publish", "[ICON] publish [VALUE] on [TOPIC]"),
        ("messages_newest", "[ICON] newest [FIELD] of [TOPIC]"),
        ("values_text", "[TEXT]"),
    ],
)
def test_block_texts_contain_their_fields_and_slots_in_order(block_type, expected):
    assert words(block_type) == expected


def test_block_message_placeholders_match_arguments_and_action_block_has_its_icon():
    for definition in BLOCKS.values():
        for number in range(4):
            arguments = definition.get(f"args{number}", [])
            message = str(definition.get(f"message{number}", "")).replace("%%", "")
            for place in range(1, len(arguments) + 1):
                assert f"%{place}" in message
            assert f"%{len(arguments) + 1}" not in message
    icon = BLOCKS["robot_pepper_do_say"]["args0"][0]
    assert icon == {"type": "field_icon", "name": "ICON", "icon": "message-circle"}


def test_block_shapes_become_connections():
    hat, statement, cap = BLOCKS["events_started"], BLOCKS["control_wait"], BLOCKS["control_forever"]
    assert ("previousStatement" in hat, "nextStatement" in hat) == (False, True)
    assert ("previousStatement" in statement, "nextStatement" in statement) == (True, True)
    assert ("previousStatement" in cap, "nextStatement" in cap) == (True, False)
    assert BLOCKS["robot_pepper_get_sees_face"]["output"] == "Boolean"
    assert BLOCKS["robot_pepper_get_battery"]["output"] == "Number"
    assert BLOCKS["messages_newest"]["output"] is None


def test_custom_fields_are_defined():
    fields = {argument["name"]: argument for argument in BLOCKS["robot_pepper_do_light"]["args0"]}
    assert fields["ROBOT"] == {
        "type": "field_choice", "name": "ROBOT", "options": [["Pepper", "Pepper"]], "source": "robots:pepper",
    }  # fmt: skip
    assert fields["WHERE"]["options"] == [["eyes", "eyes"], ["shoulders", "shoulders"]]
    assert fields["COLOUR"] == {"type": "field_colour_chip", "name": "COLOUR", "value": "#37b6ff"}
    newest = {argument["name"]: argument for argument in BLOCKS["messages_newest"]["args0"]}
    assert newest["TOPIC"] == {"type": "field_topic", "name": "TOPIC", "value": "/faces"}
    home = {argument["name"]: argument for argument in BLOCKS["robot_pepper_do_go_home"]["args0"]}
    assert home["WITH_SONG"]["options"] == [["song: no", "false"], ["song: yes", "true"]]


def test_toolbox_has_categories_of_built_in_and_robot_blocks():
    contents = DEFINITIONS["toolbox"]["contents"]  # type: ignore[index]
    shape = [(item["kind"], item["name"]) for item in contents]
    assert shape == [
        ("blocksHeading", "Blocks"),
        ("category", "Events"), ("category", "Control"), ("category", "Numbers and logic"),
        ("category", "Text and answers"), ("category", "Variables"),
        ("category", "Lists"), ("category", "Functions"), ("category", "Messages"),
        ("robotHeading", "Pepper"),
        ("category", "Speech"), ("category", "Movement"), ("category", "Face and lights"),
        ("category", "Sensors"),
        ("robotHeading", "NAO"),
    ]  # fmt: skip
    pepper, away = contents[9], contents[-1]
    assert (pepper["virtual"], pepper["connected"], away["connected"]) == (True, True, False)
    assert len({item["toolboxitemid"] for item in contents if item["kind"] == "category"}) == 12
    speech = contents[10]
    assert (speech["icon"], speech["categorystyle"], contents[13]["categorystyle"]) == (
        "message-circle", "robot", "sensors",
    )  # fmt: skip
    say = speech["contents"][0]
    assert say == {
        "kind": "block",
        "type": "robot_pepper_do_say",
        "fields": {"ROBOT": "Pepper"},
        "inputs": {"TEXT": {"shadow": {"type": "values_text", "fields": {"TEXT": "Hello"}}}},
    }
    assert contents[7]["dynamic"] == "functions"
    assert contents[5]["contents"][0] == {
        "kind": "button", "text": "New variable", "callbackkey": "CREATE_VARIABLE",
    }  # fmt: skip


def test_long_category_has_headings_between_its_blocks():
    (lists,) = [item for item in DEFINITIONS["toolbox"]["contents"] if item["name"] == "Lists"]  # type: ignore[index]
    shown = [entry.get("text") or entry["type"] for entry in lists["contents"]]
    assert shown[:3] == ["New list", "Make a list", "lists_empty"]
    assert shown[shown.index("Change a list") + 1] == "lists_add"


def test_combined_category_has_a_heading_for_each_of_its_parts():
    (numbers,) = [item for item in DEFINITIONS["toolbox"]["contents"] if item["name"] == "Numbers and logic"]  # type: ignore[index]
    shown = [entry.get("text") or entry["type"] for entry in numbers["contents"]]
    assert shown[:2] == ["Logic", "values_compare"]
    assert shown[shown.index("Calculate") + 1] == "values_number"
    assert shown[shown.index("Time") + 1] == "sensing_timer"


def test_every_toolbox_entry_is_defined_and_every_style_exists():
    for item in DEFINITIONS["toolbox"]["contents"]:  # type: ignore[index]
        for entry in item.get("contents", []):
            if entry["kind"] == "block":
                definition = BLOCKS[entry["type"]]
                names = {argument["name"] for n in range(4) for argument in definition.get(f"args{n}", [])}
                used = {name.rstrip("0123456789") for name in entry.get("inputs", {})}
                assert used | set(entry.get("fields", {})) <= names
    assert {definition["style"] for definition in BLOCKS.values()} <= set(DEFINITIONS["styles"])  # type: ignore[arg-type]


def test_robot_event_blocks_are_also_listed_under_events_below_robot_name():
    two = editor_definitions([robot("Pepper"), nao()])["toolbox"]["contents"]  # type: ignore[index]
    (events,) = (item["contents"] for item in two if item.get("name") == "Events")
    told = [entry.get("text") or entry["type"] for entry in events]
    at = told.index("Pepper")
    assert told[0] == "events_started"
    assert not any(each.startswith("robot_") for each in told[:at])
    assert told[at + 1 : at + 3] == ["robot_pepper_when_touched", "robot_pepper_when_heard"]
    assert events[at + 1]["fields"] == {"ROBOT": "Pepper"}
    assert "robot_nao_when_touched" in told[told.index("NAO") :]
    (sensors, _nao) = (item["contents"] for item in two if item.get("name") == "Sensors")
    assert events[at + 1] in sensors
    assert not any(
        "text" in entry for item in two if item.get("name") == "Control" for entry in item["contents"]
    )


def test_robots_of_one_model_share_their_blocks():
    two = editor_definitions([robot("Pepper"), robot("Salt")])
    says = [each for each in two["blocks"] if each["type"] == "robot_pepper_do_say"]  # type: ignore[attr-defined]
    assert len(says) == 1
    assert says[0]["args0"][1]["options"] == [["Pepper", "Pepper"], ["Salt", "Salt"]]
    presets = [
        entry["fields"]["ROBOT"]
        for item in two["toolbox"]["contents"]  # type: ignore[index]
        if item.get("name") == "Speech"
        for entry in item["contents"]
        if entry["type"] == "robot_pepper_do_say"
    ]
    assert presets == ["Pepper", "Salt"]


def test_editor_definitions_are_json_serializable():
    json.dumps(DEFINITIONS)
    assert editor_definitions([])["toolbox"]["contents"][-1]["name"] == "Messages"  # type: ignore[index]


def test_block_reference_page_is_generated_from_descriptions():
    """If it fails, run ``python tools/blocks_page.py``."""
    text = Path("docs/blocks.md").read_text("utf-8")
    assert page(text) == text
    for category in categories():
        for described in category.blocks:
            assert described.tooltip in text
