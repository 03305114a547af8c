"""From a workspace to a program: each block's template, its holes filled with the trees of what is in it."""

from __future__ import annotations

import ast
import keyword
from collections.abc import Mapping, Sequence

from app.blocks.block import Block
from app.blocks.catalogue import Catalogue
from app.blocks.fields import (
    Field,
    FieldError,
    StatementInput,
    ValueInput,
    VariableField,
)
from app.blocks.names import Names
from app.blocks.notes import Notes
from app.blocks.program import Program
from app.blocks.reading import reading
from app.blocks.render import instrumented, readable
from app.blocks.template import expression, literal, statements
from app.blocks.uses import Uses, saved_value
from app.blocks.workspace import Placed, Workspace, parse_workspace
from app.robots.description import Robot

COMMANDS = frozenset(
    {
        "fail", "is_known", "join", "length", "newest", "on_message", "on_start", "on_true", "part",
        "publish",
        "random_number", "repeat", "robot", "rounded", "rounded_down", "rounded_up", "run", "stop_program",
        "wait", "wait_until", "write",
    }
)  # fmt: skip
"""What a program may call (`app.blocks.commands`); no variable gets one of these names."""

_RESERVED = COMMANDS | {"step", "value", "number", "message", "_"}


class _Skip(Exception):  # noqa: N818 (no error: the block is left out, and its problem is noted)
    """This block can't be compiled; whoever holds it is left out, and the problem is noted already."""


def compile_behaviour(
    workspace: Mapping[str, object],
    robots: Sequence[Robot],
    *,
    absent: Sequence[Robot] = (),
    name: str = "Behaviour",
) -> Program:
    """The program of Blockly's JSON.

    `robots` are connected; blocks of others are skipped, and `absent` (as last known) only helps to name
    them. Never raises for what a file holds: it becomes problems.
    """
    catalogue = Catalogue(robots, absent)
    parsed = parse_workspace(workspace)
    return _Compiler(catalogue, parsed, name).program()


class _Compiler:
    def __init__(self, catalogue: Catalogue, workspace: Workspace, name: str) -> None:
        self._catalogue = catalogue
        self._workspace = workspace
        self._name = name
        self._names = Names(_RESERVED)
        self._variables: dict[str, str] = {}  # Blockly's id -> Python's name
        self._marks: dict[ast.AST, str] = {}
        self._notes = Notes(catalogue, workspace)
        self._readings: dict[str, str] = {}
        self._labels: dict[str, str] = {}
        self._uses = Uses()
        self._in_message = False
        self._numbers: set[str] = set()  # the blocks that must give a number

    def program(self) -> Program:
        functions = [
            function for script in self._workspace.scripts if (function := self._script(script)) is not None
        ]
        self._notes.check_starts(len(functions))
        body: list[ast.stmt] = [
            *statements("\n".join(f"{name} = 0" for name in self._variables.values()), {}),
            *functions,
        ]
        source, lines = readable([*_imports(body), *body, *_run(self._name)], self._marks)
        return Program(
            name=self._name,
            source=source,
            runnable=instrumented(body, self._marks, self._numbers),
            lines=lines,
            robots=tuple(self._uses.robots),
            sensors=tuple(self._uses.sensors),
            events=tuple(self._uses.events),
            publishes=tuple(self._uses.publishes),
            listens=tuple(self._uses.listens),
            readings=self._readings,
            labels=self._labels,
            problems=self._notes.problems(),
            starts=len(functions),
            absent=self._notes.absent_blocks(),
        )

    # ---- scripts and statements

    def _script(self, script: tuple[Placed, ...]) -> ast.stmt | None:
        """The function of a script that something starts; None, with a note, for all others."""
        first = script[0]
        if not first.enabled:
            return None
        block = self._known(first)
        if block is None:
            return None
        if block.shape != "hat":
            self._notes.unattached(first, block)
            return None
        if self._notes.missing(first, block) is not None:
            return None
        self._in_message = bool(block.parameters)
        try:
            expressions = self._expressions(first, block)
        except _Skip:
            return None
        decorator = expression(_template(block, first), expressions, self._keywords(block, expressions))
        self._uses.remember(first, block)
        parameters = ", ".join(block.parameters)
        (function,) = statements(
            f"@%DECORATOR\ndef script({parameters}):\n    %BODY",
            {"DECORATOR": decorator},
            {"BODY": self._statements(script[1:])},
        )
        if isinstance(function, ast.FunctionDef):
            function.name = self._names.new(self._read(first), "script")
            self._declare(function)
        self._marks[function] = first.id
        return function

    def _declare(self, function: ast.FunctionDef) -> None:
        """``global`` for the variables that the function sets: all scripts share them."""
        own = set(self._variables.values())
        stored = {
            node.id
            for node in ast.walk(function)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in own
        }
        if stored:
            function.body.insert(0, ast.Global(sorted(stored)))

    def _statements(self, chain: Sequence[Placed]) -> list[ast.stmt]:
        made: list[ast.stmt] = []
        for placed in chain:
            if placed.enabled:
                made += self._statement(placed)
        return made

    def _statement(self, placed: Placed) -> list[ast.stmt]:
        block = self._known(placed)
        if block is None:
            return []
        if block.shape not in ("statement", "cap"):
            self._notes.misplaced(placed, block)
            return []
        self._read(placed)
        missing = self._notes.missing(placed, block)
        if missing is not None:
            return self._marked(statements("fail(%SENTENCE)", {"SENTENCE": literal(missing)}), placed)
        try:
            expressions = self._expressions(placed, block)
        except _Skip:
            return []
        self._uses.remember(placed, block)
        self._notes.look(placed, block)
        bodies = {
            argument.name: self._statements(placed.inputs.get(argument.name, ()))
            for argument in block.arguments
            if isinstance(argument, StatementInput)
        }
        text = _template(block, placed)
        return self._marked(statements(text, expressions, bodies, self._keywords(block, expressions)), placed)

    def _marked(self, made: list[ast.stmt], placed: Placed) -> list[ast.stmt]:
        self._marks[made[0]] = placed.id
        return made

    # ---- values

    def _expressions(self, placed: Placed, block: Block) -> dict[str, ast.expr]:
        """A tree for each hole; _Skip when one of them can't be had."""
        made = {name: literal(constant) for name, constant in block.constants.items()}
        for argument in block.arguments:
            if isinstance(argument, ValueInput):
                made[argument.name] = self._value(placed, argument)
            elif isinstance(argument, Field) and not argument.silent:
                made[argument.name] = self._field(placed, block, argument)
        return made

    def _value(self, holder: Placed, argument: ValueInput) -> ast.expr:
        inner = holder.inputs.get(argument.name, ())
        if not inner or not inner[0].enabled:
            return literal(argument.default)
        placed = inner[0]
        block = self._known(placed, holder)
        if block is None:
            raise _Skip
        if block.shape not in ("value", "boolean"):
            self._notes.misplaced(placed, block)
            raise _Skip
        if block.needs_message and not self._in_message:
            self._notes.no_message(placed, block)
            return literal(None)
        self._read(placed)
        missing = self._notes.missing(placed, block)
        expressions = self._expressions(placed, block)
        if missing is not None:
            made = expression("fail(%SENTENCE)", {"SENTENCE": literal(missing)})
        else:
            self._uses.remember(placed, block)
            made = expression(_template(block, placed), expressions, self._keywords(block, expressions))
        if block.fails or missing is not None:
            self._marks[made] = placed.id
            if block.check == "Number" and missing is None:
                self._numbers.add(placed.id)
        return made

    def _field(self, placed: Placed, block: Block, field: Field) -> ast.expr:
        try:
            value = field.read(placed.fields.get(field.name))
        except FieldError as error:
            self._notes.wrong_field(placed, block, error)
            raise _Skip from None
        if isinstance(field, VariableField):
            return ast.Name(self._variable(str(value)), ast.Load())
        return literal(value)

    def _variable(self, id: str) -> str:
        if id not in self._variables:
            self._variables[id] = self._names.new(self._workspace.variables.get(id, id), "variable")
        return self._variables[id]

    @staticmethod
    def _keywords(block: Block, expressions: Mapping[str, ast.expr]) -> dict[str, list[ast.keyword]]:
        """Arguments by name; a name that Python could not write goes in as ``**{"a-b": …}``."""
        made: dict[str, list[ast.keyword]] = {}
        for hole, pairs in block.keywords.items():
            plain = [ast.keyword(name, expressions[at]) for at, name in pairs if _is_plain(name)]
            odd = [(literal(name), expressions[at]) for at, name in pairs if not _is_plain(name)]
            if odd:
                table = ast.Dict([key for key, _ in odd], [value for _, value in odd])
                plain.append(ast.keyword(None, table))
            made[hole] = plain
        return made

    # ---- what is known about a block

    def _known(self, placed: Placed, holder: Placed | None = None) -> Block | None:
        """The block's description; None, with a note, when nobody here can do it."""
        if placed.too_deep:
            self._notes.too_deep(placed)
            return None
        block = self._catalogue.blocks.get(placed.type)
        if self._notes.absent(placed, block, holder):
            return None
        return block

    def _read(self, placed: Placed) -> str:
        words = reading(placed, self._catalogue.blocks, self._workspace.variables)
        self._readings[placed.id] = words
        block = self._catalogue.blocks.get(placed.type)
        self._labels[placed.id] = self._notes.label(placed, block)
        return words


def _template(block: Block, placed: Placed) -> str:
    if isinstance(block.python, str):
        return block.python
    chosen = saved_value(block, placed, block.variant or "")
    return block.python[str(chosen)]


def _is_plain(name: str) -> bool:
    """Whether Python can write this name before an equals sign."""
    return name.isidentifier() and name.isascii() and not keyword.iskeyword(name)


def _imports(body: Sequence[ast.stmt]) -> list[ast.stmt]:
    names = {
        node.id for statement in body for node in ast.walk(statement) if isinstance(node, ast.Name)
    } & COMMANDS
    return statements(f"from app.blocks.commands import {', '.join(sorted({*names, 'run'}))}", {})


def _run(name: str) -> list[ast.stmt]:
    return statements("run(%NAME)", {"NAME": literal(name)})
