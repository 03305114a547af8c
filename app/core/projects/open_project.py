"""Open project: its pages, file, journal and compiled program."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from app.blocks.fixes.replace_robot import blocks_of, with_robot_replaced
from app.blocks.model import deep_json
from app.blocks.model.program import Problem, Program
from app.blocks.model.project import ALWAYS_ID, Page, Project
from app.blocks.model.stack import Stack
from app.blocks.model.workspace_json import LONG_TEXT_LENGTH, WorkspaceJson
from app.core.projects.examples import translated
from app.core.projects.file_format import (
    SPLIT_ADVICE,
    TOO_DEEP_MESSAGE,
    read_file,
    write_file,
)
from app.core.projects.journal import Journal, UnsavedWork
from app.core.projects.rename import name_problem, rename_file, renamed_path
from app.core.projects.titles import name_of
from app.core.projects.versions import SavedVersion, Stamp, rename_versions, save_version, stamp_of
from app.core.storage.background_worker import BackgroundWorker
from app.errors import DescriptionError, DocumentError
from app.intents import BlockFix
from app.robots.description.description import Robot, parse
from nep.i18n import _, lazy
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.blocks.compiler import compiler as project_compiler
    from app.blocks.fixes import fixes
    from app.blocks.toolbox import definitions as toolbox
else:  # imported after the window is shown
    project_compiler = lazy_module("app.blocks.compiler.compiler")
    fixes, replace_robot = (
        lazy_module("app.blocks.fixes.fixes"),
        lazy_module("app.blocks.fixes.replace_robot"),
    )
    toolbox = lazy_module("app.blocks.toolbox.definitions")

DEFAULT_NAME = lazy("New behaviour")

INLINE_COMPILE_S = 0.02
"""Compile time in seconds up to which a behaviour is compiled in the main thread."""
Key = tuple[str, int, int, int]
Workspace = Mapping[str, object]
Descriptions = Mapping[str, Mapping[str, object]]

_key_numbers = itertools.count(1)


@dataclass(frozen=True)
class CompiledProgram:
    """Result of a compilation.

    Attributes:
        key: Key of the source that was compiled.
        program: Compiled program.
        compile_s: Compile time in seconds.
    """

    key: Key
    program: Program
    compile_s: float


SaveReason = Literal["edited", "replaced", "changed externally"]


@dataclass(frozen=True)
class SaveResult:
    """Result of saving a project.

    Attributes:
        version: Previous content of the file; None if there was none or it wasn't kept.
        reason: Reason why the previous content was kept: edits of this project, another file at the path, or
            changes by another program.
        version_error: Reason why the previous content couldn't be kept; "" if it was kept.
    """

    version: SavedVersion | None = None
    reason: SaveReason = "edited"
    version_error: str = ""


class OpenProject:
    """One open project.

    Attributes:
        key: Identifier of the project, unique among all open projects.
        project: Content of the project.
        revision: Counter that increases when code other than the editor replaces the content.
        fixes: Counter that increases when Studio changes the blocks in an undoable way.
        edits: Counter that increases with every edit.
    """

    def __init__(
        self, journal: Callable[[], Journal] = Journal, clock: Callable[[], float] = time.time
    ) -> None:
        self._create_journal = journal
        self._clock = clock
        self._timer = time.perf_counter
        self._journal = journal()
        self.key = f"behaviour-{next(_key_numbers)}"
        self.path: Path | None = None
        self.project = Project.of_blocks(_(DEFAULT_NAME), {})
        self._parsed_robots: dict[str, tuple[Mapping[str, object], Robot | None]] = {}
        """Cache of parsed robot descriptions: parsing one takes 15 ms, and every edit needs all of them."""
        self.dirty = False
        self.saved_s: float | None = None
        self._stamp: Stamp | None = None  # stamp of the file when it was last read or written
        self.revision = 0
        self.fixes = 0
        self.edits = 0
        self.definitions_revision = 0
        self._connected_robots: tuple[Robot, ...] = ()
        self._topics: tuple[str, ...] = ()
        self._compiled: tuple[Key, Program] | None = None
        self._compile_s: float | None = None
        self._compiling_key: Key | None = None
        self.compiler: BackgroundWorker[CompiledProgram] | None = None
        self.journal_writer: BackgroundWorker[Path] | None = None
        self._definitions: tuple[int, Mapping[str, object]] | None = None
        self._journal_error: str | None = None

    # -- editing and files -----------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the project."""
        return self.project.name

    @name.setter
    def name(self, name: str) -> None:
        self.project = replace(self.project, name=name)

    @property
    def robots(self) -> Descriptions:
        """Descriptions of the robots in use, by name."""
        return self.project.robots

    @property
    def workspace(self) -> Workspace:
        """Blocks of the page "always"; text from the editor is parsed at the first access."""
        return self.project.always.workspace.blocks

    @property
    def has_blocks(self) -> bool:
        """True if a page contains at least one block."""
        return any(page.workspace.has_blocks for page in self.project.pages)

    def apply_edit(self, workspace: Workspace | WorkspaceJson, page_id: str = ALWAYS_ID) -> None:
        """Apply an edit from the editor and write it to the journal in the background.

        Args:
            workspace: Blocks of the page after the edit.
            page_id: Id of the page; KeyError is raised if there is none.
        """
        edited = workspace if isinstance(workspace, WorkspaceJson) else WorkspaceJson.from_blocks(workspace)
        page = self.project.page(page_id)
        if not edited.is_equal_to(page.workspace):
            self.apply_project(self.project.with_page(page.with_workspace(edited)))

    def apply_project(self, project: Project) -> None:
        """Apply an edit of the pages, and write it to the journal in the background."""
        self.project = project
        self.dirty = True
        self.edits += 1
        self._store_used_robots()
        self._write_journal()

    def new(self, name: str = "") -> None:
        """Replace the content with an empty behaviour.

        Args:
            name: Name of the behaviour; "" for the default name.
        """
        self._replace(Project.of_blocks(name or _(DEFAULT_NAME), {}), None)

    def open(self, path: Path) -> None:
        """Open a file. If DocumentError is raised, the current content is unchanged."""
        self._replace(read_file(path), path)
        self.saved_s = path.stat().st_mtime
        self._stamp = stamp_of(path)

    def open_example(self, path: Path) -> None:
        """Open an example as a new, unsaved behaviour, translated into the current language.

        Raises DocumentError if the file can't be read; the current content is then unchanged.
        """
        self._replace(translated(read_file(path)), None)

    def copy(self, path: Path, name: str) -> None:
        """Open a file as a new, unsaved behaviour named ``name``.

        Raises DocumentError if the file can't be read; the current content is then unchanged.
        """
        self._replace(replace(read_file(path), name=name), None)

    def duplicate(self, other: OpenProject, name: str) -> None:
        """Copy the content of another project into this one, which is new and unsaved."""
        self._replace(replace(other.project, name=name), None)
        if not self.is_blank:
            self.apply_project(self.project)

    def recover(self, unsaved: UnsavedWork) -> None:
        """Restore the unsaved work of a crashed session.

        The behaviour stays unsaved: its content is written to a new journal before the old journal is
        deleted.
        """
        self._replace(unsaved.project, unsaved.path)
        stamp = stamp_of(unsaved.path) if unsaved.path is not None else None
        if stamp is not None and stamp[0] <= unsaved.edited_s * 1e9:
            self._stamp = stamp  # the file was not changed after that work
        self.dirty = True
        self._write_journal()
        if self.is_on_disk:
            unsaved.journal.unlink(missing_ok=True)

    def save(self, path: Path | None = None, *, requires_version: bool = False) -> SaveResult:
        """Keep the previous content of the file as a version, then write the project atomically.

        The project's name is stored in the file too, for programs that display it.

        Args:
            path: File, which becomes the file of the project; None for the current file.
            requires_version: True to write nothing if the previous content can't be kept. Content that
                doesn't come from this project is always kept.

        Raises:
            DocumentError: The file can't be written, its previous content can't be kept, or `path` is None
                and the project has no file.
        """
        target = path if path is not None else self.path
        if target is None:
            raise DocumentError(None, _("this behaviour isn't saved to a file yet"), _("choose a file"))
        result = self._keep_version(target, is_required=requires_version)
        saved = replace(self.project, name=name_of(target, self.name))
        write_file(target, saved)
        self.path, self.project = target, saved
        self.dirty = False
        self.saved_s = self._clock()
        self._stamp = stamp_of(target)
        self._discard_journal()
        return result

    def _keep_version(self, target: Path, *, is_required: bool) -> SaveResult:
        if self.path is None or target.resolve() != self.path.resolve():
            return SaveResult(save_version(target), "replaced")
        if self.is_changed_externally:
            return SaveResult(save_version(target), "changed externally")
        if not self.dirty:
            return SaveResult()
        try:
            return SaveResult(save_version(target))
        except DocumentError as error:
            if is_required:
                raise
            return SaveResult(version_error=str(error))

    def rename_to(self, name: str) -> None:
        """Rename the behaviour and its file, if it has one.

        If DocumentError is raised, nothing is changed.
        """
        new_name = name.strip()
        problem = name_problem(new_name, self.path)
        if problem:
            raise DocumentError(self.path, problem)
        new = renamed_path(self.path, new_name) if self.path is not None else None
        if self.path is not None and new is not None and new != self.path:
            was_changed_externally = self.is_changed_externally
            rename_file(self.path, new)
            rename_versions(self.path, new)
            self.path = new
            self._stamp = self._stamp if was_changed_externally else stamp_of(new)
        elif self.path is not None and new_name != self.name:
            self.dirty = True  # in Studio's own folder the name is in the file
        self.name = new_name
        if self.dirty:
            self._write_journal()

    def can_fix(self, action: BlockFix) -> bool:
        """Return True if the fix of a problem can be applied to the blocks."""
        return self._fixed_page(action) is not None

    def fix(self, action: BlockFix) -> bool:
        """Apply the fix of a problem to the blocks; return False if that isn't possible."""
        page = self._fixed_page(action)
        if page is None:
            return False
        self.apply_project(self.project.with_page(page))
        self.fixes += 1
        return True

    def _fixed_page(self, action: BlockFix) -> Page | None:
        id = next(iter(fixes.block_ids(action)), "")
        pages = self.project.pages[1:] if id else ()
        page = next((each for each in pages if id.startswith(each.block_prefix)), self.project.always)
        page_action = fixes.without_prefix(action, page.block_prefix)
        blocks = deep_json.run_deep(lambda: fixes.fix(page.workspace.blocks, page_action))
        return page.with_workspace(WorkspaceJson.from_blocks(blocks)) if blocks is not None else None

    def replace_missing_robot(self, missing: str, robot: Robot) -> bool:
        """Replace a missing robot in all blocks with another robot.

        Returns:
            False if no block uses the missing robot, or if the project has no valid description of this
            robot.
        """
        missing_robot = next((each for each in self._known_robots() if each.name == missing), None)
        pages = [page for page in self.project.pages if blocks_of(page.workspace.blocks, missing)]
        if missing_robot is None or not pages:
            return False
        project = self.project
        for page in pages:
            blocks = deep_json.run_deep(
                partial(
                    with_robot_replaced,
                    page.workspace.blocks,
                    missing,
                    missing_robot.model,
                    robot,
                )
            )
            project = project.with_page(page.with_workspace(WorkspaceJson.from_blocks(blocks)))
        self.apply_project(project)
        self.fixes += 1
        return True

    def detach_file(self) -> None:
        """Detach the behaviour from its file, because another behaviour was saved to that file.

        The behaviour becomes unsaved.
        """
        self.path, self.dirty = None, True
        self._write_journal()

    def on_file_reverted(self) -> None:
        """Mark the behaviour as unsaved, because the last save of its file was undone."""
        self.dirty, self._stamp = True, stamp_of(self.path) if self.path is not None else None
        self._write_journal()

    @property
    def is_changed_externally(self) -> bool:
        """True if another program changed the file since it was opened or saved; False if it is missing."""
        stamp = stamp_of(self.path) if self.path is not None else None
        return stamp is not None and stamp != self._stamp

    @property
    def is_blank(self) -> bool:
        """True if the behaviour is new, unchanged and empty, so that its tab can be reused."""
        return self.path is None and not self.dirty and self.project.is_single_page and not self.workspace

    @property
    def journal_name(self) -> str:
        """File name of the journal."""
        return self._journal.name

    @property
    def journal_error(self) -> str | None:
        """Reason why unsaved work can't be written to the journal; None if there is no error.

        None while a write is in progress.
        """
        if self.journal_writer is not None:
            self._apply_journal_result(partial(self.journal_writer.pop_result, self._journal.name))
        return self._journal_error

    @property
    def is_on_disk(self) -> bool:
        """True if the current state is on disk. Waits at most 2 s for a write in progress."""
        is_finished = self.journal_writer is None or self.journal_writer.finish(self._journal.name)
        return is_finished and self.journal_error is None

    def retry_journal(self) -> bool:
        """Retry a failed journal write; return True if all unsaved work is on disk."""
        if self.dirty and not self.is_on_disk:
            self._write_journal()
        return not self.dirty or self.is_on_disk

    def close(self) -> None:
        """Close the behaviour when the window closes.

        Unsaved work stays in the journal and is offered at the next start.
        """
        if not self.dirty:
            self._discard_journal()
        elif self.journal_writer is not None:
            self.journal_writer.finish(self._journal.name)

    # -- robots and the compiler -----------------------------------------------------------------------------

    def set_connected(self, robots: Sequence[Robot]) -> None:
        """Set the robots that are connected, whose blocks can be used."""
        if tuple(robots) != self._connected_robots:
            self._connected_robots = tuple(robots)
            self.definitions_revision += 1
            self._store_used_robots()

    def set_topics(self, topics: Sequence[str]) -> None:
        """Set the names of the topics that the editor suggests."""
        if tuple(topics) != self._topics:
            self._topics = tuple(topics)
            self.definitions_revision += 1

    @property
    def absent_robots(self) -> tuple[Robot, ...]:
        """Robots that the behaviour uses and that are not connected."""
        connected_names = {robot.name for robot in self._connected_robots}
        return tuple(robot for robot in self._known_robots() if robot.name not in connected_names)

    def program(self) -> Program:
        """Return the compiled program of the behaviour, cached until the next edit."""
        key = self._key()
        if self._compiled is None or self._compiled[0] != key:
            started_s = self._timer()
            self._compiled = (key, self._compile_job()())
            self._compile_s = self._timer() - started_s
        return self._compiled[1]

    def compile_trial(self, stack: Stack, page_id: str = ALWAYS_ID) -> Program | None:
        """Compile a single stack of blocks as a program; return None if the stack no longer exists.

        Args:
            stack: Stack of blocks.
            page_id: Id of the page with the stack; KeyError is raised if there is none.
        """
        page = self.project.page(page_id)
        blocks = deep_json.run_deep(lambda: stack.workspace(page.workspace.blocks))
        if blocks is None:
            return None
        tried_page = page.with_workspace(WorkspaceJson.from_blocks(blocks))
        pages = (tried_page, *(each for each in self.project.modules if each.id != page_id))
        robots, absent = self._connected_robots, self.absent_robots
        program = project_compiler.ProjectCompiler().compile(pages, robots, absent=absent, name=self.name)
        return replace(program, shows_value=stack.is_value)

    def newest_program(self) -> Program | None:
        """Return the newest compiled program; None if a long behaviour has not been compiled yet.

        Long behaviours are compiled in the background; until that has finished, the program of an
        earlier edit is returned if there is one. Short behaviours are compiled in the call, and if
        `compiler` is None, long ones are too.
        """
        key = self._key()
        if self._compiled is not None and self._compiled[0] == key:
            return self._compiled[1]
        if self.compiler is None:
            return self.program()
        compiled = self.compiler.pop_result(self.key)
        if compiled is not None:
            self._compiled, self._compile_s = (compiled.key, compiled.program), compiled.compile_s
        if self._compiling_key != key:
            if self._is_quick_to_compile():
                return self.program()
            self._compiling_key = key
            self.compiler.submit(self.key, partial(_compile_timed, key, self._compile_job(), self._timer))
        return self._compiled[1] if self._compiled is not None else None

    def _is_quick_to_compile(self) -> bool:
        if self._compile_s is not None:
            return self._compile_s < INLINE_COMPILE_S
        return self._compiling_key is None and not any(
            page.workspace.is_longer_than(LONG_TEXT_LENGTH // len(self.project.pages))
            for page in self.project.pages
        )

    def _key(self) -> Key:
        return self.name, self.revision, self.edits, self.definitions_revision

    @cached_property
    def _page_cache(self) -> project_compiler.ProjectCompiler:
        return project_compiler.ProjectCompiler()

    def _compile_job(self) -> Callable[[], Program]:
        # Compiles the current state; it may run in any thread, and parses there.
        pages, robots = self.project.pages, self._connected_robots
        return partial(self._page_cache.compile, pages, robots, absent=self.absent_robots, name=self.name)

    def problems(self) -> tuple[Problem, ...]:
        """Return the problems that the compiler found."""
        return self.program().problems

    def definitions(self) -> Mapping[str, object]:
        """Return the block and toolbox definitions for the editor, including those of connected robots."""
        if self._definitions is None or self._definitions[0] != self.definitions_revision:
            definitions = toolbox.editor_definitions(self._connected_robots, self.absent_robots, self._topics)
            self._definitions = (self.definitions_revision, definitions)
        return self._definitions[1]

    # -- private ---------------------------------------------------------------------------------------------

    def _replace(self, project: Project, path: Path | None) -> None:
        self._discard_journal()
        self._journal = self._create_journal()
        self.path = path
        self.project = replace(project, name=name_of(path, project.name)) if path is not None else project
        self._compiled = self._compile_s = self._compiling_key = None
        self.dirty = False
        self.saved_s = self._stamp = None
        self.revision += 1
        self.definitions_revision += 1

    def _write_journal(self) -> None:
        write_job = partial(self._journal.write, self.project, self.path)
        if self.journal_writer is not None:
            self.journal_writer.submit(self._journal.name, write_job)
        else:
            self._apply_journal_result(write_job)

    def _apply_journal_result(self, take_result: Callable[[], Path | None]) -> None:
        # Applies the result of writing the journal; None means not finished.
        try:
            written_path = take_result()
        except OSError as error:
            self._journal_error = _("can't back up unsaved work ({reason}); save the file now").format(
                reason=error.strerror or error
            )
        except RecursionError:
            self._journal_error = _("can't back up unsaved work: {reason}; {advice}").format(
                reason=_(TOO_DEEP_MESSAGE), advice=_(SPLIT_ADVICE)
            )
        else:
            self._journal_error = None if written_path is not None else self._journal_error

    def _discard_journal(self) -> None:
        if self.journal_writer is not None:
            self.journal_writer.discard(self._journal.name)
            self.journal_writer.finish(self._journal.name)  # otherwise it would write the discarded state
            self.journal_writer.discard(self._journal.name)
        self._journal.discard()
        self._journal_error = None

    def _store_used_robots(self) -> None:
        # Stores the descriptions of the used robots, so that the behaviour is complete without them later.
        try:
            texts = [page.workspace.text for page in self.project.pages]
        except RecursionError:
            return  # writing the journal reports it
        used_robots = {
            robot.name: dict(robot.source)
            for robot in self._connected_robots
            if any(json.dumps(robot.name, ensure_ascii=False) in text for text in texts)
        }
        if used_robots:
            self.project = replace(self.project, robots={**self.project.robots, **used_robots})

    def _known_robots(self) -> list[Robot]:
        previous_robots, self._parsed_robots = self._parsed_robots, {}
        for name, description in self.robots.items():
            previous = previous_robots.get(name)
            is_known = previous is not None and _are_equal(previous[0], description)
            self._parsed_robots[name] = (
                previous if previous and is_known else (description, _parse_robot(description))
            )
        return [robot for _description, robot in self._parsed_robots.values() if robot is not None]


def _compile_timed(
    key: Key, compile_program: Callable[[], Program], timer: Callable[[], float]
) -> CompiledProgram:
    started_s = timer()
    return CompiledProgram(key, compile_program(), timer() - started_s)


def _are_equal(one: Mapping[str, object], other: Mapping[str, object]) -> bool:
    try:
        return one == other
    except RecursionError:
        return False  # a file may be nested arbitrarily deep


def _parse_robot(description: Mapping[str, object]) -> Robot | None:
    try:
        return parse(description)
    except DescriptionError:
        return None  # its blocks become unknown blocks and are listed as problems
