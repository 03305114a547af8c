"""Category Text and answers: joining, splitting and comparing texts. For answers, see `asking`."""

from __future__ import annotations

from functools import partial

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, TextField, ValueInput

_text = partial(Block, shape="value", style="values", check="String")
_number = partial(Block, shape="value", style="values", check="Number")
_boolean = partial(Block, shape="boolean", style="values", check="Boolean")

_BASIC_BLOCKS = (
    Block(
        type="values_text",
        text="%TEXT",  # the editor puts quotation marks around it
        shape="value",
        style="values",
        icon="",
        tooltip="A letter, word or line of text.",
        example="For example: “Touch my head”.",
        python="%TEXT",
        arguments=(TextField("TEXT", "Hello"),),
        check="String",
        can_fail=False,
        search_words="text, string, word, letters, sentence, quote, write",
    ),
    Block(
        type="values_join",
        text="join %A %B",
        shape="value",
        style="values",
        icon="link",
        tooltip="Joins two texts; numbers are converted to text.",
        example="For example: say join “Hello ” and the name that was heard.",
        python="join(%A, %B)",
        arguments=(ValueInput("A", None, "Hello "), ValueInput("B", None, "Pepper")),
        check="String",
        search_words="concatenate, combine, append, connect, plus, glue, text, put together, merge, "
        "string, add",
    ),
    Block(
        type="values_length",
        text="length of %TEXT",
        shape="value",
        style="values",
        icon="ruler",
        tooltip="Number of characters in a text, or of items in a list.",
        example="For example: length of “Hello” gives 5.",
        python="length(%TEXT)",
        arguments=(ValueInput("TEXT", None, "Hello"),),
        check="Number",
        search_words="count, letters, characters, size, how long, how many",
    ),
)

_PART_BLOCKS = (
    _text(
        "texts_letter",
        "%WHERE %NUMBER of %TEXT",
        icon="a-large-small",
        tooltip="One letter of a text; the first is number 1.",
        help="If there is no such letter, the behaviour stops with an error. An emoji such as 👍 counts "
        "as one letter.",
        example="For example: first letter of “Ada” gives “A”.",
        python={
            "number": "letter(%TEXT, %NUMBER)",
            "first": "letter(%TEXT, 'first')",
            "last": "letter(%TEXT, 'last')",
            "random": "letter(%TEXT, 'random')",
        },
        arguments=(
            ChoiceField(
                "WHERE",
                (
                    ("letter number", "number"),
                    ("first letter", "first"),
                    ("last letter", "last"),
                    ("a random letter", "random"),
                ),
            ),
            ValueInput("NUMBER", "Number", 1, only_if=("WHERE", "number")),
            ValueInput("TEXT", None, "Hello"),
        ),
        variant="WHERE",
        search_words="character, char, get, index, letter, first, last",
    ),
    _text(
        "texts_part",
        "letters %FIRST to %LAST of %TEXT",
        icon="scissors",
        tooltip="Part of a text, from one letter to another.",
        help="Positions beyond the end are ignored: letters 4 to 99 of “Hello” are “lo”.",
        example="For example: letters 7 to 9 of “Hello Ada” gives “Ada”.",
        python="part_of_text(%TEXT, %FIRST, %LAST)",
        arguments=(
            ValueInput("FIRST", "Number", 1),
            ValueInput("LAST", "Number", 3),
            ValueInput("TEXT", None, "Hello"),
        ),
        search_words="substring, slice, piece, characters, cut, part, extract",
    ),
    _number(
        "texts_position",
        "position of %PIECE in %TEXT",
        icon="text-search",
        tooltip="Position of the first occurrence of these characters in the text; 0 if the text doesn't "
        "contain them.",
        example="For example: position of “l” in “Hello” gives 3.",
        python="position_in_text(%TEXT, %PIECE)",
        arguments=(ValueInput("PIECE", None, "l"), ValueInput("TEXT", None, "Hello")),
        search_words="index, find, where, search, place",
    ),
    _text(
        "texts_change",
        "%TEXT %CHANGE",
        icon="case-upper",
        tooltip="The text in capital letters, in small letters, without spaces around it, or backwards.",
        example="For example: “Hello” in capital letters gives “HELLO”.",
        python={
            "capitals": "in_capitals(%TEXT)",
            "small": "in_small_letters(%TEXT)",
            "trimmed": "without_spaces_around(%TEXT)",
            "backwards": "backwards(%TEXT)",
        },
        arguments=(
            ValueInput("TEXT", None, "Hello"),
            ChoiceField(
                "CHANGE",
                (
                    ("in capital letters", "capitals"),
                    ("in small letters", "small"),
                    ("without spaces around it", "trimmed"),
                    ("backwards", "backwards"),
                ),
            ),
        ),
        variant="CHANGE",
        search_words="upper, lower, case, uppercase, lowercase, capital letters, small letters, trim, strip, "
        "reverse, spaces",
    ),
    _text(
        "texts_replace",
        "replace %OLD with %NEW in %TEXT",
        icon="replace",
        tooltip="Replaces all occurrences of some characters in a text.",
        help="If the second slot is empty, the characters are removed.",
        example="For example: replace “Ada” with “Leo” in “Hello Ada” gives “Hello Leo”.",
        python="replaced(%TEXT, %OLD, %NEW)",
        arguments=(
            ValueInput("OLD", None, "Ada"),
            ValueInput("NEW", None, "Leo"),
            ValueInput("TEXT", None, "Hello Ada"),
        ),
        search_words="substitute, exchange, swap, remove, change",
    ),
    _number(
        "texts_number",
        "number in %TEXT",
        icon="calculator",
        tooltip="The first number in a text.",
        help="“I am 12 years old” gives 12. If there is no number, the behaviour stops with an error; "
        "check with “has a number” first.",
        example="For example: repeat “number in answer” times.",
        python="number_in(%TEXT)",
        arguments=(ValueInput("TEXT", None, "12 apples"),),
        search_words="convert, parse, to number, int, value",
    ),
)

_CONDITION_BLOCKS = (
    _boolean(
        "texts_contains",
        "%TEXT %HOW %PIECE",
        icon="text-search",
        tooltip="Checks if a text contains, starts with or ends with these characters.",
        help="Capital and small letters are treated as different.",
        example="For example: if “answer” contains “dance”, dance.",
        python={
            "contains": "has_in_it(%TEXT, %PIECE)",
            "starts": "starts_with(%TEXT, %PIECE)",
            "ends": "ends_with(%TEXT, %PIECE)",
        },
        arguments=(
            ValueInput("TEXT", None, "Hello Ada"),
            ChoiceField("HOW", (("contains", "contains"), ("starts with", "starts"), ("ends with", "ends"))),
            ValueInput("PIECE", None, "Ada"),
        ),
        variant="HOW",
        search_words="in, includes, has, begins, starts with, ends with, find, search",
    ),
    _boolean(
        "texts_same",
        "%A is %B ignoring capitals",
        icon="equal",
        tooltip="True if both texts are the same; capital letters and spaces at the ends are ignored.",
        help="Useful for answers that people type or say: “Yes”, “yes” and “YES ” count as the same.",
        example="For example: if “answer” is “yes”, ignoring capitals, say “Great!”.",
        python="same_words(%A, %B)",
        arguments=(ValueInput("A", None, "Yes"), ValueInput("B", None, "yes")),
        search_words="equals, equal, same, compare, case, insensitive, uppercase",
    ),
    _boolean(
        "texts_empty",
        "%TEXT is empty",
        icon="circle-dashed",
        tooltip="True if the text is empty or contains only spaces.",
        example="For example: if “answer” is empty, ask again.",
        python="is_empty(%TEXT)",
        arguments=(ValueInput("TEXT", None, ""),),
        search_words="nothing, blank, none, no text",
    ),
    _boolean(
        "texts_has_number",
        "%TEXT has a number",
        icon="binary",
        tooltip="True if the text contains a number.",
        example="For example: repeat until “answer” has a number: ask again.",
        python="has_number(%TEXT)",
        arguments=(ValueInput("TEXT", None, "12 apples"),),
        search_words="is a number, numeric, digit, check number",
    ),
)

CATEGORY = Category(
    name="texts",
    title="Text and answers",
    style="values",
    icon="type",
    order=35,
    blocks=(*_BASIC_BLOCKS, *_PART_BLOCKS, *_CONDITION_BLOCKS),
    headings={"values_text": "Text", "texts_contains": "Questions about text"},
)
