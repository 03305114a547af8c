"""Category Lists: ordered values in one variable, numbered from 1."""

from __future__ import annotations

from functools import partial

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, StatementInput, ValueInput, VariableField
from app.blocks.model.mutators import Items

_value = partial(Block, shape="value", style="variables")
_boolean = partial(Block, shape="boolean", style="variables")
_statement = partial(Block, shape="statement", style="variables")

_LIST = ValueInput("LIST", "List", variable="list")
_NUMBER = ValueInput("NUMBER", "Number", 1, only=("WHERE", "number"))
_PLACES = (("item number", "number"), ("first item", "first"), ("last item", "last"))
_PLACES_OR_ANY = (*_PLACES, ("a random item", "random"))
_WHERE = ChoiceField("WHERE", _PLACES_OR_ANY)


def _at(call: str, places: tuple[tuple[str, str], ...] = _PLACES_OR_ANY) -> dict[str, str]:
    return {place: call.replace("@", "%NUMBER" if place == "number" else f"'{place}'") for _, place in places}


_MAKING = (
    _value(
        "lists_empty",
        "empty list",
        icon="list",
        tooltip="A list with nothing in it yet.",
        help="Put it into a variable first, then add items to that variable.",
        python="new_list()",
        check="List",
        fails=False,
        words="new, create, array, make, no items",
    ),
    _value(
        "lists_create",
        "list of %ITEM",
        icon="list-plus",
        tooltip="A list of these items.",
        help="The two buttons add and take away a gap. A list has room for 10000 items.",
        python="new_list(%ITEM)",
        arguments=(Items("ITEM", 3, ("apple", "pear", "plum")),),
        check="List",
        mutator="items",
        extra={"items": 3},
        words="new, create, array, make, collection, several",
    ),
    _value(
        "lists_split",
        "split %TEXT at %BETWEEN",
        icon="split",
        tooltip="A list of the pieces of a text between these characters.",
        help="“a,b,c” at “,” gives a list of three items. At an empty text it gives the single characters.",
        python="split_text(%TEXT, %BETWEEN)",
        arguments=(ValueInput("TEXT", None, "yes,no"), ValueInput("BETWEEN", None, ",")),
        check="List",
        words="text, words, separate, divide, cut, csv",
    ),
)

_READING = (
    _value(
        "lists_get",
        "%WHERE %NUMBER of %LIST",
        icon="list-ordered",
        tooltip="One item of a list; the first is number 1.",
        help="When there is no such item, the behaviour stops here and says how many there are.",
        python=_at("item(%LIST, @)"),
        arguments=(_WHERE, _NUMBER, _LIST),
        variant="WHERE",
        words="get, element, index, choose, item, pick, first, last, read",
    ),
    _value(
        "lists_length",
        "number of items in %LIST",
        icon="ruler",
        tooltip="How many items a list has.",
        python="length(%LIST)",
        arguments=(_LIST,),
        check="Number",
        words="length, count, size, how many",
    ),
    _boolean(
        "lists_contains",
        "%LIST contains %VALUE",
        icon="list-checks",
        tooltip="Whether such an item is in the list.",
        help="For a text: whether these characters are in it.",
        python="contains(%LIST, %VALUE)",
        arguments=(ValueInput("LIST", None, variable="list"), ValueInput("VALUE", None, "apple")),
        check="Boolean",
        words="in, has, includes, find, search, member",
    ),
    _value(
        "lists_position",
        "number of %VALUE in %LIST",
        icon="search",
        tooltip="Which number the first such item has; 0 when there is none.",
        python="position(%LIST, %VALUE)",
        arguments=(ValueInput("VALUE", None, "apple"), _LIST),
        check="Number",
        words="index, find, where, position, search, place",
    ),
    _value(
        "lists_join",
        "all items of %LIST with %BETWEEN between them",
        icon="link",
        tooltip="One text of all items.",
        help="Useful to let a robot say a whole list: with “, ” between them.",
        python="join_items(%LIST, %BETWEEN)",
        arguments=(_LIST, ValueInput("BETWEEN", None, ", ")),
        check="String",
        words="join, text, say, concatenate, glue, combine",
    ),
    _value(
        "lists_part",
        "items %FIRST to %LAST of %LIST",
        icon="scissors",
        tooltip="A list of the items from one number to another.",
        help="What is beyond the end is left out. The list itself stays as it is.",
        python="part_of_list(%LIST, %FIRST, %LAST)",
        arguments=(ValueInput("FIRST", "Number", 1), ValueInput("LAST", "Number", 3), _LIST),
        check="List",
        words="slice, sublist, piece, some, part",
    ),
    _boolean(
        "lists_is_empty",
        "%LIST is empty",
        icon="circle-dashed",
        tooltip="True if the list is empty.",
        python="is_empty_list(%LIST)",
        arguments=(_LIST,),
        check="Boolean",
        words="nothing, none, length, no items",
    ),
)

_WORKING_OUT = (
    _value(
        "lists_total",
        "%WHAT of %LIST",
        icon="sigma",
        tooltip="One number from all numbers of a list.",
        help="The middle number is the one in the middle when they stand in a row from small to large.",
        python={
            "sum": "sum_of(%LIST)",
            "average": "average_of(%LIST)",
            "smallest": "smallest_of(%LIST)",
            "largest": "largest_of(%LIST)",
            "middle": "middle_of(%LIST)",
        },
        arguments=(
            ChoiceField(
                "WHAT",
                (
                    ("sum", "sum"),
                    ("average", "average"),
                    ("smallest number", "smallest"),
                    ("largest number", "largest"),
                    ("middle number", "middle"),
                ),
            ),
            _LIST,
        ),
        variant="WHAT",
        check="Number",
        words="total, sum, add, average, mean, min, max, minimum, maximum, median, smallest, largest, "
        "statistics",
    ),
    _value(
        "lists_copy",
        "copy of %LIST %ORDER",
        icon="copy",
        tooltip="A new list with the same items, in this order.",
        help="The list itself stays as it is: to sort it, set it to its sorted copy. Numbers come before "
        "texts; capital and small letters are sorted alike.",
        python={
            "same": "copy_of(%LIST)",
            "up": "sorted_up(%LIST)",
            "down": "sorted_down(%LIST)",
            "backwards": "turned_round(%LIST)",
            "random": "shuffled(%LIST)",
        },
        arguments=(
            _LIST,
            ChoiceField(
                "ORDER",
                (
                    ("from small to large", "up"),
                    ("from large to small", "down"),
                    ("backwards", "backwards"),
                    ("in a random order", "random"),
                    ("as it is", "same"),
                ),
            ),
        ),
        variant="ORDER",
        check="List",
        words="sort, order, reverse, shuffle, mix, duplicate, ascending, descending, random order, "
        "alphabetical",
    ),
)

_removing = partial(
    Block,
    style="variables",
    icon="list-minus",
    python=_at("remove_item(%LIST, @)"),
    arguments=(_WHERE, _NUMBER, _LIST),
    variant="WHERE",
)

_CHANGING = (
    _statement(
        "lists_add",
        "add %VALUE to %LIST",
        icon="list-plus",
        tooltip="Puts a value at the end of a list.",
        help="A variable begins with 0: set it to an empty list before the first item.",
        python="add_item(%LIST, %VALUE)",
        arguments=(ValueInput("VALUE", None, "apple"), _LIST),
        words="append, push, put, insert, element",
    ),
    _statement(
        "lists_insert",
        "insert %VALUE as %WHERE %NUMBER of %LIST",
        icon="list-plus",
        tooltip="Puts a value into a list; the items behind it move on.",
        python=_at("insert_item(%LIST, @, %VALUE)", _PLACES),
        arguments=(ValueInput("VALUE", None, "apple"), ChoiceField("WHERE", _PLACES), _NUMBER, _LIST),
        variant="WHERE",
        words="add, put, push, element, between",
    ),
    _statement(
        "lists_set",
        "set %WHERE %NUMBER of %LIST to %VALUE",
        icon="square-pen",
        tooltip="Puts another value in the place of an item.",
        python=_at("set_item(%LIST, @, %VALUE)"),
        arguments=(_WHERE, _NUMBER, _LIST, ValueInput("VALUE", None, "apple")),
        variant="WHERE",
        words="replace, change, element, item, overwrite",
    ),
    _removing(
        "lists_remove",
        "remove %WHERE %NUMBER of %LIST",
        shape="statement",
        tooltip="Takes an item out of a list; the items behind it move up.",
        words="delete, drop, pop, erase, element",
    ),
    _removing(
        "lists_take",
        "take out %WHERE %NUMBER of %LIST",
        shape="value",
        tooltip="Takes an item out of a list and gives it.",
        help="To go through a list in a random order: take out a random item until the list is empty.",
        words="pop, draw, remove, delete, pull",
    ),
    _statement(
        "lists_clear",
        "remove all items of %LIST",
        icon="list-x",
        tooltip="Makes a list empty.",
        python="clear_list(%LIST)",
        arguments=(_LIST,),
        words="delete, empty, reset, clear, erase",
    ),
    _statement(
        "lists_each",
        "for each item %VAR in %LIST %BODY",
        icon="repeat",
        tooltip="Runs the blocks inside once for each item; the variable holds the item.",
        help="It goes over the items that were there when it began, whatever happens to the list inside.",
        python="for %VAR in each(%LIST):\n    %BODY",
        arguments=(VariableField("VAR", "item"), _LIST, StatementInput("BODY")),
        words="loop, repeat, for, foreach, iterate, every, cycle",
    ),
)

CATEGORY = Category(
    name="lists",
    title="Lists",
    style="variables",
    icon="list",
    order=45,
    dynamic="lists",
    button=("New list", "CREATE_LIST"),
    blocks=(*_MAKING, *_READING, *_WORKING_OUT, *_CHANGING),
    headings={
        "lists_empty": "Make a list",
        "lists_get": "Read a list",
        "lists_total": "Work something out",
        "lists_add": "Change a list",
    },
)
