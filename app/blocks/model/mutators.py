"""Arguments that the user adds and removes on the block: items of a list, inputs of a function.

The editor saves these arguments in the block's ``extraState``, which is validated because a file may contain
anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from app.blocks.model.fields import Argument, Check, StatementInput, Translate, ValueInput, VariableField
from app.blocks.model.workspace import PlacedBlock

MAX_ITEMS = 50
MAX_INPUTS = 12
MAX_ELSE_IFS = 20
MAX_NAME_LENGTH = 60


@dataclass(frozen=True)
class Items(Argument):
    """Variable number of slots ``<name>0``, ``<name>1``, …, whose values fill the placeholder as one list."""

    count: int = 3
    texts: tuple[str, ...] = ()  # initial texts in the toolbox

    def initial_inputs(self) -> dict[str, object]:
        """Return a shadow text block for each of the initial texts, by name of the slot."""
        return {
            f"{self.name}{number}": {"shadow": {"type": "values_text", "fields": {"TEXT": text}}}
            for number, text in enumerate(self.texts)
        }

    def translated(self, translate: Translate) -> Argument:
        """Return the argument with its initial texts translated."""
        return replace(self, texts=tuple(translate("example", text) for text in self.texts))

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of an empty input, at which the editor's mutator inserts the slots."""
        return {"type": "input_dummy", "name": self.name}

    def slots(self, extra: Mapping[str, object]) -> tuple[ValueInput, ...]:
        """Return the slots of a placed block.

        Args:
            extra: Saved ``extraState`` of the block; the number of slots defaults to `count`.
        """
        count = extra.get("items")
        is_valid = isinstance(count, int) and not isinstance(count, bool)
        slot_count = min(max(int(count), 0), MAX_ITEMS) if is_valid and isinstance(count, int) else self.count
        return tuple(ValueInput(f"{self.name}{number}") for number in range(slot_count))


@dataclass(frozen=True)
class ListInput(ValueInput):
    """Slot for a list, which contains an extensible list block in the toolbox.

    Attributes:
        check: Type of the accepted values.
        texts: Initial texts of the list block.
    """

    check: Check | None = "List"
    texts: tuple[str, ...] = ()

    def initial_inputs(self) -> dict[str, object]:
        """Return a list block with the initial texts. Not a shadow block, so that its slots accept values."""
        items = Items("ITEM", len(self.texts), self.texts)
        list_block = {
            "type": "lists_create",
            "extraState": {"items": items.count},
            "inputs": items.initial_inputs(),
        }
        return {self.name: {"block": list_block}}

    def translated(self, translate: Translate) -> Argument:
        """Return the argument with the initial texts translated."""
        return replace(self, texts=tuple(translate("example", text) for text in self.texts))


@dataclass(frozen=True)
class Branches:
    """Branches of an "if" after the first one.

    Attributes:
        else_ifs: Number of "else if" branches.
        has_else: True if there is an "else" branch.
    """

    else_ifs: int = 0
    has_else: bool = False

    @classmethod
    def from_extra_state(cls, extra: Mapping[str, object], *, has_else: bool) -> Branches:
        """Parse the saved state of a block; invalid values are replaced by defaults.

        Args:
            extra: Saved ``extraState`` of the block.
            has_else: Default for the "else" branch.
        """
        count, saved_has_else = extra.get("elseIfs"), extra.get("else")
        is_valid = isinstance(count, int) and not isinstance(count, bool)
        else_if_count = min(max(int(count), 0), MAX_ELSE_IFS) if is_valid and isinstance(count, int) else 0
        return cls(else_if_count, saved_has_else if isinstance(saved_has_else, bool) else has_else)

    def arguments(self) -> tuple[Argument, ...]:
        """Return the slots of these branches in order."""
        slots: list[Argument] = []
        for number in range(1, self.else_ifs + 1):
            slots += [ValueInput(f"CONDITION{number}", "Boolean"), StatementInput(f"BODY{number}")]
        return (*slots, StatementInput("ELSE")) if self.has_else else tuple(slots)


@dataclass(frozen=True)
class FunctionInput:
    """Input of a function.

    Attributes:
        id: Id that never changes.
        name: Name, which the user can change.
    """

    id: str
    name: str


def inputs_of(extra: Mapping[str, object]) -> tuple[FunctionInput, ...]:
    """Return the inputs of a function definition or call, at most `MAX_INPUTS`; duplicate ids are dropped.

    Args:
        extra: Saved ``extraState`` of the block.
    """
    saved = extra.get("inputs")
    inputs_by_id: dict[str, FunctionInput] = {}
    for saved_input in saved if isinstance(saved, list) else ():
        if isinstance(saved_input, Mapping) and isinstance(saved_input.get("id"), str) and saved_input["id"]:
            name = str(saved_input.get("name") or "input")[:MAX_NAME_LENGTH]
            inputs_by_id.setdefault(str(saved_input["id"]), FunctionInput(str(saved_input["id"]), name))
    return tuple(inputs_by_id.values())[:MAX_INPUTS]


@dataclass(frozen=True)
class Inputs(Argument):
    """Inputs of a function: names on the definition, slots ``IN_<id>`` on the calls."""

    @property
    def is_display_only(self) -> bool:
        """True, because the compiler converts the inputs to parameters and arguments."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of an empty input, at which the editor's mutator inserts names or slots."""
        return {"type": "input_dummy", "name": self.name}

    def slots(self, inputs: tuple[FunctionInput, ...]) -> tuple[tuple[FunctionInput, ValueInput], ...]:
        """Return pairs of an input and its slot on a call."""
        return tuple((each, ValueInput(f"IN_{each.id}")) for each in inputs)


@dataclass(frozen=True)
class InputField(VariableField):
    """Field for an input of the surrounding function; the compiler resolves its name."""

    value: str = "input"

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's field that displays the name of the input."""
        return {"type": "field_function_input", "name": self.name}


def function_name(placed_block: PlacedBlock) -> str:
    """Return the name of the function that a block defines or calls; "function" if it has no name."""
    saved = placed_block.fields.get("NAME", placed_block.extra_state.get("name"))
    return " ".join(str(saved or "function").split())[:MAX_NAME_LENGTH] or "function"
