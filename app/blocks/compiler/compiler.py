"""Compiler from the pages of a project to one program, with a cache of the compiled pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.blocks.compiler.compiled_page import CompiledPage
from app.blocks.compiler.linker import Linker
from app.blocks.compiler.lowering import ModuleFunction, ModuleKey, module_functions
from app.blocks.compiler.page_compiler import compile_page
from app.blocks.model.program import Program
from app.blocks.model.project import Page
from app.blocks.model.workspace import Workspace, parse_workspace
from app.blocks.toolbox.catalogue import Catalogue
from app.robots.description.description import Robot
from nep.i18n import language


def compile_behaviour(
    workspace: Mapping[str, object],
    robots: Sequence[Robot],
    *,
    absent: Sequence[Robot] = (),
    name: str = "Behaviour",
) -> Program:
    """Compile the workspace of a behaviour with one page to a program.

    Never raises for an invalid workspace; `Program.problems` contains the problems.

    Args:
        workspace: Saved workspace of Blockly.
        robots: Connected robots; blocks of other robots are skipped.
        absent: Last known descriptions of disconnected robots, used to name their blocks.
        name: Name of the behaviour.
    """
    page = compile_page(parse_workspace(workspace), Catalogue(robots, absent))
    return Linker().link((page,), name)


@dataclass(frozen=True)
class _ParsedPage:
    workspace: Workspace
    modules: Mapping[ModuleKey, ModuleFunction]
    """Functions that the other pages can call."""


@dataclass(frozen=True)
class _Cache:
    """Result of the previous compilation; pages are listed by revision.

    Attributes:
        environment: Robots and language.
        catalogue: Block descriptions for this environment.
    """

    environment: tuple[object, ...]
    catalogue: Catalogue
    parsed_pages: Mapping[int, _ParsedPage]
    compiled_pages: Mapping[int, CompiledPage]


class ProjectCompiler:
    """Compiler of one project. Compiles only pages that have changed since the previous call.

    A page is also compiled again when the robots or the language change, or when a function on a module page
    that it calls gets another name or other inputs. Thread-safe; simultaneous calls may compile a page twice.
    """

    def __init__(self) -> None:
        self._cache: _Cache | None = None
        self._linker = Linker()

    def compile(
        self,
        pages: Sequence[Page],
        robots: Sequence[Robot],
        *,
        absent: Sequence[Robot] = (),
        name: str = "Behaviour",
    ) -> Program:
        """Compile pages to a program.

        Never raises for invalid pages; `Program.problems` contains the problems.

        Args:
            pages: Pages in the order of the project.
            robots: Connected robots; blocks of other robots are skipped.
            absent: Last known descriptions of disconnected robots, used to name their blocks.
            name: Name of the project.
        """
        environment, cache = (tuple(robots), tuple(absent), language()), self._cache
        if cache is None or cache.environment != environment:
            cache = _Cache(environment, Catalogue(robots, absent), {}, {})
        parsed_pages = {
            page.revision: cache.parsed_pages.get(page.revision) or _parse_page(page) for page in pages
        }
        compiled_pages: dict[int, CompiledPage] = {}
        for page in pages:
            modules = _callable_functions(page, pages, parsed_pages)
            compiled = cache.compiled_pages.get(page.revision)
            if compiled is None or any(
                modules.get(key) != function for key, function in compiled.module_lookups.items()
            ):
                workspace = parsed_pages[page.revision].workspace
                compiled = compile_page(workspace, cache.catalogue.copy(), modules, page.block_prefix)
            compiled_pages[page.revision] = compiled
        self._cache = _Cache(environment, cache.catalogue, parsed_pages, compiled_pages)
        return self._linker.link(tuple(compiled_pages.values()), name)


def _callable_functions(
    page: Page, pages: Sequence[Page], parsed_pages: Mapping[int, _ParsedPage]
) -> dict[ModuleKey, ModuleFunction]:
    # Of two functions with the same name, that of the upper page is called.
    functions: dict[ModuleKey, ModuleFunction] = {}
    for module in reversed(pages):
        if module.kind == "module" and module is not page:
            functions |= parsed_pages[module.revision].modules
    return functions


def _parse_page(page: Page) -> _ParsedPage:
    workspace = parse_workspace(page.workspace.blocks, page.block_prefix)
    modules = module_functions(workspace, page.block_prefix) if page.kind == "module" else {}
    return _ParsedPage(workspace, modules)
