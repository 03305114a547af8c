"""Help for a block: a description, the values that its slots accept, and an example."""

from __future__ import annotations

import re
from collections.abc import Mapping

from app.blocks.model.block import Block
from app.blocks.model.block_text import block_text
from app.blocks.model.fields import (
    Argument,
    BroadcastField,
    ChoiceField,
    ColourField,
    LiveField,
    NumberField,
    PathField,
    StatementInput,
    TextField,
    TopicField,
    ValueInput,
    VariableField,
)
from app.blocks.model.mutators import Inputs, Items
from app.blocks.model.workspace import parse_workspace
from nep.i18n import _, format_list, lazy, translate

EXAMPLES: Mapping[str, str] = {
    "events_started": "For example: when started, Pepper says “Hello”.",
    "events_message": "For example: when a message arrives on /faces, Pepper says “Hello”.",
    "events_becomes_true": "For example: when “battery is below 20” becomes true, Pepper asks to be charged.",
    "control_wait": "For example: light on, wait 2 s, light off.",
    "control_wait_until": "For example: wait until Pepper sees a face, then say “Hello”.",
    "control_wait_until_at_most": "For example: wait for an answer, but continue after 10 s without one.",
    "control_repeat": "For example: repeat 3 times: turn left, say “Here?”.",
    "control_forever": "For example: repeat forever: write the distance to the console, wait 1 s.",
    "control_while": "For example: repeat until the distance is below 0.5: move a little.",
    "control_if": "For example: if Pepper sees a face, say “Hello”.",
    "control_if_else": "For example: if the battery is above 20, dance; else say “I am tired”.",
    "control_stop_script": "For example: if nobody is there, stop this script; the other scripts continue.",
    "control_stop_program": "For example: when the head is touched, stop the behaviour.",
    "values_number": "For example: 2, 0.5 or −10.",  # noqa: RUF001 (the sign that people read)
    "values_text": "For example: “Touch my head”.",
    "values_boolean": "For example: set “greeted” to true, and check it later with “if”.",
    "values_arithmetic": "For example: set “steps” to steps + 1.",
    "values_random": "For example: turn by a random number from 10 to 90.",
    "values_round": "For example: round 2.5 gives 3, round down 2.5 gives 2.",
    "values_compare": "For example: if “distance is below 0.5”, stop.",
    "values_logic": "For example: if “sees a face” and “battery is above 20”, dance.",
    "values_not": "For example: wait until not “sees a face”, then say “Goodbye”.",
    "values_known": "For example: wait until “newest name of /faces” is known.",
    "values_join": "For example: say join “Hello ” and the name that was heard.",
    "values_length": "For example: length of “Hello” gives 5.",
    "events_received": "For example: when I receive “start quiz”, ask the first question.",
    "events_broadcast": "For example: when the head is touched, broadcast “start quiz”.",
    "events_broadcast_wait": "For example: broadcast “dance” and wait until all have danced, "
    "then say “Bravo”.",
    "control_stop_others": "For example: when the hand is touched, stop the other scripts, say “Enough”.",
    "asking_ask": "For example: ask “What is your name?” and wait, then say join “Hello ” and answer.",
    "asking_choices": "For example: ask “Which animal is this?” with choices “cat”, “dog” and “cow”.",
    "asking_answer": "For example: if “answer is 7”, say “Right!”.",
    "control_count": "For example: count “number” from 1 to 10 by 1: say “number”.",
    "numbers_function": "For example: square root of 9 gives 3, sin of 90 gives 1.",
    "numbers_round_to": "For example: round 3.14159 to 2 decimal places gives 3.14.",
    "numbers_of_two": "For example: set “points” to larger of “points” and 0, so that it is never negative.",
    "numbers_limit": "For example: limit 120 to between 0 and 100 gives 100.",
    "numbers_map": "For example: map 50 from 0 – 100 to 0 – 1 gives 0.5.",  # noqa: RUF001
    "numbers_constant": "For example: the circumference of a wheel is its diameter × π.",  # noqa: RUF001
    "numbers_is": "For example: if “round is even”, turn left; else turn right.",
    "numbers_divisible": "For example: if “points is divisible by 10”, play a sound.",
    "texts_letter": "For example: first letter of “Ada” gives “A”.",
    "texts_part": "For example: letters 7 to 9 of “Hello Ada” gives “Ada”.",
    "texts_position": "For example: position of “l” in “Hello” gives 3.",
    "texts_change": "For example: “Hello” in capital letters gives “HELLO”.",
    "texts_replace": "For example: replace “Ada” with “Leo” in “Hello Ada” gives “Hello Leo”.",
    "texts_number": "For example: repeat “number in answer” times.",
    "texts_contains": "For example: if “answer” contains “dance”, dance.",
    "texts_same": "For example: if “answer” is “yes”, ignoring capitals, say “Great!”.",
    "texts_empty": "For example: if “answer” is empty, ask again.",
    "texts_has_number": "For example: repeat until “answer” has a number: ask again.",
    "sensing_timer": "For example: when timer is above 60, say “The minute is over”.",
    "sensing_reset": "For example: reset timer, wait for a touch, say timer.",
    "sensing_now": "For example: if “hour now” is below 12, say “Good morning”.",
    "sensing_seconds_since": "For example: if seconds since 14:30 is above 0, say “The lesson is over”.",
    "lists_part": "For example: items 1 to 3 of “names” are the first three.",
    "lists_is_empty": "For example: repeat until “tasks” is empty: say the value of "
    "“take out first item of tasks”.",
    "lists_total": "For example: say average of “marks”.",
    "lists_copy": "For example: set “names” to copy of “names” from small to large.",
    "lists_clear": "For example: when started, remove all items of “answers”.",
    "variables_set": "For example: set “count” to 0 when started.",
    "variables_change": "For example: change “count” by 1 each time the head is touched.",
    "variables_get": "For example: say “count”.",
    "lists_empty": "For example: set “names” to an empty list when started.",
    "lists_create": "For example: set “colours” to list of “red”, “green” and “blue”.",
    "lists_split": "For example: split “yes,no” at “,” gives a list of “yes” and “no”.",
    "lists_get": "For example: say a random item of “jokes”.",
    "lists_length": "For example: repeat “number of items in names” times.",
    "lists_contains": "For example: if “names” contains “Ada”, say “I know you”.",
    "lists_position": "For example: position of “pear” in a list of apple and pear gives 2.",
    "lists_join": "For example: say all items of “names” with “ and ” between them.",
    "lists_add": "For example: add the name that was heard to “names”.",
    "lists_insert": "For example: insert “first of all” as first item of “tasks”.",
    "lists_set": "For example: set item number 2 of “marks” to 6.",
    "lists_remove": "For example: remove first item of “tasks” when it is done.",
    "lists_take": "For example: to tell each joke only once, say the value of "
    "“take out a random item of jokes”.",
    "lists_each": "For example: for each item “name” in “names”: say “name”.",
    "functions_define": "For example: to greet with “name”: say join “Hello ” and “name”.",
    "functions_define_result": "For example: to double with “number”: return number × 2.",  # noqa: RUF001
    "functions_return_if": "For example: if number is below 2, return 1.",
    "functions_leave_if": "For example: if “greeted” is true, leave the function.",
    "functions_call": "For example: greet “Ada”.",
    "functions_result": "For example: say double 21.",
    "functions_input": "For example: say “name” inside the function “greet”.",
    "messages_publish": "For example: publish “started” on /blackboard.",
    "messages_publish_field": "For example: publish name: “Ada” on /faces.",
    "messages_write": "For example: write the distance to the console.",
    "messages_newest": "For example: say newest name of /faces.",
    "messages_message": "For example: write “message” to the console.",
    "messages_field": "For example: say “name” of the message.",
}
_PLACEHOLDER = re.compile(r"%([A-Z][A-Z0-9_]*)")
_SLOT_NAMES = {
    "A": "first value",
    "B": "second value",
    "BODY": "inside",
    "ELSE": "inside, below “else”",
    "VAR": "variable",
}
_TYPE_TEXTS = {
    "Number": lazy("a number"),
    "String": lazy("a text"),
    "Boolean": lazy("yes or no, such as a comparison"),
    "List": lazy("a list"),
}
_ANY_TYPE_TEXT = lazy("any value")
_MAX_CHOICES = 6
_MAX_UNIT_LENGTH = 3  # maximum length of a unit


def help_of(block: Block) -> dict[str, object]:
    """Return the help for a block as a JSON object.

    The members are ``title``, ``name``, ``does`` (short description), ``more`` (long description), ``gaps``
    (pairs of slot name and accepted values), and ``example``. Only for search: ``words`` and ``english``
    (search words in both languages) and ``choices`` (options of the drop-downs).
    """
    gaps = [
        [slot_name(block, argument), accepted_values]
        for argument in block.arguments
        if (accepted_values := _argument_text(block, argument))
    ]
    return {
        "title": title(block),
        "name": name(block),
        "does": block.tooltip,
        "more": block.help,
        "gaps": gaps,
        "example": _example(block),
        "words": block.search_words,
        "english": block.english_search_words,
        "choices": _choice_texts(block),
    }


def _example(block: Block) -> str:
    example = EXAMPLES.get(block.type)
    return _(example) if example else _("For example: {block}.").format(block=_block_with_defaults(block))


def title(block: Block) -> str:
    """Return the text on a block with the names of slots in parentheses, such as ``wait (seconds) s``."""

    def slot_text(match: re.Match[str]) -> str:
        argument = block.argument(match[1])
        if argument is None or isinstance(argument, (LiveField, StatementInput)):
            return ""
        return f"({slot_name(block, argument)})"

    return " ".join(_PLACEHOLDER.sub(slot_text, block.text).split())


def name(block: Block) -> str:
    """Return the name of a block for use in a sentence, such as "walk" or "repeat … times".

    The robot slot and a unit after the last slot are left out. Returns "" if the block contains no words.
    """
    text_parts = [part.strip() for part in _PLACEHOLDER.split(block.text.removeprefix("%ROBOT "))[::2]]
    if len(text_parts) > 1 and len(text_parts[-1]) <= _MAX_UNIT_LENGTH:
        text_parts[-1] = ""
    block_name = re.sub(r"\s*…[\s…]*", " … ", "…".join(text_parts)).strip().removesuffix(" …")
    return (
        block_name
        if sum(letter.isalpha() for letter in block_name) >= _MAX_UNIT_LENGTH - 1 and block_name != "…"
        else ""
    )


def slot_name(block: Block, argument: Argument) -> str:
    """Return the display name of a slot or field."""
    gap_texts = block.slot_texts.get(argument.name)
    if gap_texts:
        return gap_texts[0]
    return translate("gap", english_slot_name(argument))


def english_slot_name(argument: Argument) -> str:
    """Return the default display name of a slot or field, in English."""
    return _SLOT_NAMES.get(argument.name, argument.name.lower().replace("_", " "))


def _argument_text(block: Block, argument: Argument) -> str:
    kind_text = _kind_text(argument)
    gap_texts = block.slot_texts.get(argument.name)
    if kind_text and gap_texts and gap_texts[1]:
        return _("{kind}, {more}").format(kind=kind_text, more=gap_texts[1])
    return kind_text


def _kind_text(argument: Argument) -> str:
    if argument.name == "ROBOT":
        return _("which robot")
    if isinstance(argument, ValueInput):
        return _value_text(argument)
    if isinstance(argument, ChoiceField):
        return _choice_text(argument)
    if isinstance(argument, NumberField):
        return _number_text(argument)
    for kind, field_text in _FIELD_TEXTS.items():
        if isinstance(argument, kind):
            return _(field_text)
    return ""


_FIELD_TEXTS: Mapping[type[Argument], str] = {
    StatementInput: lazy("blocks"),
    TextField: lazy("a text, typed into the block"),
    BroadcastField: lazy("name of a message; choose one or create a new one"),
    TopicField: lazy("name of a topic; choose or type one"),
    PathField: lazy("name of a field in the topic's messages"),
    ColourField: lazy("a colour; click on it to choose"),
    VariableField: lazy("one of the behaviour's variables"),
    Items: lazy("up to 50 slots"),
    Inputs: lazy("inputs of the function"),
}


def _value_text(gap: ValueInput) -> str:
    value_text = _(_TYPE_TEXTS.get(gap.check or "", _ANY_TYPE_TEXT))
    if isinstance(gap.default, (int, float)) and not isinstance(gap.default, bool):
        value_text = _("{kind}; {value} by default").format(kind=value_text, value=f"{gap.default:g}")
    if gap.only_if is None:
        return value_text
    return _("{kind}; used only if you choose by number").format(kind=value_text)


def _choice_text(field: ChoiceField) -> str:
    names = [f"“{option_text}”" for option_text, _value in field.options]
    if len(names) > _MAX_CHOICES:
        first_names = ", ".join(names[: _MAX_CHOICES - 1])
        return _("one of {count} choices: {few} and others").format(count=len(names), few=first_names)
    return format_list(names, "or") if len(names) > 1 else _("choose one")


def _choice_texts(block: Block) -> list[str]:
    fields = [each for each in block.arguments if isinstance(each, ChoiceField) and each.name != "ROBOT"]
    return [option_text for field in fields for option_text, _value in field.options]


def _number_text(field: NumberField) -> str:
    low, high = (None if each is None else f"{each:g}" for each in (field.minimum, field.maximum))
    if low is not None and high is not None:
        return _("a number from {low} to {high}").format(low=low, high=high)
    if low is not None:
        return _("a number of at least {low}").format(low=low)
    return _("a number") if high is None else _("a number of at most {high}").format(high=high)


def _block_with_defaults(block: Block) -> str:
    workspace = parse_workspace({"blocks": {"blocks": [block.to_toolbox()]}})
    return block_text(workspace.scripts[0][0], _blocks_for_text(block), {})


def _blocks_for_text(block: Block) -> dict[str, Block]:
    number = Block("values_number", "%NUMBER", "value", "", "", "", "", (NumberField("NUMBER"),))
    text_block = Block("values_text", "%TEXT", "value", "", "", "", "", (TextField("TEXT"),))
    variable = Block("variables_get", "%VAR", "value", "", "", "", "", (VariableField("VAR"),))
    return {each.type: each for each in (number, text_block, variable, block)}
