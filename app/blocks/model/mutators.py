"""Arguments that people add and remove on the block itself: items of a list, inputs of a function.

They are saved in the block's ``extraState`` by the editor; files may contain anything there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from app.blocks.model.fields import Argument, Check, Say, StatementInput, ValueInput, VariableField
from app.blocks.model.workspace import Placed

MAX_ITEMS = 50
MAX_INPUTS = 12
MAX_ELSE_IFS = 20
MAX_NAME_LENGTH = 60


@dataclass(frozen=True)
class Items(Argument):
    """Gaps in a row, ``<name>0``, ``<name>1``, …; the hole gets one list of their values."""

    count: int = 3
    texts: tuple[str, ...] = ()  # initial texts in the toolbox

    def fillings(self) -> dict[str, object]:
        """Return a text in each gap."""
        return {
            f"{self.name}{number}": {"shadow": {"type": "values_text", "fields": {"TEXT": words}}}
            for number, words in enumerate(self.texts)
        }

    def translated(self, say: Say) -> Argument:
        """Return the argument with its initial texts translated."""
        return replace(self, texts=tuple(say("example", words) for words in self.texts))

    def to_blockly(self) -> dict[str, object]:
        """Return a placeholder, where the editor's mutator inserts the gaps."""
        return {"type": "input_dummy", "name": self.name}

    def gaps(self, extra: Mapping[str, object]) -> tuple[ValueInput, ...]:
        """Return the gaps of a block."""
        count = extra.get("items")
        sound = isinstance(count, int) and not isinstance(count, bool)
        many = min(max(int(count), 0), MAX_ITEMS) if sound and isinstance(count, int) else self.count
        return tuple(ValueInput(f"{self.name}{number}") for number in range(many))


@dataclass(frozen=True)
class ListInput(ValueInput):
    """Gap for a list; in the toolbox it contains a list block with these texts, which can be extended."""

    check: Check | None = "List"
    texts: tuple[str, ...] = ()

    def fillings(self) -> dict[str, object]:
        """Return a real block instead of a shadow, because its own gaps accept values."""
        items = Items("ITEM", len(self.texts), self.texts)
        held = {"type": "lists_create", "extraState": {"items": items.count}, "inputs": items.fillings()}
        return {self.name: {"block": held}}

    def translated(self, say: Say) -> Argument:
        """Return the argument with the initial texts translated."""
        return replace(self, texts=tuple(say("example", words) for words in self.texts))


@dataclass(frozen=True)
class Branches:
    """Further branches of an *if*: the number of “else if”, and whether there is an “else”."""

    else_ifs: int = 0
    has_else: bool = False

    @classmethod
    def of(cls, extra: Mapping[str, object], *, has_else: bool) -> Branches:
        """Read a block's saved state; the default is no “else if”, and an “else” as its type has."""
        count, told = extra.get("elseIfs"), extra.get("else")
        sound = isinstance(count, int) and not isinstance(count, bool)
        many = min(max(int(count), 0), MAX_ELSE_IFS) if sound and isinstance(count, int) else 0
        return cls(many, told if isinstance(told, bool) else has_else)

    def arguments(self) -> tuple[Argument, ...]:
        """Return the gaps of these branches in order."""
        found: list[Argument] = []
        for number in range(1, self.else_ifs + 1):
            found += [ValueInput(f"CONDITION{number}", "Boolean"), StatementInput(f"BODY{number}")]
        return (*found, StatementInput("ELSE")) if self.has_else else tuple(found)


@dataclass(frozen=True)
class FunctionInput:
    """Input of a function: a constant id, and a name that people change."""

    id: str
    name: str


def inputs_of(extra: Mapping[str, object]) -> tuple[FunctionInput, ...]:
    """Return the saved inputs of a definition or call, without duplicate ids."""
    saved = extra.get("inputs")
    found: dict[str, FunctionInput] = {}
    for each in saved if isinstance(saved, list) else ():
        if isinstance(each, Mapping) and isinstance(each.get("id"), str) and each["id"]:
            name = str(each.get("name") or "input")[:MAX_NAME_LENGTH]
            found.setdefault(str(each["id"]), FunctionInput(str(each["id"]), name))
    return tuple(found.values())[:MAX_INPUTS]


@dataclass(frozen=True)
class Inputs(Argument):
    """Inputs of a function: names on its definition, gaps ``IN_<id>`` on its calls."""

    @property
    def silent(self) -> bool:
        """True: the compiler turns them into parameters and arguments."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """Return a placeholder, where the editor's mutator inserts names or gaps."""
        return {"type": "input_dummy", "name": self.name}

    def gaps(self, inputs: tuple[FunctionInput, ...]) -> tuple[tuple[FunctionInput, ValueInput], ...]:
        """Return the gap of each input on a call."""
        return tuple((each, ValueInput(f"IN_{each.id}")) for each in inputs)


@dataclass(frozen=True)
class InputField(VariableField):
    """Input of the surrounding function; the compiler resolves its name."""

    value: str = "input"

    def to_blockly(self) -> dict[str, object]:
        """Return our field that shows the input's name."""
        return {"type": "field_function_input", "name": self.name}


def name_of(placed: Placed) -> str:
    """Return the function name of a definition or call."""
    saved = placed.fields.get("NAME", placed.extra.get("name"))
    return " ".join(str(saved or "function").split())[:MAX_NAME_LENGTH] or "function"
