"""Arguments that the user adds and removes on the block: items of a list, inputs of a function.

The editor saves them in ``extraState`` of the block; in a file, that may contain anything.
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
    """Row of slots ``<name>0``, ``<name>1``, …, whose values fill the placeholder as one list."""

    count: int = 3
    texts: tuple[str, ...] = ()  # initial texts in the toolbox

    def initial_inputs(self) -> dict[str, object]:
        """Return a text block for each slot."""
        return {
            f"{self.name}{number}": {"shadow": {"type": "values_text", "fields": {"TEXT": words}}}
            for number, words in enumerate(self.texts)
        }

    def translated(self, say: Translate) -> Argument:
        """Return the argument with its initial texts translated."""
        return replace(self, texts=tuple(say("example", words) for words in self.texts))

    def to_blockly(self) -> dict[str, object]:
        """Return a placeholder at which the editor's mutator inserts the slots."""
        return {"type": "input_dummy", "name": self.name}

    def slots(self, extra: Mapping[str, object]) -> tuple[ValueInput, ...]:
        """Return the slots of a block with this saved state."""
        count = extra.get("items")
        sound = isinstance(count, int) and not isinstance(count, bool)
        many = min(max(int(count), 0), MAX_ITEMS) if sound and isinstance(count, int) else self.count
        return tuple(ValueInput(f"{self.name}{number}") for number in range(many))


@dataclass(frozen=True)
class ListInput(ValueInput):
    """Slot for a list.

    In the toolbox, the slot contains a list block with these texts, which can be extended.
    """

    check: Check | None = "List"
    texts: tuple[str, ...] = ()

    def initial_inputs(self) -> dict[str, object]:
        """Return a list block that is not a shadow block, because values can be put into its slots."""
        items = Items("ITEM", len(self.texts), self.texts)
        held = {
            "type": "lists_create",
            "extraState": {"items": items.count},
            "inputs": items.initial_inputs(),
        }
        return {self.name: {"block": held}}

    def translated(self, say: Translate) -> Argument:
        """Return the argument with the initial texts translated."""
        return replace(self, texts=tuple(say("example", words) for words in self.texts))


@dataclass(frozen=True)
class Branches:
    """Further branches of an "if": the number of "else if", and ``has_else``, True if there is an "else"."""

    else_ifs: int = 0
    has_else: bool = False

    @classmethod
    def from_extra_state(cls, extra: Mapping[str, object], *, has_else: bool) -> Branches:
        """Parse the saved state of a block; by default no "else if", and an "else" as given by the type."""
        count, told = extra.get("elseIfs"), extra.get("else")
        sound = isinstance(count, int) and not isinstance(count, bool)
        many = min(max(int(count), 0), MAX_ELSE_IFS) if sound and isinstance(count, int) else 0
        return cls(many, told if isinstance(told, bool) else has_else)

    def arguments(self) -> tuple[Argument, ...]:
        """Return the slots of these branches in order."""
        found: list[Argument] = []
        for number in range(1, self.else_ifs + 1):
            found += [ValueInput(f"CONDITION{number}", "Boolean"), StatementInput(f"BODY{number}")]
        return (*found, StatementInput("ELSE")) if self.has_else else tuple(found)


@dataclass(frozen=True)
class FunctionInput:
    """Input of a function: an id that never changes, and a name that the user can change."""

    id: str
    name: str


def inputs_of(extra: Mapping[str, object]) -> tuple[FunctionInput, ...]:
    """Return the saved inputs of a function definition or call; duplicate ids are dropped."""
    saved = extra.get("inputs")
    found: dict[str, FunctionInput] = {}
    for each in saved if isinstance(saved, list) else ():
        if isinstance(each, Mapping) and isinstance(each.get("id"), str) and each["id"]:
            name = str(each.get("name") or "input")[:MAX_NAME_LENGTH]
            found.setdefault(str(each["id"]), FunctionInput(str(each["id"]), name))
    return tuple(found.values())[:MAX_INPUTS]


@dataclass(frozen=True)
class Inputs(Argument):
    """Inputs of a function: names on its definition, slots ``IN_<id>`` on its calls."""

    @property
    def is_display_only(self) -> bool:
        """True: the compiler converts them to parameters and arguments."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """Return a placeholder at which the editor's mutator inserts names or slots."""
        return {"type": "input_dummy", "name": self.name}

    def slots(self, inputs: tuple[FunctionInput, ...]) -> tuple[tuple[FunctionInput, ValueInput], ...]:
        """Return each input of a call with its slot."""
        return tuple((each, ValueInput(f"IN_{each.id}")) for each in inputs)


@dataclass(frozen=True)
class InputField(VariableField):
    """Input of the surrounding function. The compiler resolves the name."""

    value: str = "input"

    def to_blockly(self) -> dict[str, object]:
        """Return our field that displays the name of the input."""
        return {"type": "field_function_input", "name": self.name}


def function_name(placed: PlacedBlock) -> str:
    """Return the name of the function that a block defines or calls."""
    saved = placed.fields.get("NAME", placed.extra_state.get("name"))
    return " ".join(str(saved or "function").split())[:MAX_NAME_LENGTH] or "function"
