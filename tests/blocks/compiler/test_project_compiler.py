"""Tests of compiling the pages of a project one by one, and of joining them to one program."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.blocks.compiler import compiler as compiler_module
from app.blocks.compiler.compiler import ProjectCompiler, compile_behaviour
from app.blocks.model.program import Program
from app.blocks.model.project import Page, PageKind, Project
from app.blocks.model.workspace_json import WorkspaceJson
from app.robots.description.description import Robot
from tests.blocks.fakes import Play
from tests.blocks.samples import (
    block,
    call,
    define,
    get,
    given,
    number,
    robot,
    say,
    started,
    text,
    workspace,
    write,
)


def page(id: str, saved: dict[str, object], kind: PageKind = "reaction") -> Page:
    return Page(id, id.title(), kind, WorkspaceJson.from_blocks(saved))


def project(always: dict[str, object], *pages: Page) -> Project:
    made = Project.of_blocks("Mine", always)
    return replace(made, pages=(*made.pages, *pages))


def set_x(value: float) -> dict[str, object]:
    return block("variables_set", VAR={"id": "x"}, VALUE=number(value))


def doubled(factor: int, name: str = "double") -> dict[str, object]:
    product = block("values_arithmetic", A=given("n"), SIGN="*", B=number(factor))
    return workspace(define("d", name, ("n",), result=product))


class Compiler:
    """Compiler of a project that counts which pages are compiled."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._compiler = ProjectCompiler()
        self.compiled: list[str] = []
        compile_page = compiler_module.compile_page

        def compile_and_count(*arguments: object) -> object:
            self.compiled.append(str(arguments[3]))
            return compile_page(*arguments)  # type: ignore[arg-type]

        monkeypatch.setattr(compiler_module, "compile_page", compile_and_count)

    def __call__(self, made: Project, *robots: Robot) -> Program:
        """Compile; the result must be the same as that of a compiler without a cache."""
        self.compiled.clear()
        program = self._compiler.compile(made.pages, robots, name=made.name)
        compiled = list(self.compiled)
        assert program == ProjectCompiler().compile(made.pages, robots, name=made.name)
        self.compiled[:] = compiled
        return program


@pytest.fixture
def compile_project(monkeypatch: pytest.MonkeyPatch) -> Compiler:
    return Compiler(monkeypatch)


def edited(made: Project, id: str, saved: dict[str, object]) -> Project:
    return made.with_page(made.page(id).with_workspace(WorkspaceJson.from_blocks(saved)))


def lines_of(program: Program) -> list[str]:
    return Play(program).start().end().lines


def test_single_page_compiles_like_a_workspace() -> None:
    saved = workspace(started(set_x(1), write(get("x"))), variables=("x",))
    made = Project.of_blocks("Mine", saved)
    assert ProjectCompiler().compile(made.pages, [], name="Mine") == compile_behaviour(saved, [], name="Mine")


def test_only_edited_pages_are_compiled_again(compile_project: Compiler) -> None:
    made = project(
        workspace(started(write(text("a")))),
        page("one", workspace(started(write(text("b"))))),
        page("two", workspace(started(write(text("c"))))),
    )
    compile_project(made)
    assert compile_project.compiled == ["", "one/", "two/"]
    compile_project(made)
    assert compile_project.compiled == []
    made = edited(made, "one", workspace(started(write(text("d")))))
    assert sorted(lines_of(compile_project(made))) == ["a", "c", "d"]
    assert compile_project.compiled == ["one/"]
    program = compile_project(replace(made, pages=made.pages[:2]))
    assert compile_project.compiled == []
    assert sorted(lines_of(program)) == ["a", "d"]


def test_pages_share_variables_and_get_unique_python_names(compile_project: Compiler) -> None:
    shared = workspace(started(set_x(2)), variables=("x",))
    own = workspace(started(write(text("x"))), variables=("x",))
    own["variables"] = [{"id": "another", "name": "x"}]
    made = project(
        shared, page("own", own), page("reader", workspace(started(write(get("x"))), variables=("x",)))
    )
    program = compile_project(made)
    assert program.problems == ()
    assert len({each.python for each in program.variables if each.python}) == 1
    # a new variable on the first page takes the name that a function on the other page had
    names = [line for line in program.source.splitlines() if line.startswith("def ")]
    assert len(names) == len(set(names)) == 3


def test_variable_set_on_another_page_is_no_problem_until_it_is_removed(compile_project: Compiler) -> None:
    made = project(
        workspace(started(write(get("x"))), variables=("x",)),
        page("setter", workspace(started(set_x(1)), variables=("x",))),
    )
    assert compile_project(made).problems == ()
    (problem,) = compile_project(edited(made, "setter", workspace(started(write(text("no")))))).problems
    assert "never set" in problem.message
    assert compile_project.compiled == ["setter/"]


def test_new_variable_renames_names_of_cached_pages(compile_project: Compiler) -> None:
    made = project(
        workspace(started(write(text("a")))),
        page("one", workspace(define("f", "x", (), write(text("f"))), started(call("f")))),
    )
    assert "def x():" in compile_project(made).source
    program = compile_project(edited(made, "always", workspace(started(set_x(1)), variables=("x",))))
    assert compile_project.compiled == [""]
    assert "def x_2():" in program.source
    for number_of_line, id in program.lines.items():
        assert program.source.splitlines()[number_of_line - 1].strip(), id
    assert lines_of(program) == ["f"]


def test_caller_is_compiled_again_only_if_the_signature_of_the_function_changes(
    compile_project: Compiler,
) -> None:
    caller = workspace(started(write(call("d", value=True, n=number(4)))))
    made = project(caller, page("tools", doubled(2), "module"))
    assert lines_of(compile_project(made)) == ["8"]
    made = edited(made, "tools", doubled(3))
    assert lines_of(compile_project(made)) == ["12"]
    assert compile_project.compiled == ["tools/"]
    made = edited(made, "tools", doubled(3, "triple"))
    assert lines_of(compile_project(made)) == ["12"]
    assert compile_project.compiled == ["", "tools/"]
    (problem,) = compile_project(edited(made, "tools", workspace())).errors
    assert "missing" in problem.message
    assert compile_project.compiled == ["", "tools/"]
    assert lines_of(compile_project(made)) == ["12"]


def test_page_that_becomes_a_module_provides_its_functions(compile_project: Compiler) -> None:
    caller = workspace(started(write(call("d", value=True, n=number(4)))))
    made = project(caller, page("tools", doubled(2)))
    assert compile_project(made).errors
    module = replace(made.page("tools"), kind="module")
    assert lines_of(compile_project(made.with_page(module))) == ["8"]


def test_function_of_the_page_itself_is_called_before_that_of_a_module(compile_project: Compiler) -> None:
    caller = doubled(5)
    caller["blocks"]["blocks"].append(started(write(call("d", value=True, n=number(4)))))  # type: ignore[index]
    made = project(caller, page("tools", doubled(2), "module"))
    assert lines_of(compile_project(made)) == ["20"]


def test_all_pages_are_compiled_again_if_robots_change(compile_project: Compiler) -> None:
    made = project(workspace(started(say("a"))), page("one", workspace(started(say("b")))))
    assert compile_project(made).absent
    assert compile_project(made, robot()).robots == ("Pepper",)
    assert compile_project.compiled == ["", "one/"]
    assert compile_project(made, robot()).absent == ()
    assert compile_project.compiled == []
    assert compile_project(made, robot("Salt")).problems
    assert compile_project.compiled == ["", "one/"]


def test_block_ids_of_equal_pages_differ(compile_project: Compiler) -> None:
    saved = workspace(started(write(text("a"))))
    program = compile_project(project(saved, page("one", saved), page("two", saved)))
    assert len(set(program.lines.values())) == 6
    assert lines_of(program) == ["a", "a", "a"]
