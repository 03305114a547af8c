"""Category Logic: true and false, comparisons, and, or, not."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, ValueInput

_COMPARISON_TEMPLATES = {
    "==": "%A == %B",
    "!=": "%A != %B",
    "<": "%A < %B",
    "<=": "%A <= %B",
    ">": "%A > %B",
    ">=": "%A >= %B",
}
_RELATIONS = (
    ("is below", "<"),
    ("is above", ">"),
    ("is", "=="),
    ("is not", "!="),
    ("is at most", "<="),
    ("is at least", ">="),
)

CATEGORY = Category(
    name="logic",
    title="Logic",
    style="values",
    icon="equal",
    order=25,
    parent="numbers",
    blocks=(
        Block(
            type="values_compare",
            text="%A %RELATION %B",
            shape="boolean",
            style="values",
            icon="",
            tooltip="Compares two values.",
            example="For example: if “distance is below 0.5”, stop.",
            python=_COMPARISON_TEMPLATES,
            arguments=(
                ValueInput("A", None, 10),
                ValueInput("B", None, 20),
                ChoiceField("RELATION", _RELATIONS),
            ),
            variant="RELATION",
            check="Boolean",
            search_words="compare, greater!, less!, equals!, equal!, smaller, larger, bigger, more than, "
            "less than, "
            "greater than, same, different, between, =, <, >, ≠, ≤, ≥, ==, !=, <=, >=",
        ),
        Block(
            type="values_logic",
            text="%A %LOGIC %B",
            shape="boolean",
            style="values",
            icon="",
            tooltip="“and” is true if both conditions are true, “or” if at least one is true.",
            example="For example: if “sees a face” and “battery is above 20”, dance.",
            python={"and": "%A and %B", "or": "%A or %B"},
            arguments=(
                ValueInput("A", "Boolean"),
                ValueInput("B", "Boolean"),
                ChoiceField("LOGIC", (("and", "and"), ("or", "or"))),
            ),
            variant="LOGIC",
            check="Boolean",
            can_fail=False,
            search_words="both, either, boolean, condition, all of, any of, &&, ||",
        ),
        Block(
            type="values_not",
            text="not %A",
            shape="boolean",
            style="values",
            icon="",
            tooltip="True if the condition is false.",
            example="For example: wait until not “sees a face”, then say “Goodbye”.",
            python="not %A",
            arguments=(ValueInput("A", "Boolean"),),
            check="Boolean",
            can_fail=False,
            search_words="opposite, invert, negate, unless, false, !",
        ),
        Block(
            type="values_boolean",
            text="%VALUE",
            shape="boolean",
            style="values",
            icon="",
            tooltip="True or false.",
            help="Robots say “yes” or “no”; the console shows the same.",
            example="For example: set “greeted” to true, and check it later with “if”.",
            python="%VALUE",
            arguments=(ChoiceField("VALUE", (("true", True), ("false", False))),),
            check="Boolean",
            can_fail=False,
            search_words="yes, no, on, off, boolean, bool, constant",
        ),
        Block(
            type="values_known",
            text="%A is known",
            shape="boolean",
            style="values",
            icon="",
            tooltip="True if the sensor or topic has already reported a value.",
            example="For example: wait until “newest name of /faces” is known.",
            python="is_known(%A)",
            arguments=(ValueInput("A"),),
            check="Boolean",
            can_fail=False,
            search_words="exists, available, defined, none, null, empty, has value, already",
        ),
    ),
)
