"""Compiler of one page: fills the template of each block with the syntax trees of the blocks in its slots."""

from __future__ import annotations

import ast
import keyword
from collections.abc import Mapping, Sequence
from dataclasses import replace

from app.blocks.compiler.compiled_page import CompiledPage, UsedResources
from app.blocks.compiler.conflicts import ConflictFinder
from app.blocks.compiler.lowering import END_BLOCK, Function, Lowering, ModuleFunction, ModuleKey
from app.blocks.compiler.problems import ProblemCollector
from app.blocks.compiler.program_names import PageNames, callable_names
from app.blocks.compiler.render import render_instrumented, render_source
from app.blocks.compiler.unused_names import NameUsage
from app.blocks.model.block import Block
from app.blocks.model.block_text import block_text
from app.blocks.model.fields import (
    ChoiceField,
    Field,
    FieldError,
    StatementInput,
    TopicField,
    ValueInput,
    VariableField,
)
from app.blocks.model.mutators import InputField
from app.blocks.model.template import expression, literal, statements
from app.blocks.model.workspace import PlacedBlock, Workspace
from app.blocks.runtime.publishing import robots_moved_by
from app.blocks.toolbox.catalogue import Catalogue


def saved_value(block: Block, placed_block: PlacedBlock, name: str) -> object:
    """Return the value of a field of a placed block; None if the block has no such field.

    Args:
        block: Description of the block.
        placed_block: Block in the workspace.
        name: Name of the field.

    Raises:
        FieldError: The saved value is invalid.
    """
    argument = block.argument(name)
    return argument.read(placed_block.fields.get(name)) if isinstance(argument, Field) else None


def _first_robot(block: Block) -> str:
    field = block.argument("ROBOT")
    return str(field.read(None)) if isinstance(field, ChoiceField) else ""


class _SkippedBlock(Exception):  # noqa: N818 (control flow, not an error)
    """Raised for a block that can't be compiled; the compiler skips the block that contains it.

    The problem was reported before.
    """


def compile_page(
    workspace: Workspace,
    catalogue: Catalogue,
    modules: Mapping[ModuleKey, ModuleFunction] | None = None,
    block_prefix: str = "",
) -> CompiledPage:
    """Compile one page.

    Never raises for an invalid workspace; the result contains the problems.

    Args:
        workspace: Parsed page.
        catalogue: Block descriptions, to which those of this page are added.
        modules: Functions of other pages that the page can call.
        block_prefix: Prefix of the ids of the page's blocks.
    """
    return _PageCompiler(workspace, catalogue, modules or {}, block_prefix).compile()


class _PageCompiler:
    def __init__(
        self,
        workspace: Workspace,
        catalogue: Catalogue,
        modules: Mapping[ModuleKey, ModuleFunction],
        block_prefix: str,
    ) -> None:
        self._catalogue = catalogue
        self._names = PageNames()
        self._lowering = Lowering(workspace, catalogue, self._names, modules, block_prefix)
        self._workspace = workspace = self._lowering.workspace
        self._function: Function | None = None  # the function being compiled
        self._calls: set[str] = set()  # blocks that call a function
        self._variables: dict[str, str] = {}  # Blockly's id -> Python's name
        self._block_ids: dict[ast.AST, str] = {}
        self._problems = ProblemCollector(catalogue, workspace)
        self._block_texts: dict[str, str] = {}
        self._labels: dict[str, str] = {}
        self._breakpoints: dict[str, None] = {}
        self._uses = UsedResources()
        self._name_usage = NameUsage(workspace.variables)
        self._has_message = False
        self._numbers: set[str] = set()  # blocks that must return a number

    def compile(self) -> CompiledPage:
        definitions = self._compile_definitions()
        functions = [
            function
            for script in self._workspace.scripts
            if (function := self._compile_script(script)) is not None
        ]
        problems = self._problems.unsorted_problems()
        self._check_page()
        body: list[ast.stmt] = [*definitions, *functions]
        actions, commands = invoked_actions(body), _called_commands(body)  # before the trees are changed
        source, lines = render_source(body, self._block_ids) if body else ("", {})
        return CompiledPage(
            source=source,
            runnable=(render_instrumented(body, self._block_ids, self._numbers, self._calls) if body else ""),
            lines=lines,
            names=tuple(self._names.requests),
            commands=commands,
            variables=self._variables,
            variable_names=self._all_variable_names(),
            starts=len(functions),
            has_scripts=bool(self._workspace.scripts),
            uses=self._uses,
            actions=actions,
            readings=self._block_texts,
            labels=self._labels,
            breakpoints=tuple(self._breakpoints),
            problems=problems,
            page_problems=self._problems.unsorted_problems()[len(problems) :],
            name_usage=self._name_usage,
            absent=self._problems.absent_blocks(),
            module_lookups=self._lowering.module_lookups,
        )

    def _check_page(self) -> None:
        self._problems.check_unknown()
        self._problems.check_names()
        for conflict in ConflictFinder(
            self._workspace, self._catalogue, self._lowering.called_function
        ).conflicts():
            self._problems.report_conflict(conflict)

    def _all_variable_names(self) -> dict[str, str]:
        names = self._workspace.variables
        return dict(self._lowering.variables) | {id: names.get(id, id) for id in self._variables}

    # ---- scripts and statements

    def _compile_script(self, script: tuple[PlacedBlock, ...]) -> ast.stmt | None:
        first = script[0]
        if not first.is_enabled:
            return None
        block = self._usable_block(first)
        if block is None or block.shape == "definition":
            return None
        if block.shape != "hat":
            self._problems.report_unattached(first, block)
            return None
        if self._problems.report_empty_slot(first, block) is not None:
            return None
        self._has_message = bool(block.parameters)
        try:
            expressions = self._compile_arguments(first, block)
        except _SkippedBlock:
            return None
        decorator = expression(self._template(block, first), expressions, keywords(block, expressions))
        self._add_uses(first, block)
        self._name_usage.add(first, block)
        parameters = ", ".join(block.parameters)
        (function,) = statements(
            f"@%DECORATOR\ndef script({parameters}):\n    %BODY",
            {"DECORATOR": decorator},
            {"BODY": self._compile_statements(script[1:])},
        )
        if isinstance(function, ast.FunctionDef):
            function.name = self._names.new_name(self._store_block_text(first), "script")
            self._declare_globals(function)
        self._block_ids[function] = first.id
        return function

    def _compile_definitions(self) -> list[ast.stmt]:
        definitions: list[ast.stmt] = []
        for script in self._workspace.scripts:
            self._function = self._lowering.function(script[0])
            if self._function is not None and self._usable_block(script[0]) is not None:
                definitions.append(self._compile_definition(script[0], self._function))
        self._function = None
        return definitions

    def _compile_definition(self, placed_block: PlacedBlock, function: Function) -> ast.stmt:
        self._has_message = False
        self._store_block_text(placed_block)
        body = self._compile_statements(
            placed_block.inputs.get("BODY", ()) if placed_block.is_enabled else ()
        )
        if function.has_result:
            body += self._compile_statement(replace(placed_block, type=f"{END_BLOCK}:{placed_block.id}"))
        (definition,) = statements("def script():\n    %BODY", {}, {"BODY": body})
        if isinstance(definition, ast.FunctionDef):
            definition.name = function.python_name
            definition.args.args = [ast.arg(name) for name in function.parameters.values()]
            self._declare_globals(definition)
        self._block_ids[definition] = placed_block.id
        return definition

    def _declare_globals(self, function: ast.FunctionDef) -> None:
        variable_names = set(self._variables.values())
        assigned_names = {
            node.id
            for node in ast.walk(function)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in variable_names
        }
        if assigned_names:
            function.body.insert(0, ast.Global(sorted(assigned_names)))

    def _compile_statements(self, chain: Sequence[PlacedBlock]) -> list[ast.stmt]:
        body: list[ast.stmt] = []
        for placed_block in chain:
            if placed_block.is_enabled:
                body += self._compile_statement(placed_block)
        return body

    def _compile_statement(self, placed_block: PlacedBlock) -> list[ast.stmt]:
        if placed_block.has_breakpoint:
            self._breakpoints[placed_block.id] = None
        block = self._usable_block(placed_block)
        if block is None:
            return []
        if block.shape not in ("statement", "cap") or not self._is_allowed_here(block):
            self._problems.report_misplaced(placed_block, block)
            return []
        self._store_block_text(placed_block)
        slot_error = self._problems.report_empty_slot(placed_block, block)
        if slot_error is not None:
            return self._record_block_id(
                statements("fail(%SENTENCE)", {"SENTENCE": literal(slot_error)}), placed_block
            )
        try:
            expressions = self._compile_arguments(placed_block, block)
        except _SkippedBlock:
            return []
        self._add_uses(placed_block, block)
        self._name_usage.add(placed_block, block)
        self._problems.report_hints(placed_block, block)
        if block.is_publisher:
            self._record_moved_robots(placed_block, block)
        bodies = {
            argument.name: self._compile_statements(placed_block.inputs.get(argument.name, ()))
            for argument in block.arguments
            if isinstance(argument, StatementInput)
        }
        text = self._template(block, placed_block)
        compiled = statements(text, expressions, bodies, keywords(block, expressions))
        if block.is_function_call and isinstance(compiled[0], ast.Expr):
            self._block_ids[compiled[0].value] = placed_block.id
            self._calls.add(placed_block.id)
        return self._record_block_id(compiled, placed_block)

    def _add_uses(self, placed_block: PlacedBlock, block: Block) -> None:
        use = block.robot
        if use is not None:
            robot = placed_block.field_text("ROBOT") or _first_robot(block)
            self._uses.robots[robot] = None
            name = use.name or str(saved_value(block, placed_block, "SENSOR"))
            if use.kind == "sensor":
                self._uses.sensors[robot, name] = None
            elif use.kind == "event":
                self._uses.events[robot, name] = None
        for argument in block.arguments:
            if isinstance(argument, TopicField):
                topics = self._uses.publishes if block.is_publisher else self._uses.listens
                topics[str(saved_value(block, placed_block, argument.name))] = None

    def _record_moved_robots(self, placed_block: PlacedBlock, block: Block) -> None:
        topics = [argument.name for argument in block.arguments if isinstance(argument, TopicField)]
        for topic in (str(saved_value(block, placed_block, name)) for name in topics):
            names = robots_moved_by(topic, self._catalogue.connected.values())
            self._uses.robots |= dict.fromkeys(names)
            self._uses.moves |= dict.fromkeys(names)
            self._problems.report_motion(placed_block, block, topic, names)

    def _is_allowed_here(self, block: Block) -> bool:
        if not block.needs_function:
            return True
        return self._function is not None and self._function.has_result == (block.needs_function == "result")

    def _record_block_id(self, compiled: list[ast.stmt], placed_block: PlacedBlock) -> list[ast.stmt]:
        self._block_ids[compiled[0]] = placed_block.id
        return compiled

    # ---- values

    def _compile_arguments(self, placed_block: PlacedBlock, block: Block) -> dict[str, ast.expr]:
        expressions = {name: literal(constant) for name, constant in block.constants.items()} | dict(
            block.constant_trees
        )
        for argument in block.arguments:
            if isinstance(argument, ValueInput):
                expressions[argument.name] = self._compile_value(placed_block, argument)
            elif isinstance(argument, Field) and not argument.is_display_only:
                expressions[argument.name] = self._compile_field(placed_block, block, argument)
        return expressions

    def _compile_value(self, parent: PlacedBlock, argument: ValueInput) -> ast.expr:
        inner = parent.inputs.get(argument.name, ())
        if not inner or not inner[0].is_enabled:
            return literal(argument.default)
        placed_block = inner[0]
        block = self._usable_block(placed_block, parent)
        if block is None:
            raise _SkippedBlock
        if block.shape not in ("value", "boolean"):
            self._problems.report_misplaced(placed_block, block)
            raise _SkippedBlock
        if block.needs_message and not self._has_message:
            self._problems.report_no_message(placed_block, block)
            return literal(None)
        self._store_block_text(placed_block)
        slot_error = self._problems.report_empty_slot(placed_block, block)
        expressions = self._compile_arguments(placed_block, block)
        if slot_error is not None:
            compiled = expression("fail(%SENTENCE)", {"SENTENCE": literal(slot_error)})
        else:
            self._add_uses(placed_block, block)
            self._name_usage.add(placed_block, block)
            compiled = expression(
                self._template(block, placed_block), expressions, keywords(block, expressions)
            )
        if block.can_fail or slot_error is not None:
            self._block_ids[compiled] = placed_block.id
            if block.check == "Number" and slot_error is None:
                self._numbers.add(placed_block.id)
            if block.is_function_call:
                self._calls.add(placed_block.id)
        return compiled

    def _compile_field(self, placed_block: PlacedBlock, block: Block, field: Field) -> ast.expr:
        try:
            value = field.read(placed_block.fields.get(field.name))
        except FieldError as error:
            self._problems.report_invalid_field(placed_block, block, error)
            raise _SkippedBlock from None
        if isinstance(field, InputField):
            return self._compile_input(placed_block, block, str(value))
        if isinstance(field, VariableField):
            return ast.Name(self._variable_name(str(value)), ast.Load())
        return literal(value)

    def _compile_input(self, placed_block: PlacedBlock, block: Block, id: str) -> ast.expr:
        name = self._function.parameters.get(id) if self._function is not None else None
        if name is None:
            self._problems.report_unknown_input(placed_block, block)
            raise _SkippedBlock
        return ast.Name(name, ast.Load())

    def _variable_name(self, id: str) -> str:
        if id not in self._variables:
            is_nameless = id in self._workspace.nameless_variables
            name = id if is_nameless else self._workspace.variables.get(id, id)
            self._variables[id] = self._names.new_name(name, "variable", ("variable", id))
        return self._variables[id]

    # ---- block look-up

    def _usable_block(self, placed_block: PlacedBlock, parent: PlacedBlock | None = None) -> Block | None:
        if placed_block.is_too_deep:
            self._problems.report_too_deep(placed_block)
            return None
        block = self._catalogue.blocks.get(placed_block.type)
        if self._problems.report_unsupported(placed_block, block, parent):
            return None
        if block is not None and block.undefined_message:
            self._problems.report_undefined(placed_block, block)
        return block

    def _template(self, block: Block, placed_block: PlacedBlock) -> str:
        return template(block, placed_block, in_function=self._function is not None)

    def _store_block_text(self, placed_block: PlacedBlock) -> str:
        text = block_text(placed_block, self._catalogue.blocks, self._workspace.variables)
        self._block_texts[placed_block.id] = text
        block = self._catalogue.blocks.get(placed_block.type)
        self._labels[placed_block.id] = self._problems.label(placed_block, block)
        return text


def keywords(block: Block, expressions: Mapping[str, ast.expr]) -> dict[str, list[ast.keyword]]:
    """Return the keyword arguments for each placeholder in `Block.keywords`.

    Names that aren't valid identifiers are passed as ``**{"a-b": …}``.

    Args:
        block: Description of the block.
        expressions: Expression of each argument by name.
    """
    keywords_by_placeholder: dict[str, list[ast.keyword]] = {}
    for placeholder, pairs in block.keywords.items():
        arguments = [
            ast.keyword(name, expressions[argument_name])
            for argument_name, name in pairs
            if _is_keyword_name(name)
        ]
        other_names = [
            (literal(name), expressions[argument_name])
            for argument_name, name in pairs
            if not _is_keyword_name(name)
        ]
        if other_names:
            dict_node = ast.Dict([key for key, _ in other_names], [value for _, value in other_names])
            arguments.append(ast.keyword(None, dict_node))
        keywords_by_placeholder[placeholder] = arguments
    return keywords_by_placeholder


def template(block: Block, placed_block: PlacedBlock, *, in_function: bool) -> str:
    """Return the Python template of a placed block.

    Args:
        block: Description of the block.
        placed_block: Block in the workspace, whose field values may select the template.
        in_function: True if the block is inside a function definition.
    """
    if in_function and block.python_in_function:
        return block.python_in_function
    if isinstance(block.python, str):
        return block.python
    option = saved_value(block, placed_block, block.variant or "")
    return block.python[str(option)]


def _is_keyword_name(name: str) -> bool:
    return name.isidentifier() and name.isascii() and not keyword.iskeyword(name)


def invoked_actions(body: Sequence[ast.stmt]) -> dict[str, tuple[str, ...]] | None:
    """Return the names of the actions that a program executes, by robot; None if not statically known.

    The actions are read from the syntax tree that is executed, so that a program can't execute an action that
    is not in the result.
    """
    actions_by_robot: dict[str, dict[str, None]] = {}
    for call in (node for statement in body for node in ast.walk(statement)):
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)):
            continue
        if call.func.attr not in ("do", "ask"):
            continue
        robot, action = _first_argument_text(call.func.value), _first_argument_text(call)
        if robot is None or action is None:
            return None
        actions_by_robot.setdefault(robot, {})[action] = None
    return {robot: tuple(actions) for robot, actions in actions_by_robot.items()}


def _first_argument_text(node: ast.expr) -> str | None:
    first = node.args[0] if isinstance(node, ast.Call) and node.args else None
    return first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else None


def _called_commands(body: Sequence[ast.stmt]) -> frozenset[str]:
    nodes = (node for statement in body for node in ast.walk(statement))
    return frozenset(node.id for node in nodes if isinstance(node, ast.Name)) & callable_names()
