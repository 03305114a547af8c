"""Backpack: blocks that are available in all behaviours, in all Studio instances, and after a restart.

All instances share one JSON file next to the settings. Each change is applied to the current content of
the file under a lock, so that instances don't overwrite each other's changes. Unknown entries are
preserved.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

from app.blocks.model import deep_json
from app.core.storage.atomic_file import make_private, read_regular_file, write_atomically
from app.core.storage.file_lock import locked
from app.core.storage.folders import home
from app.errors import BackpackError
from nep.i18n import _, lazy, ngettext, number
from nep.system.replace_file import replace_file

VERSION = 1
MAX_STACKS = 100
"""Maximum number of stacks in the backpack."""
MAX_BYTES = 4_000_000
"""Maximum file size in bytes."""
FULL_MESSAGE = lazy("the backpack can hold at most {most} stacks; remove something first")
_MIN_TIME_STEP_S = 0.001
_SIZE_TOLERANCE_BYTES = 1_000_000  # tolerance for files of other instances when reading

Json = Mapping[str, object]
Stamp = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class BackpackStack:
    """Stack of blocks in the backpack.

    Attributes:
        id: Unique id of the stack.
        added_s: Time when the stack was added, in seconds since 1970.
        block: Blocks in Blockly's JSON format, with the names of their variables.
    """

    id: str
    added_s: float
    block: Json

    def to_json(self) -> dict[str, object]:
        """Return the stack as a JSON object, as used in the file and in the editor's page."""
        return {"id": self.id, "at": self.added_s, "block": self.block}


class _Content(NamedTuple):
    """Content of the backpack file.

    Attributes:
        items: Stacks that this version can read.
        unknown_entries: Entries that this version can't read; written back unchanged.
    """

    items: tuple[BackpackStack, ...] = ()
    unknown_entries: tuple[object, ...] = ()


class Backpack:
    """Content of the backpack, newest first.

    Changes are written to the file immediately. A failed change raises BackpackError.
    """

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        # `backpack.json` in `folder` (default: Studio's own); a missing file is an empty backpack.
        self.path = (folder if folder is not None else home()) / "backpack.json"
        self.revision = 0
        """Counter that increases when the content changes."""
        self._clock = clock
        self._content = _Content()
        self._stamp: Stamp | None = None
        self._problem = ""
        self._reported_problem = ""
        make_private(self.path.parent, "backpack*.json")

    @property
    def items(self) -> tuple[BackpackStack, ...]:
        """Stacks that this version can read, newest first."""
        return self._content.items

    def take_problem(self) -> str:
        """Return and clear the error message about the file; "" if there is no error."""
        problem, self._problem = self._problem, ""
        return problem

    def reload_if_changed(self) -> None:
        """Reload the file if another instance has changed it."""
        if _stamp(self.path) == self._stamp:
            return
        try:
            self._apply(self._read())
        except BackpackError as error:
            self._report_once(str(error))

    def add(self, blocks: Sequence[Json]) -> list[BackpackStack]:
        """Add stacks of blocks, the first on top, and return the new stacks.

        Raises BackpackError if the backpack is full or can't be written.
        """
        # Newer than all existing stacks, even if the clock was set back.
        newest_s = max(
            [self._clock(), *(item.added_s + len(blocks) * _MIN_TIME_STEP_S for item in self.items[:1])]
        )
        items = [
            BackpackStack(uuid4().hex, newest_s - index * _MIN_TIME_STEP_S, each)
            for index, each in enumerate(blocks)
        ]
        self.restore(items)
        return items

    def restore(self, items: Sequence[BackpackStack]) -> None:
        """Add removed stacks again at their previous positions.

        Raises BackpackError if the backpack is full or can't be written.
        """
        ids = {item.id for item in items}
        self._update_items(lambda stacks: (*(item for item in stacks if item.id not in ids), *items))

    def remove(self, ids: Sequence[str]) -> list[BackpackStack]:
        """Remove the stacks with these ids; return the removed stacks.

        Unknown ids are ignored. Raises BackpackError if the backpack can't be read or written.
        """
        removed: list[BackpackStack] = []

        def filter_stacks(stacks: tuple[BackpackStack, ...]) -> tuple[BackpackStack, ...]:
            removed.extend(item for item in stacks if item.id in ids)
            return tuple(item for item in stacks if item.id not in ids)

        self._update_items(filter_stacks)
        return removed

    def empty(self) -> list[BackpackStack]:
        """Remove and return all stacks that this version can read.

        Raises BackpackError if the backpack can't be read or written.
        """
        return self.remove([item.id for item in self.items])

    # -- file ------------------------------------------------------------------------------------------------

    def _update_items(self, change: Callable[[tuple[BackpackStack, ...]], tuple[BackpackStack, ...]]) -> None:
        with locked(self.path):
            content = self._read()
            updated = _Content(_sort_newest_first(change(content.items)), content.unknown_entries)
            if _ids(updated) != _ids(content):
                self._write(updated, grows=len(updated.items) > len(content.items))
            self._apply(updated)

    def _apply(self, content: _Content) -> None:
        if _ids(content) != _ids(self._content):
            self.revision += 1
        self._content = content
        self._stamp = _stamp(self.path)

    def _write(self, content: _Content, *, grows: bool) -> None:
        if grows and len(content.items) > MAX_STACKS:
            raise BackpackError(
                _("the backpack can hold at most {most} stacks; remove something first").format(
                    most=MAX_STACKS
                )
            )
        document = {
            "backpack": VERSION,
            "items": [*(item.to_json() for item in content.items), *content.unknown_entries],
        }
        data = deep_json.dumps(document, ascii=True).encode()
        if grows and len(data) > MAX_BYTES:
            raise BackpackError(
                _("the backpack can hold at most {most} MB; remove something first").format(
                    most=number(MAX_BYTES / 1e6, ".0f")
                )
            )
        try:
            write_atomically(self.path, data, durable=False, private=True)
        except OSError as error:
            raise BackpackError(
                _("can't save the backpack in '{path}': {reason}").format(
                    path=self.path, reason=error.strerror or str(error)
                )
            ) from error

    def _read(self) -> _Content:
        # Raises BackpackError when it can't be read now; a damaged file is renamed.
        try:
            data = read_regular_file(self.path, MAX_BYTES + _SIZE_TOLERANCE_BYTES)
        except (FileNotFoundError, NotADirectoryError):
            return _Content()
        except OSError as error:
            raise BackpackError(
                _("can't read the backpack from '{path}': {reason}").format(
                    path=self.path, reason=error.strerror or str(error)
                )
            ) from error
        try:
            document = deep_json.loads(data)
        except (ValueError, RecursionError):
            return self._rename_damaged_file()
        if isinstance(document, dict) and _is_newer(document.get("backpack")):
            return self._switch_to_own_file()
        if not isinstance(document, dict) or document.get("backpack") != VERSION:
            return self._rename_damaged_file()
        entries = document.get("items")
        if not isinstance(entries, list):
            return self._rename_damaged_file()
        parsed = [(entry, _parse_stack(entry)) for entry in entries]
        unknown = tuple(entry for entry, item in parsed if item is None)
        if unknown:
            self._report_once(
                ngettext(
                    "{count} item in the backpack can't be shown by this version of Studio; it stays in "
                    "'{path}'",
                    "{count} items in the backpack can't be shown by this version of Studio; they stay in "
                    "'{path}'",
                    len(unknown),
                ).format(count=len(unknown), path=self.path)
            )
        return _Content(_sort_newest_first(item for _entry, item in parsed if item is not None), unknown)

    def _switch_to_own_file(self) -> _Content:
        # The file of a newer Studio stays unchanged; a file of this version is used in addition.
        newer_path = self.path
        self.path = newer_path.with_name(f"backpack.format-{VERSION}.json")
        if self.path == newer_path:
            return self._rename_damaged_file()
        if not self.path.exists():
            self._report_once(
                _(
                    "the backpack in “{file}” belongs to a newer NEP Studio and is unchanged; blocks you add "
                    "here are saved separately"
                ).format(file=newer_path.name)
            )
        return self._read()

    def _rename_damaged_file(self) -> _Content:
        # The damaged file is kept under another name.
        path = self.path.with_name(f"{self.path.stem}.damaged.json")
        attempt = 2
        while path.exists():
            path = self.path.with_name(f"{self.path.stem}.damaged-{attempt}.json")
            attempt += 1
        try:
            replace_file(self.path, path)
        except OSError as error:
            raise BackpackError(
                _("can't read the backpack from '{path}': {reason}").format(
                    path=self.path, reason=_("the file is damaged")
                )
            ) from error
        self._report_once(
            _("the backpack is damaged, so a new one was created; the old one is in '{path}'").format(
                path=path
            )
        )
        return _Content()

    def _report_once(self, problem: str) -> None:
        # Once: a persistent problem is not repeated at each read.
        if problem != self._reported_problem:
            self._problem = self._reported_problem = problem


def _is_newer(version: object) -> bool:
    return isinstance(version, int) and not isinstance(version, bool) and version > VERSION


def _sort_newest_first(items: Iterable[BackpackStack]) -> tuple[BackpackStack, ...]:
    return tuple(sorted(items, key=lambda item: (-item.added_s, item.id)))


def _ids(content: _Content) -> list[str]:
    # Identifies the content: a stack in the backpack never changes.
    return [item.id for item in content.items]


def _parse_stack(entry: object) -> BackpackStack | None:
    if not isinstance(entry, Mapping):
        return None
    id, added_s, block = entry.get("id"), entry.get("at"), entry.get("block")
    if (
        not isinstance(id, str)
        or not id
        or not isinstance(added_s, int | float)
        or not math.isfinite(added_s)
    ):
        return None
    if not isinstance(block, Mapping) or not isinstance(block.get("type"), str):
        return None
    return BackpackStack(id, float(added_s), block)


def _stamp(path: Path) -> Stamp | None:
    try:
        file_stat = path.stat()
    except OSError:
        return None
    return file_stat.st_mtime_ns, file_stat.st_size, file_stat.st_ino
