"""Arguments that people add and take away on the block itself: items of a list, inputs of a function.

What there is stands in the block's ``extraState``, which the editor writes: a file may hold anything there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from app.blocks.model.fields import Argument, Check, Say, StatementInput, ValueInput, VariableField
from app.blocks.model.workspace import Placed

MOST_ITEMS = 50
MOST_INPUTS = 12
MOST_ELSE_IFS = 20
LONGEST_NAME = 60


@dataclass(frozen=True)
class Items(Argument):
    """Gaps in a row, ``<name>0``, ``<name>1``, …; their hole gets one list of all their values."""

    count: int = 3
    texts: tuple[str, ...] = ()  # what the gaps hold in the toolbox

    def fillings(self) -> dict[str, object]:
        """A text in each gap."""
        return {
            f"{self.name}{number}": {"shadow": {"type": "values_text", "fields": {"TEXT": words}}}
            for number, words in enumerate(self.texts)
        }

    def translated(self, say: Say) -> Argument:
        """What the gaps hold at first."""
        return replace(self, texts=tuple(say("example", words) for words in self.texts))

    def to_blockly(self) -> dict[str, object]:
        """A place: the editor's mutator puts the gaps there."""
        return {"type": "input_dummy", "name": self.name}

    def gaps(self, extra: Mapping[str, object]) -> tuple[ValueInput, ...]:
        """The gaps that a block has."""
        count = extra.get("items")
        sound = isinstance(count, int) and not isinstance(count, bool)
        many = min(max(int(count), 0), MOST_ITEMS) if sound and isinstance(count, int) else self.count
        return tuple(ValueInput(f"{self.name}{number}") for number in range(many))


@dataclass(frozen=True)
class ListInput(ValueInput):
    """A gap for a list; out of the toolbox it holds a list with these texts, whose gaps can be added to."""

    check: Check | None = "List"
    texts: tuple[str, ...] = ()

    def fillings(self) -> dict[str, object]:
        """A block of its own, not a shadow: values go into the list's gaps, too."""
        items = Items("ITEM", len(self.texts), self.texts)
        held = {"type": "lists_create", "extraState": {"items": items.count}, "inputs": items.fillings()}
        return {self.name: {"block": held}}

    def translated(self, say: Say) -> Argument:
        """What the list holds at first."""
        return replace(self, texts=tuple(say("example", words) for words in self.texts))


@dataclass(frozen=True)
class Branches:
    """What an *if* has besides its first branch: so many “else if”, and whether an “else”."""

    else_ifs: int = 0
    has_else: bool = False

    @classmethod
    def of(cls, extra: Mapping[str, object], *, has_else: bool) -> Branches:
        """What a block says; one that says nothing has no “else if”, and an “else” as its kind has."""
        count, told = extra.get("elseIfs"), extra.get("else")
        sound = isinstance(count, int) and not isinstance(count, bool)
        many = min(max(int(count), 0), MOST_ELSE_IFS) if sound and isinstance(count, int) else 0
        return cls(many, told if isinstance(told, bool) else has_else)

    def arguments(self) -> tuple[Argument, ...]:
        """The gaps and mouths of these branches, in their order."""
        found: list[Argument] = []
        for number in range(1, self.else_ifs + 1):
            found += [ValueInput(f"CONDITION{number}", "Boolean"), StatementInput(f"BODY{number}")]
        return (*found, StatementInput("ELSE")) if self.has_else else tuple(found)


@dataclass(frozen=True)
class FunctionInput:
    """An input of a function: its id, which stays, and its name, which people change."""

    id: str
    name: str


def inputs_of(extra: Mapping[str, object]) -> tuple[FunctionInput, ...]:
    """The inputs that a definition or a call says it has; each id once."""
    saved = extra.get("inputs")
    found: dict[str, FunctionInput] = {}
    for each in saved if isinstance(saved, list) else ():
        if isinstance(each, Mapping) and isinstance(each.get("id"), str) and each["id"]:
            name = str(each.get("name") or "input")[:LONGEST_NAME]
            found.setdefault(str(each["id"]), FunctionInput(str(each["id"]), name))
    return tuple(found.values())[:MOST_INPUTS]


@dataclass(frozen=True)
class Inputs(Argument):
    """The inputs of a function: names on its definition, gaps ``IN_<id>`` on its calls."""

    @property
    def silent(self) -> bool:
        """The compiler makes them parameters and arguments; no hole is theirs."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """A place: the editor's mutator puts names or gaps there."""
        return {"type": "input_dummy", "name": self.name}

    def gaps(self, inputs: tuple[FunctionInput, ...]) -> tuple[tuple[FunctionInput, ValueInput], ...]:
        """The gap of each input on a call."""
        return tuple((each, ValueInput(f"IN_{each.id}")) for each in inputs)


@dataclass(frozen=True)
class InputField(VariableField):
    """An input of the function that the block is in; the compiler looks its name up."""

    value: str = "input"

    def to_blockly(self) -> dict[str, object]:
        """Our field that shows the input's name."""
        return {"type": "field_function_input", "name": self.name}


def name_of(placed: Placed) -> str:
    """The name of the function that a definition or a call names."""
    saved = placed.fields.get("NAME", placed.extra.get("name"))
    return " ".join(str(saved or "function").split())[:LONGEST_NAME] or "function"
