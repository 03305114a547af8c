"""Linker: puts compiled pages together to one program.

Each page is compiled with its own Python names. The linker gives them names that are unique in the program;
the names of the first page stay as they are, so that a behaviour with one page is linked without changes.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.blocks.compiler.compiled_page import CompiledPage, UsedResources
from app.blocks.compiler.problem_list import ProblemList
from app.blocks.compiler.program_names import ProgramNames
from app.blocks.compiler.render import render_source
from app.blocks.compiler.unused_names import NameUsage
from app.blocks.model.program import Problem, Program, Variable
from app.blocks.model.template import literal, statements
from app.blocks.toolbox.catalogue import function_modules
from nep.system.syntax import parse_module


@dataclass(frozen=True)
class _LinkedPage:
    page: CompiledPage
    names: Mapping[str, str]
    source: str
    runnable: str


class Linker:
    """Linker of the pages of one project; code of pages whose names don't change is kept between links."""

    def __init__(self) -> None:
        self._linked_pages: tuple[_LinkedPage, ...] = ()

    def link(self, pages: Sequence[CompiledPage], name: str) -> Program:
        """Return the program of these pages.

        Args:
            pages: Compiled pages in the order of the project.
            name: Name of the project.
        """
        program_names, previous = ProgramNames(), {id(each.page): each for each in self._linked_pages}
        linked_pages = tuple(
            _link_page(page, program_names.names_of(page.names), previous.get(id(page))) for page in pages
        )
        self._linked_pages = linked_pages
        variables = {
            id: linked.names[local_name]
            for linked in linked_pages
            for id, local_name in linked.page.variables.items()
        }
        source, lines = _join_sources(linked_pages, variables.values(), name)
        uses = UsedResources.merge(page.uses for page in pages)
        return Program(
            name=name,
            source=source,
            runnable=_join_runnables(linked_pages, variables.values()),
            lines=lines,
            robots=tuple(uses.robots),
            sensors=tuple(uses.sensors),
            events=tuple(uses.events),
            publishes=tuple(uses.publishes),
            listens=tuple(uses.listens),
            moves=tuple(uses.moves),
            actions=_merge_actions(pages),
            readings={id: text for page in pages for id, text in page.readings.items()},
            labels={id: label for page in pages for id, label in page.labels.items()},
            variables=_all_variables(pages, variables),
            breakpoints=tuple(id for page in pages for id in page.breakpoints),
            problems=_all_problems(pages),
            starts=sum(page.starts for page in pages),
            absent=tuple(id for page in pages for id in page.absent),
        )


def _link_page(page: CompiledPage, names: Mapping[str, str], previous: _LinkedPage | None) -> _LinkedPage:
    if previous is not None and previous.page is page and previous.names == names:
        return previous
    if all(local_name == name for local_name, name in names.items()):
        return _LinkedPage(page, names, page.source, page.runnable)
    source, _lines = render_source(_renamed(page.source, names), {})
    runnable = ast.unparse(ast.Module(_renamed(page.runnable, names), [])) + "\n"
    return _LinkedPage(page, names, source, runnable)


def _renamed(code: str, names: Mapping[str, str]) -> list[ast.stmt]:
    module = parse_module(code)
    for node in ast.walk(module):
        if isinstance(node, ast.Name):
            node.id = names.get(node.id, node.id)
        elif isinstance(node, ast.FunctionDef):
            node.name = names.get(node.name, node.name)
        elif isinstance(node, ast.arg):
            node.arg = names.get(node.arg, node.arg)
        elif isinstance(node, ast.Global):
            node.names = sorted(names.get(each, each) for each in node.names)
    return module.body


def _join_sources(
    linked_pages: Sequence[_LinkedPage], variables: Iterable[str], name: str
) -> tuple[str, dict[int, str]]:
    commands = {command for linked in linked_pages for command in linked.page.commands}
    imports = [*_command_imports(commands), *_category_imports(commands)]
    source, _lines = render_source([*imports, *_assignments(variables)], {})
    lines: dict[int, str] = {}
    separator = "\n"
    for linked in linked_pages:
        if linked.source:
            separator = "\n\n"
            source += separator
            offset = source.count("\n")
            lines |= {offset + line: id for line, id in linked.page.lines.items()}
            source += linked.source
    run_source, _lines = render_source(statements("run(%NAME)", {"NAME": literal(name)}), {})
    return source + separator + run_source, lines


def _join_runnables(linked_pages: Sequence[_LinkedPage], variables: Iterable[str]) -> str:
    commands = {command for linked in linked_pages for command in linked.page.commands}
    imports = "".join(f"{ast.unparse(each)}\n" for each in _category_imports(commands))
    assignments = "".join(f"{name} = 0\n" for name in variables)
    parts = [imports, assignments, *(linked.runnable for linked in linked_pages)]
    return "\n".join(part for part in parts if part) or "\n"


def _command_imports(commands: Iterable[str]) -> list[ast.stmt]:
    names = sorted({*commands, "run"} - function_modules().keys())
    return statements(f"from app.blocks.commands import {', '.join(names)}", {})


def _category_imports(commands: Iterable[str]) -> list[ast.stmt]:
    names_by_module: dict[str, list[str]] = {}
    for name in sorted(commands):
        if module := function_modules().get(name):
            names_by_module.setdefault(module, []).append(name)
    return [
        statement
        for module, names in sorted(names_by_module.items())
        for statement in statements(f"from {module} import {', '.join(names)}", {})
    ]


def _assignments(variables: Iterable[str]) -> list[ast.stmt]:
    return statements("\n".join(f"{name} = 0" for name in variables), {})


def _merge_actions(pages: Iterable[CompiledPage]) -> dict[str, tuple[str, ...]] | None:
    actions_by_robot: dict[str, dict[str, None]] = {}
    for page in pages:
        if page.actions is None:
            return None
        for robot, actions in page.actions.items():
            actions_by_robot.setdefault(robot, {}).update(dict.fromkeys(actions))
    return {robot: tuple(actions) for robot, actions in actions_by_robot.items()}


def _all_variables(pages: Sequence[CompiledPage], python_names: Mapping[str, str]) -> tuple[Variable, ...]:
    names: dict[str, str] = {}
    for page in pages:
        for id, name in page.variable_names.items():
            names.setdefault(id, name)
    return tuple(Variable(id, name, python_names.get(id, "")) for id, name in names.items())


def _all_problems(pages: Sequence[CompiledPage]) -> tuple[Problem, ...]:
    problems = ProblemList()
    for page in pages:
        problems.extend(page.problems)
    if any(page.has_scripts for page in pages) and not any(page.starts for page in pages):
        problems.add_no_start()
    NameUsage.merge(page.name_usage for page in pages).report(problems)
    for page in pages:
        problems.extend(page.page_problems)
    return problems.problems()
