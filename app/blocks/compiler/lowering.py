"""Lowering: blocks with a variable number of slots are rewritten to blocks with a fixed number of slots.

Such blocks are lists of n items, ifs with n branches, and function calls. A workspace is rewritten once
before it is compiled: each such block gets a type that only it uses, whose description is added to the
catalogue.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from app.blocks.compiler.program_names import PageNames
from app.blocks.model.block import Block
from app.blocks.model.fields import Argument, ValueInput
from app.blocks.model.mutators import Branches, FunctionInput, Inputs, Items, function_name, inputs_of
from app.blocks.model.workspace import (
    PLAIN_CALL,
    PLAIN_FUNCTION,
    RESULT_CALL,
    RESULT_FUNCTION,
    PlacedBlock,
    Workspace,
)
from app.blocks.toolbox.catalogue import Catalogue
from nep.i18n import _

END_BLOCK = "functions_end"
_HAS_RESULT = {PLAIN_FUNCTION: False, RESULT_FUNCTION: True}


@dataclass(frozen=True)
class Function:
    """Function defined in a behaviour.

    Attributes:
        definition: Block that defines the function.
        name: Name given by the user.
        python_name: Name in the program.
        parameters: Python names of the inputs, by id of the input.
        inputs: Inputs in order.
        has_result: True if the function returns a result.
    """

    definition: PlacedBlock
    name: str
    python_name: str
    parameters: Mapping[str, str]
    inputs: tuple[FunctionInput, ...]
    has_result: bool


ModuleKey = tuple[Literal["id", "name"], str]
"""Id or name of a function, by which a call on another page refers to it."""


@dataclass(frozen=True)
class ModuleFunction:
    """Part of a function on a module page that its callers on other pages depend on.

    Attributes:
        definition_id: Id of the block that defines the function, unique in the project.
        name: Name given by the user.
        inputs: Inputs in order.
        has_result: True if the function returns a result.
    """

    definition_id: str
    name: str
    inputs: tuple[FunctionInput, ...]
    has_result: bool


def module_functions(workspace: Workspace, block_prefix: str) -> dict[ModuleKey, ModuleFunction]:
    """Return the functions that a module page defines, by id and by name.

    Args:
        workspace: Parsed page.
        block_prefix: Prefix of the ids of its blocks.
    """
    functions: dict[ModuleKey, ModuleFunction] = {}
    for script in workspace.scripts:
        first = script[0]
        if first.type in _HAS_RESULT and first.is_enabled:
            name = function_name(first)
            function = ModuleFunction(first.id, name, inputs_of(first.extra_state), _HAS_RESULT[first.type])
            functions["id", first.id.removeprefix(block_prefix)] = function
            functions.setdefault(("name", name), function)
    return functions


class Lowering:
    """Rewriting of a workspace, and look-up of its functions.

    Args:
        workspace: Parsed page.
        catalogue: Block descriptions, to which those of the rewritten blocks are added.
        names: Names in the page.
        modules: Functions of other pages that can be called.
        block_prefix: Prefix of the ids of the page's blocks.

    Attributes:
        workspace: Rewritten workspace.
        variables: Names of the variables by id, without the inputs of functions.
        module_lookups: Results of all look-ups in ``modules``.
    """

    def __init__(
        self,
        workspace: Workspace,
        catalogue: Catalogue,
        names: PageNames,
        modules: Mapping[ModuleKey, ModuleFunction],
        block_prefix: str,
    ) -> None:
        self._catalogue, self._names, self._block_prefix = catalogue, names, block_prefix
        self._modules, self._called_functions = modules, dict[str, Function]()
        self.module_lookups: dict[ModuleKey, ModuleFunction | None] = {}
        self.variables = workspace.variables  # without inputs of functions
        self._functions_by_id: dict[str, Function] = {}
        for script in workspace.scripts:
            if script[0].type in _HAS_RESULT and script[0].is_enabled:
                self._functions_by_id[script[0].id] = _parse_function(script[0], names)
        self._functions_by_name = {
            function.name: function for function in reversed(self._functions_by_id.values())
        }
        scripts = tuple(tuple(map(self._lower, script)) for script in workspace.scripts)
        input_names = {
            each.id: each.name for function in self._functions_by_id.values() for each in function.inputs
        }
        self.workspace = replace(workspace, scripts=scripts, variables={**workspace.variables, **input_names})

    def function(self, definition: PlacedBlock) -> Function | None:
        """Return the function that a block defines; None for disabled blocks and other blocks."""
        return self._functions_by_id.get(definition.id)

    def called_function(self, placed_block: PlacedBlock) -> Function | None:
        """Return the function that a block of the rewritten `workspace` calls; None if there is none."""
        kind = placed_block.type.partition(":")[0]
        function = self._find_function(placed_block) if kind in (PLAIN_CALL, RESULT_CALL) else None
        if function is None:
            return None
        definitions = (script[0] for script in self.workspace.scripts)
        return next(
            (replace(function, definition=each) for each in definitions if each.id == function.definition.id),
            None,
        )

    def _find_function(self, placed_block: PlacedBlock) -> Function | None:
        id, name = str(placed_block.extra_state.get("function")), function_name(placed_block)
        function = (
            self._functions_by_id.get(self._block_prefix + id)
            or self._find_in_modules(("id", id))
            or self._functions_by_name.get(name)
            or self._find_in_modules(("name", name))
        )
        return (
            None
            if function is None or (placed_block.type == RESULT_CALL and not function.has_result)
            else function
        )

    def _find_in_modules(self, key: ModuleKey) -> Function | None:
        function = self.module_lookups[key] = self._modules.get(key)
        if function is None:
            return None
        id = function.definition_id
        if id not in self._called_functions:
            python_name = self._names.new_name(function.name, "function", ("function", id))
            self._called_functions[id] = Function(
                PlacedBlock(id, ""), function.name, python_name, {}, function.inputs, function.has_result
            )
        return self._called_functions[id]

    def _lower(self, placed_block: PlacedBlock) -> PlacedBlock:
        inner = {name: tuple(map(self._lower, chain)) for name, chain in placed_block.inputs.items()}
        placed_block = replace(placed_block, inputs=inner)
        block = self._catalogue.blocks.get(placed_block.type)
        if block is None or not block.mutator:
            return placed_block
        if block.mutator == "items":
            return self._lower_list(placed_block, block)
        if block.mutator == "branches":
            return self._lower_branches(placed_block, block)
        return (
            self._lower_call(placed_block, block)
            if block.mutator == "call"
            else self._lower_definition(placed_block, block)
        )

    def _lower_list(self, placed_block: PlacedBlock, block: Block) -> PlacedBlock:
        items = next(argument for argument in block.arguments if isinstance(argument, Items))
        slots = items.slots(placed_block.extra_state)
        placeholders = [f"%{slot.name}" for slot in slots]
        placeholder = f"%{items.name}"
        expanded_block = replace(
            block,
            type=f"{block.type}:{len(slots)}",
            text=block.text.replace(placeholder, " ".join(placeholders)),
            python=str(block.python).replace(placeholder, ", ".join(placeholders)),
            arguments=slots,
        )
        return self._register_type(placed_block, expanded_block)

    def _lower_branches(self, placed_block: PlacedBlock, block: Block) -> PlacedBlock:
        branches = Branches.from_extra_state(
            placed_block.extra_state, has_else=block.argument("ELSE") is not None
        )
        text, python = block.text.partition("%BODY")[0] + "%BODY", "if %CONDITION:\n    %BODY"
        for number in range(1, branches.else_ifs + 1):
            text += f" {_('else if')} %CONDITION{number} %BODY{number}"
            python += f"\nelif %CONDITION{number}:\n    %BODY{number}"
        if branches.has_else:
            text += f" {_('else')} %ELSE"
            python += "\nelse:\n    %ELSE"
        first = tuple(each for each in block.arguments if each.name in ("CONDITION", "BODY"))
        expanded_block = replace(
            block,
            type=f"{block.type}:{branches.else_ifs}{'+' if branches.has_else else ''}",
            text=text,
            python=python,
            arguments=(*first, *branches.arguments()),
        )
        return self._register_type(placed_block, expanded_block)

    def _lower_definition(self, placed_block: PlacedBlock, block: Block) -> PlacedBlock:
        input_names = " ".join(each.name for each in inputs_of(placed_block.extra_state))
        text = block.text.replace("%NAME", _escape_placeholders(function_name(placed_block))).replace(
            "%INPUTS", _escape_placeholders(input_names)
        )
        arguments = tuple(argument for argument in block.arguments if f"%{argument.name}" in text)
        if placed_block.type == RESULT_FUNCTION:
            result = tuple(argument for argument in arguments if argument.name == "RESULT")
            self._catalogue.blocks[f"{END_BLOCK}:{placed_block.id}"] = replace(
                block, shape="statement", text="return %RESULT", python="return %RESULT", arguments=result
            )
        return self._register_type(
            placed_block,
            replace(block, type=f"{block.type}:{placed_block.id}", text=text, arguments=arguments),
        )

    def _lower_call(self, placed_block: PlacedBlock, block: Block) -> PlacedBlock:
        function = self._find_function(placed_block)
        inputs = inputs_of(placed_block.extra_state) if function is None else function.inputs
        name = _escape_placeholders(function_name(placed_block) if function is None else function.name)
        slots, inputs_by_slot = _fill_slots(placed_block, inputs)
        text = " ".join((name, *(f"{_escape_placeholders(each.name)} %{slot.name}" for each, slot in slots)))
        expanded_block = replace(block, type=f"{block.type}:{placed_block.id}", text=text)
        if function is None:
            message = _("The function “{name}” is missing. Define it, or delete this block.").format(
                name=name
            )
            expanded_block = replace(
                expanded_block, text=name, arguments=(), python="fail(%X_SENTENCE)",
                constants={"X_SENTENCE": message}, undefined_message=message,
            )  # fmt: skip
        else:
            placeholders = ", ".join(f"%{slot.name}" for _, slot in slots)
            expanded_block = replace(
                expanded_block,
                arguments=tuple(slot for _, slot in slots),
                python=f"%X_FUNCTION({placeholders})",
                constant_trees={"X_FUNCTION": ast.Name(function.python_name, ast.Load())},
                is_function_call=True,
            )
        return self._register_type(replace(placed_block, inputs=inputs_by_slot), expanded_block)

    def _register_type(self, placed_block: PlacedBlock, block: Block) -> PlacedBlock:
        self._catalogue.blocks[block.type] = block
        return replace(placed_block, type=block.type)


def _parse_function(placed_block: PlacedBlock, names: PageNames) -> Function:
    inputs = inputs_of(placed_block.extra_state)
    name = function_name(placed_block)
    python = names.new_name(name, "function", ("function", placed_block.id))
    parameters = {each.id: names.new_name(each.name, "input") for each in inputs}
    return Function(placed_block, name, python, parameters, inputs, _HAS_RESULT[placed_block.type])


def _fill_slots(
    placed_block: PlacedBlock, inputs: tuple[FunctionInput, ...]
) -> tuple[list[tuple[FunctionInput, Argument]], dict[str, tuple[PlacedBlock, ...]]]:
    slots: list[tuple[FunctionInput, Argument]] = []
    inputs_by_slot: dict[str, tuple[PlacedBlock, ...]] = {}
    for number, (function_input, slot) in enumerate(Inputs("INPUTS").slots(inputs)):
        slots.append((function_input, ValueInput(f"G{number}")))
        inputs_by_slot[f"G{number}"] = placed_block.inputs.get(slot.name, ())
    return slots, inputs_by_slot


def _escape_placeholders(text: str) -> str:
    return text.replace("%", "％")  # noqa: RUF001 (looks the same, but is not a placeholder)
