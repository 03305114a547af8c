"""Detection of variables that are never set, and of broadcasts that are never sent or received."""

from __future__ import annotations

from app.blocks.compiler.problems import ProblemCollector
from app.blocks.model.block import Block
from app.blocks.model.fields import BroadcastField, FieldError, ValueInput, VariableField
from app.blocks.model.mutators import InputField
from app.blocks.model.workspace import PlacedBlock, Workspace

_READS, _CHANGES, _RECEIVES = "variables_get", "variables_change", "events_received"


class NameUsage:
    """Collector of the variables and broadcasts that the running blocks of a workspace use."""

    def __init__(self) -> None:
        self._first_reads: dict[str, tuple[PlacedBlock, Block]] = {}  # by id of the variable
        self._set_ids: set[str] = set()
        self._changed_ids: set[str] = set()  # counting up from the initial 0 is fine
        self._list_ids: set[str] = set()
        self._first_sends: dict[str, tuple[PlacedBlock, Block]] = {}  # by name of the broadcast
        self._first_receives: dict[str, tuple[PlacedBlock, Block]] = {}

    def add(self, placed_block: PlacedBlock, block: Block) -> None:
        """Record which variables a block reads or sets, and which broadcasts it sends or receives."""
        for argument in block.arguments:
            if isinstance(argument, ValueInput) and (argument.check == "List" or argument.variable == "list"):
                inner = placed_block.inputs.get(argument.name, ())
                if inner and inner[0].type == _READS:
                    self._list_ids.add(_variable_id(inner[0]))
            elif isinstance(argument, VariableField) and not isinstance(argument, InputField):
                self._add_variable(placed_block, block)
            elif isinstance(argument, BroadcastField):
                usage = self._first_receives if block.type == _RECEIVES else self._first_sends
                usage.setdefault(_broadcast_name(argument, placed_block), (placed_block, block))

    def _add_variable(self, placed_block: PlacedBlock, block: Block) -> None:
        id = _variable_id(placed_block)
        if block.type == _READS:
            self._first_reads.setdefault(id, (placed_block, block))
        elif block.type == _CHANGES:
            self._changed_ids.add(id)
        else:
            self._set_ids.add(id)

    def report(self, problems: ProblemCollector, workspace: Workspace) -> None:
        """Report variables that are read but never set, and broadcasts without a sender or receiver."""
        for id, (placed_block, block) in self._first_reads.items():
            is_list = id in self._list_ids
            if id not in self._set_ids and (is_list or id not in self._changed_ids):
                problems.report_never_set(
                    placed_block, block, id, workspace.variables.get(id, id), is_list=is_list
                )
        for name, (placed_block, block) in self._first_sends.items():
            if name not in self._first_receives:
                problems.report_never_received(placed_block, block, name)
        for name, (placed_block, block) in self._first_receives.items():
            if name not in self._first_sends:
                problems.report_never_sent(placed_block, block, name)


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
