"""Journals: every edit of unsaved work is written to disk in the background, in case Studio crashes.

Each open behaviour has one file in the ``journal`` folder. The file contains the id of the writing
process, so that another instance doesn't offer work that is still open.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.blocks.model import deep_json
from app.blocks.model.project import Project
from app.core.projects.file_format import (
    SINGLE_PAGE_VERSION,
    VERSION,
    format_version,
    page_fields,
    parse_project,
)
from app.core.storage.atomic_file import make_private, read_regular_file, write_atomically
from app.core.storage.folders import home
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

MAX_JOURNAL_BYTES = 64_000_000
"""Maximum journal size in bytes.

Larger than the limit of behaviour files, so that oversized work can be restored and then reduced.
"""


@dataclass(frozen=True, slots=True)
class UnsavedWork:
    """Unsaved work of a crashed session, with its file and the time of the last edit."""

    journal: Path
    path: Path | None
    edited_s: float
    project: Project

    @property
    def name(self) -> str:
        """Name of the project."""
        return self.project.name


class Journal:
    """Journal of one open behaviour."""

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        self._folder = folder if folder is not None else home() / "journal"
        self._clock = clock
        self._file = self._folder / f"{uuid.uuid4().hex}.json"

    @property
    def name(self) -> str:
        """Name of the journal file."""
        return self._file.name

    def write(self, project: Project, path: Path | None) -> Path:
        """Write the current state to disk, so that it survives a crash of this process.

        Args:
            project: Content, whose workspaces are written unchanged if they come from the editor.
            path: File of the project, or None.

        Returns:
            Path of the journal.

        Raises:
            OSError: The journal can't be written.
            RecursionError: The content is nested too deeply.
        """
        entry = {
            "format": format_version(project),
            "pid": os.getpid(),
            "born_s": _process_start_s(os.getpid()),
            "name": project.name,
            "path": str(path) if path is not None else None,
            "edited_s": self._clock(),
            "robots": project.robots,
            "others": dict(project.unknown_fields),
        }
        texts = {"workspace": project.always.workspace.text}
        if not project.is_single_page:
            pages = [
                _joined(page_fields(page), {"workspace": page.workspace.text}) for page in project.pages[1:]
            ]
            texts["pages"] = f"[{', '.join(pages)}]"
        data = _joined(entry, texts).encode("utf-8", "surrogatepass")
        write_atomically(self._file, data, durable=False, private=True)
        return self._file

    def discard(self) -> None:
        """Delete the journal after the work was saved or discarded.

        Errors are ignored; at worst, the work is offered again at the next start.
        """
        with contextlib.suppress(OSError):
            self._file.unlink(missing_ok=True)


def unsaved_work(folder: Path | None = None) -> list[UnsavedWork]:
    """Return the unsaved work of crashed sessions, newest first. Unreadable journals are left unchanged."""
    folder = folder if folder is not None else home() / "journal"
    make_private(folder, "*.json")
    entries = [_read(file) for file in folder.glob("*.json")] if folder.is_dir() else []
    return sorted((entry for entry in entries if entry is not None), key=lambda entry: -entry.edited_s)


def newer_work_names(folder: Path | None = None) -> list[str]:
    """Return the names of unsaved work in journals of a newer Studio, which are left unchanged."""
    folder = folder if folder is not None else home() / "journal"
    names = []
    for file in folder.glob("*.json") if folder.is_dir() else ():
        entry = _read_entry(file)
        if entry is not None and _version_of(entry) > VERSION:
            names.append(str(entry.get("name") or file.name))
    return sorted(names)


def _joined(fields: Mapping[str, object], texts: Mapping[str, str]) -> str:
    # A JSON object with these fields, and with others whose JSON text exists already.
    members = [json.dumps(fields, ensure_ascii=False)[1:-1]]
    members += [f'"{name}": {text}' for name, text in texts.items()]
    return f"{{{', '.join(members)}}}"


def _read_entry(file: Path) -> dict[str, object] | None:
    # None for a malformed journal, or one that is still in use.
    try:
        entry = deep_json.loads(read_regular_file(file, MAX_JOURNAL_BYTES).decode("utf-8", "surrogatepass"))
        if not isinstance(entry, dict) or _is_running(int(entry["pid"]), float(entry["born_s"])):
            return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return entry


def _version_of(entry: Mapping[str, object]) -> int:
    # 1 for journals from before there were versions.
    version = entry.get("format", 1)
    return version if isinstance(version, int) else 1


def _read(file: Path) -> UnsavedWork | None:
    entry: Any = _read_entry(file)
    if entry is None or _version_of(entry) > VERSION:
        return None
    try:
        path = entry["path"]
        project = parse_project(
            entry,
            str(entry["name"]),
            dict(entry.get("others", {})),
            is_single_page=_version_of(entry) <= SINGLE_PAGE_VERSION,
        )
        return UnsavedWork(file, Path(path) if path is not None else None, float(entry["edited_s"]), project)
    except (ValueError, KeyError, TypeError):
        return None


@lru_cache(maxsize=1)
def _process_start_s(pid: int) -> float:
    # Cached by process id, because a fork has another one.
    return psutil.Process(pid).create_time()


def _is_running(pid: int, process_start_s: float) -> bool:
    # the process id alone may have been reused
    try:
        process = psutil.Process(pid)
        return abs(process.create_time() - process_start_s) < 1.0 and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
