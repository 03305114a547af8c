"""Detection of variables that are never set, and of broadcasts that are never sent or received."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from app.blocks.compiler.problem_list import ProblemList
from app.blocks.model.block import Block
from app.blocks.model.fields import BroadcastField, FieldError, ValueInput, VariableField
from app.blocks.model.mutators import InputField
from app.blocks.model.workspace import PlacedBlock

_READS, _CHANGES, _RECEIVES = "variables_get", "variables_change", "events_received"


class NameUsage:
    """Collector of the variables and broadcasts that the running blocks of a page use.

    Args:
        variables: Names of the page's variables by id.
    """

    def __init__(self, variables: Mapping[str, str] | None = None) -> None:
        self._variables = variables or {}
        self.first_reads: dict[str, tuple[PlacedBlock, Block, str]] = {}  # by id of the variable
        self.set_ids: set[str] = set()
        self.changed_ids: set[str] = set()  # counting up from the initial 0 is fine
        self.list_ids: set[str] = set()
        self.first_sends: dict[str, tuple[PlacedBlock, Block]] = {}  # by name of the broadcast
        self.first_receives: dict[str, tuple[PlacedBlock, Block]] = {}

    def add(self, placed_block: PlacedBlock, block: Block) -> None:
        """Record which variables a block reads or sets, and which broadcasts it sends or receives."""
        for argument in block.arguments:
            if isinstance(argument, ValueInput) and (argument.check == "List" or argument.variable == "list"):
                inner = placed_block.inputs.get(argument.name, ())
                if inner and inner[0].type == _READS:
                    self.list_ids.add(_variable_id(inner[0]))
            elif isinstance(argument, VariableField) and not isinstance(argument, InputField):
                self._add_variable(placed_block, block)
            elif isinstance(argument, BroadcastField):
                usage = self.first_receives if block.type == _RECEIVES else self.first_sends
                usage.setdefault(_broadcast_name(argument, placed_block), (placed_block, block))

    def _add_variable(self, placed_block: PlacedBlock, block: Block) -> None:
        id = _variable_id(placed_block)
        if block.type == _READS:
            self.first_reads.setdefault(id, (placed_block, block, self._variables.get(id, id)))
        elif block.type == _CHANGES:
            self.changed_ids.add(id)
        else:
            self.set_ids.add(id)

    @classmethod
    def merge(cls, usages: Iterable[NameUsage]) -> NameUsage:
        """Return the usage of several pages, which share their variables and broadcasts."""
        merged = cls()
        for usage in usages:
            for id, read in usage.first_reads.items():
                merged.first_reads.setdefault(id, read)
            for name, send in usage.first_sends.items():
                merged.first_sends.setdefault(name, send)
            for name, receive in usage.first_receives.items():
                merged.first_receives.setdefault(name, receive)
            merged.set_ids |= usage.set_ids
            merged.changed_ids |= usage.changed_ids
            merged.list_ids |= usage.list_ids
        return merged

    def report(self, problems: ProblemList) -> None:
        """Report variables that are read but never set, and broadcasts without a sender or receiver."""
        for id, (placed_block, block, variable_name) in self.first_reads.items():
            is_list = id in self.list_ids
            if id not in self.set_ids and (is_list or id not in self.changed_ids):
                problems.add_never_set(placed_block, block, id, variable_name, is_list=is_list)
        for name, (placed_block, block) in self.first_sends.items():
            if name not in self.first_receives:
                problems.add_never_received(placed_block, block, name)
        for name, (placed_block, block) in self.first_receives.items():
            if name not in self.first_sends:
                problems.add_never_sent(placed_block, block, name)


def _variable_id(placed_block: PlacedBlock) -> str:
    try:
        return str(VariableField("VAR").read(placed_block.fields.get("VAR")))
    except FieldError:
        return ""


def _broadcast_name(field: BroadcastField, placed_block: PlacedBlock) -> str:
    try:
        return str(field.read(placed_block.fields.get(field.name)))
    except FieldError:
        return ""
