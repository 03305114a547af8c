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
_NUMBER = ValueInput("NUMBER", "Number", 1, only_if=("WHERE", "number"))
_POSITIONS = (("item number", "number"), ("first item", "first"), ("last item", "last"))
_POSITIONS_OR_RANDOM = (*_POSITIONS, ("a random item", "random"))
_WHERE = ChoiceField("WHERE", _POSITIONS_OR_RANDOM)


def _templates_by_position(
    call: str, positions: tuple[tuple[str, str], ...] = _POSITIONS_OR_RANDOM
) -> dict[str, str]:
    return {
        position: call.replace("@", "%NUMBER" if position == "number" else f"'{position}'")
        for _, position in positions
    }


_CREATE_BLOCKS = (
    _value(
        "lists_empty",
        "empty list",
        icon="list",
        tooltip="A list without items.",
        help="First set a variable to this list, then add items to the variable.",
        example="For example: set “names” to an empty list when started.",
        python="new_list()",
        check="List",
        can_fail=False,
        search_words="new, create, array, make, no items",
    ),
    _value(
        "lists_create",
        "list of %ITEM",
        icon="list-plus",
        tooltip="A list of these items.",
        help="The two buttons add and remove a slot. A list can have up to 10000 items.",
        example="For example: set “colours” to list of “red”, “green” and “blue”.",
        python="new_list(%ITEM)",
        arguments=(Items("ITEM", 3, ("apple", "pear", "plum")),),
        check="List",
        mutator="items",
        extra_state={"items": 3},
        search_words="new, create, array, make, collection, several",
    ),
    _value(
        "lists_split",
        "split %TEXT at %BETWEEN",
        icon="split",
        tooltip="Splits a text into a list at each separator.",
        help="“a,b,c” split at “,” gives a list of three items. If the separator is empty, the list "
        "contains the single characters.",
        example="For example: split “yes,no” at “,” gives a list of “yes” and “no”.",
        python="split_text(%TEXT, %BETWEEN)",
        arguments=(ValueInput("TEXT", None, "yes,no"), ValueInput("BETWEEN", None, ",")),
        check="List",
        search_words="text, words, separate, divide, cut, csv",
    ),
)

_READ_BLOCKS = (
    _value(
        "lists_get",
        "%WHERE %NUMBER of %LIST",
        icon="list-ordered",
        tooltip="One item of a list; the first is number 1.",
        help="If there is no such item, the behaviour stops with an error.",
        example="For example: say a random item of “jokes”.",
        python=_templates_by_position("item(%LIST, @)"),
        arguments=(_WHERE, _NUMBER, _LIST),
        variant="WHERE",
        search_words="get, element, index, choose, item, pick, first, last, read",
    ),
    _value(
        "lists_length",
        "number of items in %LIST",
        icon="ruler",
        tooltip="Number of items in a list.",
        example="For example: repeat “number of items in names” times.",
        python="length(%LIST)",
        arguments=(_LIST,),
        check="Number",
        search_words="length, count, size, how many",
    ),
    _boolean(
        "lists_contains",
        "%LIST contains %VALUE",
        icon="list-checks",
        tooltip="True if the list contains this item.",
        help="For a text: true if it contains these characters.",
        example="For example: if “names” contains “Ada”, say “I know you”.",
        python="contains(%LIST, %VALUE)",
        arguments=(ValueInput("LIST", None, variable="list"), ValueInput("VALUE", None, "apple")),
        check="Boolean",
        search_words="in, has, includes, find, search, member",
    ),
    _value(
        "lists_position",
        "position of %VALUE in %LIST",
        icon="search",
        tooltip="Position of the first such item; 0 if the list doesn't contain it.",
        example="For example: position of “pear” in a list of apple and pear gives 2.",
        python="position(%LIST, %VALUE)",
        arguments=(ValueInput("VALUE", None, "apple"), _LIST),
        check="Number",
        search_words="index, find, where, position, search, place",
    ),
    _value(
        "lists_join",
        "all items of %LIST with %BETWEEN between them",
        icon="link",
        tooltip="Joins all items of a list into one text.",
        help="Useful to make a robot say a whole list, with “, ” between the items.",
        example="For example: say all items of “names” with “ and ” between them.",
        python="join_items(%LIST, %BETWEEN)",
        arguments=(_LIST, ValueInput("BETWEEN", None, ", ")),
        check="String",
        search_words="join, text, say, concatenate, glue, combine",
    ),
    _value(
        "lists_part",
        "items %FIRST to %LAST of %LIST",
        icon="scissors",
        tooltip="Part of a list, from one position to another, as a new list.",
        help="Positions beyond the end are ignored. The list itself doesn't change.",
        example="For example: items 1 to 3 of “names” are the first three.",
        python="part_of_list(%LIST, %FIRST, %LAST)",
        arguments=(ValueInput("FIRST", "Number", 1), ValueInput("LAST", "Number", 3), _LIST),
        check="List",
        search_words="slice, sublist, piece, some, part",
    ),
    _boolean(
        "lists_is_empty",
        "%LIST is empty",
        icon="circle-dashed",
        tooltip="True if the list is empty.",
        example="For example: repeat until “tasks” is empty: say the value of "
        "“take out first item of tasks”.",
        python="is_empty_list(%LIST)",
        arguments=(_LIST,),
        check="Boolean",
        search_words="nothing, none, length, no items",
    ),
)

_AGGREGATE_BLOCKS = (
    _value(
        "lists_total",
        "%WHAT of %LIST",
        icon="sigma",
        tooltip="Calculates one number from all numbers of a list, such as their sum.",
        help="“middle number” is the median: the number in the middle of the sorted list.",
        example="For example: say average of “marks”.",
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
        search_words="total, sum, add, average, mean, min, max, minimum, maximum, median, smallest, largest, "
        "statistics",
    ),
    _value(
        "lists_copy",
        "copy of %LIST %ORDER",
        icon="copy",
        tooltip="A new list with the same items, in this order.",
        help="The list itself doesn't change; to sort it, set it to the sorted copy. Numbers come before "
        "texts; capital and small letters are treated as the same.",
        example="For example: set “names” to copy of “names” from small to large.",
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
        search_words="sort, order, reverse, shuffle, mix, duplicate, ascending, descending, random order, "
        "alphabetical",
    ),
)

_remove_block = partial(
    Block,
    style="variables",
    icon="list-minus",
    python=_templates_by_position("remove_item(%LIST, @)"),
    arguments=(_WHERE, _NUMBER, _LIST),
    variant="WHERE",
)

_CHANGE_BLOCKS = (
    _statement(
        "lists_add",
        "add %VALUE to %LIST",
        icon="list-plus",
        tooltip="Adds a value to the end of a list.",
        help="The initial value of a variable is 0: set it to an empty list before you add items.",
        example="For example: add the name that was heard to “names”.",
        python="add_item(%LIST, %VALUE)",
        arguments=(ValueInput("VALUE", None, "apple"), _LIST),
        search_words="append, push, put, insert, element",
    ),
    _statement(
        "lists_insert",
        "insert %VALUE as %WHERE %NUMBER of %LIST",
        icon="list-plus",
        tooltip="Inserts a value into a list; the items after it move down by one.",
        example="For example: insert “first of all” as first item of “tasks”.",
        python=_templates_by_position("insert_item(%LIST, @, %VALUE)", _POSITIONS),
        arguments=(ValueInput("VALUE", None, "apple"), ChoiceField("WHERE", _POSITIONS), _NUMBER, _LIST),
        variant="WHERE",
        search_words="add, put, push, element, between",
    ),
    _statement(
        "lists_set",
        "set %WHERE %NUMBER of %LIST to %VALUE",
        icon="square-pen",
        tooltip="Replaces an item of a list with another value.",
        example="For example: set item number 2 of “marks” to 6.",
        python=_templates_by_position("set_item(%LIST, @, %VALUE)"),
        arguments=(_WHERE, _NUMBER, _LIST, ValueInput("VALUE", None, "apple")),
        variant="WHERE",
        search_words="replace, change, element, item, overwrite",
    ),
    _remove_block(
        "lists_remove",
        "remove %WHERE %NUMBER of %LIST",
        shape="statement",
        tooltip="Removes an item from a list; the items after it move up by one.",
        example="For example: remove first item of “tasks” when it is done.",
        search_words="delete, drop, pop, erase, element",
    ),
    _remove_block(
        "lists_take",
        "take out %WHERE %NUMBER of %LIST",
        shape="value",
        tooltip="Removes an item from a list and returns it.",
        help="To go through a list in a random order: take out a random item until the list is empty.",
        example="For example: to tell each joke only once, say the value of "
        "“take out a random item of jokes”.",
        search_words="pop, draw, remove, delete, pull",
    ),
    _statement(
        "lists_clear",
        "remove all items of %LIST",
        icon="list-x",
        tooltip="Removes all items from a list.",
        example="For example: when started, remove all items of “answers”.",
        python="clear_list(%LIST)",
        arguments=(_LIST,),
        search_words="delete, empty, reset, clear, erase",
    ),
    _statement(
        "lists_each",
        "for each item %VAR in %LIST %BODY",
        icon="repeat",
        tooltip="Runs the blocks inside once for each item; the variable holds the item.",
        help="The loop uses a copy of the list, so changes inside the loop don't affect it.",
        example="For example: for each item “name” in “names”: say “name”.",
        python="for %VAR in each(%LIST):\n    %BODY",
        arguments=(VariableField("VAR", "item"), _LIST, StatementInput("BODY")),
        search_words="loop, repeat, for, foreach, iterate, every, cycle",
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
    blocks=(*_CREATE_BLOCKS, *_READ_BLOCKS, *_AGGREGATE_BLOCKS, *_CHANGE_BLOCKS),
    headings={
        "lists_empty": "Make a list",
        "lists_get": "Read a list",
        "lists_total": "Calculate and sort",
        "lists_add": "Change a list",
    },
)
