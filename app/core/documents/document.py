"""The behaviour that is open: its blocks, its file, its journal, and what the compiler says of it."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from app.blocks import Problem, Program, compile_behaviour, editor_definitions
from app.blocks.compiler.stack import Stack
from app.blocks.fixes.fixes import mend
from app.blocks.fixes.replace_robot import blocks_of, use_robot
from app.core.documents.background_worker import BackgroundWorker
from app.core.documents.examples import translated
from app.core.documents.file_format import (
    DIVIDE,
    TOO_DEEP,
    BehaviourFile,
    Descriptions,
    Workspace,
    read_file,
    write_file,
)
from app.core.documents.journal import Journal, Unsaved
from app.core.documents.rename import path_named, rename_file, why_not
from app.core.documents.titles import name_of
from app.core.documents.versions import Stamp, follow_file, stamp_of
from app.core.documents.workspace_json import LONG_CHARACTERS, WorkspaceJson
from app.core.storage import deep_json
from app.errors import DescriptionError, DocumentError
from app.robots.description.description import Robot, parse
from nep.i18n import _, lazy

UNNAMED = lazy("New behaviour")

QUICK_S = 0.02
"""A behaviour that compiles faster than this is compiled at once, in the window's thread."""
Key = tuple[int, int, int]

_keys = itertools.count(1)


@dataclass(frozen=True)
class Compiled:
    """A program, what it was made of, and how long that took."""

    key: Key
    program: Program
    seconds: float


class Document:
    """One behaviour.

    ``key`` names it among those that are open. ``revision`` grows when it is replaced from outside the
    editor, ``mends`` when Studio changed its blocks in a way that can be undone, ``edits`` with every edit.
    """

    def __init__(
        self, journal: Callable[[], Journal] = Journal, clock: Callable[[], float] = time.time
    ) -> None:
        """Start with an empty new behaviour; ``journal`` makes the journal of each."""
        self._make_journal = journal
        self._clock = clock
        self._timer = time.perf_counter
        self._journal = journal()
        self.key = f"behaviour-{next(_keys)}"
        self.path: Path | None = None
        self.name = _(UNNAMED)
        self.others: Mapping[str, object] = {}
        self._json = WorkspaceJson.of({})
        self.robots: dict[str, Mapping[str, object]] = {}
        self._read: dict[str, tuple[Mapping[str, object], Robot | None]] = {}
        """Their descriptions as they were read last: reading one takes 15 ms, and each edit asks for all."""
        self.dirty = False
        self.saved_at: float | None = None
        self._stamp: Stamp | None = None  # of the file, as it was read or written last
        self.revision = 0
        self.mends = 0
        self.edits = 0
        self.definitions_revision = 0
        self._connected: tuple[Robot, ...] = ()
        self._topics: tuple[str, ...] = ()
        self._compiled: tuple[Key, Program] | None = None
        self._compile_s: float | None = None
        self._asked: Key | None = None
        self.compiler: BackgroundWorker[Compiled] | None = None
        self.journal_writer: BackgroundWorker[bool] | None = None
        self._definitions: tuple[int, Mapping[str, object]] | None = None
        self._journal_error: str | None = None

    # -- editing and files -----------------------------------------------------------------------------------

    @property
    def workspace(self) -> Workspace:
        """Its blocks; parsed when they are asked for, if the editor told them as text."""
        return self._json.blocks

    @workspace.setter
    def workspace(self, blocks: Workspace) -> None:
        self._json = WorkspaceJson.of(blocks)

    @property
    def has_blocks(self) -> bool:
        """Whether there is any block in it."""
        return self._json.has_blocks

    def edited(self, workspace: Workspace | WorkspaceJson) -> None:
        """The editor changed the blocks. They are journalled as they came; nobody waits for the disk."""
        told = workspace if isinstance(workspace, WorkspaceJson) else WorkspaceJson.of(workspace)
        if told.same_as(self._json):
            return
        self._json = told
        self.dirty = True
        self.edits += 1
        self._keep_used_robots()
        self._write_journal()

    def new(self, name: str = "") -> None:
        """Begin an empty behaviour."""
        self._replace(BehaviourFile(name or _(UNNAMED), {}, {}), None)

    def open(self, path: Path) -> None:
        """Open a file. Raises DocumentError; then what was open stays."""
        self._replace(read_file(path), path)
        self.saved_at = path.stat().st_mtime
        self._stamp = stamp_of(path)

    def example(self, path: Path) -> None:
        """Open an example as a new, unsaved behaviour in the language of now. Raises DocumentError."""
        self._replace(translated(read_file(path)), None)

    def copy(self, path: Path, name: str) -> None:
        """Open a file as a new, unsaved behaviour of another name. Raises DocumentError."""
        self._replace(replace(read_file(path), name=name), None)

    def duplicate(self, other: Document, name: str) -> None:
        """Become a new, unsaved behaviour with the blocks of another one."""
        self._replace(BehaviourFile(name, {}, other.robots, other.others), None)
        self.edited(other.workspace)

    def recover(self, unsaved: Unsaved) -> None:
        """Put back what a crash left behind.

        It is unsaved, and journalled anew before the old journal goes.
        """
        found = BehaviourFile(unsaved.name, unsaved.workspace, unsaved.robots, unsaved.others)
        self._replace(found, unsaved.path)
        now = stamp_of(unsaved.path) if unsaved.path is not None else None
        if now is not None and now[0] <= unsaved.edited_s * 1e9:
            self._stamp = now  # nobody wrote the file after that work was done
        self.dirty = True
        self._write_journal()
        if self.is_kept:
            unsaved.journal.unlink(missing_ok=True)

    def save(self, path: Path | None = None) -> None:
        """Write the file, atomically; with ``path`` it becomes the behaviour's file. Raises DocumentError.

        The file holds its name too: programs that read files go by that one.
        """
        target = path if path is not None else self.path
        if target is None:
            raise DocumentError(None, _("this behaviour is not saved to a file yet"), _("choose one"))
        name = name_of(target, self.name)
        write_file(target, BehaviourFile(name, self.workspace, self.robots, self.others))
        self.path, self.name = target, name
        self.dirty = False
        self.saved_at = self._clock()
        self._stamp = stamp_of(target)
        self._discard_journal()

    def rename_to(self, name: str) -> None:
        """Give it another name, and its file, if it has one. Raises DocumentError; then nothing changed."""
        wanted = name.strip()
        problem = why_not(wanted, self.path)
        if problem:
            raise DocumentError(self.path, problem)
        new = path_named(self.path, wanted) if self.path is not None else None
        if self.path is not None and new is not None and new != self.path:
            changed = self.changed_outside
            rename_file(self.path, new)
            follow_file(self.path, new)
            self.path = new
            self._stamp = self._stamp if changed else stamp_of(new)
        elif self.path is not None and wanted != self.name:
            self.dirty = True  # in Studio's own folder the name is what the file says
        self.name = wanted
        self._compiled = self._asked = None  # a program says whose it is
        if self.dirty:
            self._write_journal()

    def mend(self, action: str) -> bool:
        """Do what a problem's button says to the blocks; False when the action is no matter of blocks."""
        mended = deep_json.deeply(lambda: mend(self.workspace, action))
        if mended is None:
            return False
        self.edited(mended)
        self.mends += 1
        return True

    def use_robot(self, missing: str, robot: Robot) -> bool:
        """Let a robot do what the blocks ask of one that is missing; False when nothing asks it."""
        known = next((each for each in self._known() if each.name == missing), None)
        if known is None or not blocks_of(self.workspace, missing):
            return False
        made = deep_json.deeply(lambda: use_robot(self.workspace, missing, known.model, robot))
        self.edited(made)
        self.mends += 1
        return True

    def lose_file(self) -> None:
        """Another behaviour was saved as its file: its blocks are unsaved work now."""
        self.path, self.dirty = None, True
        self._write_journal()

    def file_went_back(self) -> None:
        """Its file says again what it said before the last saving: the blocks here are unsaved work."""
        self.dirty, self._stamp = True, stamp_of(self.path) if self.path is not None else None
        self._write_journal()

    @property
    def changed_outside(self) -> bool:
        """Whether somebody else has written its file since it was opened or saved here."""
        now = stamp_of(self.path) if self.path is not None else None
        return now is not None and now != self._stamp

    @property
    def blank(self) -> bool:
        """Whether it is a new behaviour that nobody has touched: another may take its place."""
        return self.path is None and not self.dirty and not self.workspace

    @property
    def journal(self) -> str:
        """The name of the file that keeps its unsaved work."""
        return self._journal.name

    @property
    def journal_error(self) -> str | None:
        """Why unsaved work is not kept, in a sentence; None while it is, or is just being written."""
        if self.journal_writer is not None:
            self._written(partial(self.journal_writer.take, self._journal.name))
        return self._journal_error

    @property
    def is_kept(self) -> bool:
        """Whether its newest state is on the disk; waits for what is being written, 2 s at most."""
        finished = self.journal_writer is None or self.journal_writer.finish(self._journal.name)
        return finished and self.journal_error is None

    def keep_again(self) -> bool:
        """Try once more to journal unsaved work that the disk did not take; whether all of it is kept."""
        if self.dirty and not self.is_kept:
            self._write_journal()
        return not self.dirty or self.is_kept

    def close(self) -> None:
        """The window closes: unsaved work stays in the journal and is offered at the next start."""
        if not self.dirty:
            self._discard_journal()
        elif self.journal_writer is not None:
            self.journal_writer.finish(self._journal.name)

    # -- robots and the compiler -----------------------------------------------------------------------------

    def set_connected(self, robots: Sequence[Robot]) -> None:
        """The robots that are connected now."""
        if tuple(robots) != self._connected:
            self._connected = tuple(robots)
            self.definitions_revision += 1
            self._keep_used_robots()

    def set_topics(self, topics: Sequence[str]) -> None:
        """The topics that the editor offers to choose from."""
        if tuple(topics) != self._topics:
            self._topics = tuple(topics)
            self.definitions_revision += 1

    @property
    def absent(self) -> tuple[Robot, ...]:
        """Robots that the behaviour knows and that are not connected."""
        there = {robot.name for robot in self._connected}
        return tuple(robot for robot in self._known() if robot.name not in there)

    def program(self) -> Program:
        """The blocks as a program, for the robots known now; compiled once for each edit."""
        key = self._key()
        if self._compiled is None or self._compiled[0] != key:
            began = self._timer()
            self._compiled = (key, self._compiling()())
            self._compile_s = self._timer() - began
        return self._compiled[1]

    def try_program(self, stack: Stack) -> Program | None:
        """One stack of the blocks as a program of its own; None when it is not there any more."""
        made = deep_json.deeply(lambda: stack.workspace(self.workspace))
        if made is None:
            return None
        program = _compile(WorkspaceJson.of(made), self._connected, self.absent, self.name)
        return replace(program, shows_value=stack.is_value)

    def newest(self) -> Program | None:
        """The program of the newest edit that is compiled; a long one is compiled beside the window.

        So it may be that of an edit before, and None when a long behaviour has just been opened.
        """
        key = self._key()
        if self._compiled is not None and self._compiled[0] == key:
            return self._compiled[1]
        if self.compiler is None:
            return self.program()
        done = self.compiler.take(self.key)
        if done is not None:
            self._compiled, self._compile_s = (done.key, done.program), done.seconds
        if self._asked != key:
            if self._is_quick():
                return self.program()
            self._asked = key
            self.compiler.ask(self.key, partial(_compiled, key, self._compiling(), self._timer))
        return self._compiled[1] if self._compiled is not None else None

    def _is_quick(self) -> bool:
        """Whether compiling holds the window up so little that it may be done at once."""
        if self._compile_s is not None:
            return self._compile_s < QUICK_S
        return self._asked is None and not self._json.is_longer_than(LONG_CHARACTERS)

    def _key(self) -> Key:
        return self.revision, self.edits, self.definitions_revision

    def _compiling(self) -> Callable[[], Program]:
        """The compilation of what is here now; it may run in any thread, and parses there."""
        return partial(_compile, self._json, self._connected, self.absent, self.name)

    def problems(self) -> tuple[Problem, ...]:
        """What the compiler says of the blocks."""
        return self.program().problems

    def definitions(self) -> Mapping[str, object]:
        """Blocks and toolbox for the editor, from the categories and the robots connected now."""
        if self._definitions is None or self._definitions[0] != self.definitions_revision:
            made = editor_definitions(self._connected, self.absent, self._topics)
            self._definitions = (self.definitions_revision, made)
        return self._definitions[1]

    # -- inside ----------------------------------------------------------------------------------------------

    def _replace(self, found: BehaviourFile, path: Path | None) -> None:
        self._discard_journal()
        self._journal = self._make_journal()
        self.name = name_of(path, found.name) if path is not None else found.name
        self.path, self.workspace = path, found.workspace
        self.robots, self.others = dict(found.robots), found.others
        self._compile_s = self._asked = None
        self.dirty = False
        self.saved_at = self._stamp = None
        self.revision += 1
        self.definitions_revision += 1

    def _write_journal(self) -> None:
        name, path, robots = self.name, self.path, dict(self.robots)
        work = partial(_keep, self._journal, name, path, self._json, robots, self.others)
        if self.journal_writer is not None:
            self.journal_writer.ask(self._journal.name, work)
        else:
            self._written(work)

    def _written(self, written: Callable[[], bool | None]) -> None:
        """Take over how writing the journal ended; nothing has when that is None."""
        try:
            ended = written()
        except OSError as error:
            self._journal_error = _("can't back up unsaved work ({reason}); save the file now").format(
                reason=error.strerror or error
            )
        except RecursionError:
            self._journal_error = _("can't back up unsaved work: {reason}; {advice}").format(
                reason=_(TOO_DEEP), advice=_(DIVIDE)
            )
        else:
            self._journal_error = None if ended else self._journal_error

    def _discard_journal(self) -> None:
        if self.journal_writer is not None:
            self.journal_writer.forget(self._journal.name)
            self.journal_writer.finish(self._journal.name)  # or it would write what was discarded
            self.journal_writer.forget(self._journal.name)
        self._journal.discard()
        self._journal_error = None

    def _keep_used_robots(self) -> None:
        """Keep the descriptions of the robots that the blocks name: they are known without them later."""
        try:
            text = self._json.text
        except RecursionError:
            return  # the journal, which comes next, says so
        for robot in self._connected:
            if json.dumps(robot.name, ensure_ascii=False) in text:
                self.robots[robot.name] = dict(robot.source)

    def _known(self) -> list[Robot]:
        before, self._read = self._read, {}
        for name, description in self.robots.items():
            known = before.get(name)
            is_known = known is not None and _are_same(known[0], description)
            self._read[name] = known if known and is_known else (description, _parsed(description))
        return [robot for _description, robot in self._read.values() if robot is not None]


def _keep(
    journal: Journal,
    name: str,
    path: Path | None,
    told: WorkspaceJson,
    robots: Descriptions,
    others: Mapping[str, object],
) -> bool:
    journal.write(name, path, told.text, robots, others)
    return True


def _compiled(key: Key, compiling: Callable[[], Program], timer: Callable[[], float]) -> Compiled:
    began = timer()
    return Compiled(key, compiling(), timer() - began)


def _compile(told: WorkspaceJson, robots: Sequence[Robot], absent: Sequence[Robot], name: str) -> Program:
    return compile_behaviour(told.blocks, robots, absent=absent, name=name)


def _are_same(one: Mapping[str, object], other: Mapping[str, object]) -> bool:
    try:
        return one == other
    except RecursionError:
        return False  # a file may say anything, as deep as it likes


def _parsed(description: Mapping[str, object]) -> Robot | None:
    try:
        return parse(description)
    except DescriptionError:
        return None  # its blocks are kept as unknown ones, and the problems list names them


def read(path: Path) -> tuple[str, Workspace, Descriptions]:
    """Name, workspace and robots of a behaviour file. Raises DocumentError with what to do next."""
    found = read_file(path)
    return found.name, found.workspace, found.robots
