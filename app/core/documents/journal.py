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
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.core.storage import deep_json
from app.core.storage.atomic_file import make_private, read_regular_file, write_atomically
from app.core.storage.settings import home
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

FORMAT_VERSION = 1
"""Format version; increased when older versions of Studio can't read the new format."""
MAX_JOURNAL_BYTES = 64_000_000
"""Maximum journal size in bytes.

Larger than the limit of behaviour files, so that oversized work can be restored and then reduced.
"""


@dataclass(frozen=True, slots=True)
class UnsavedWork:
    """Unsaved work of a crashed session, with its name, its file and the time of the last edit."""

    journal: Path
    name: str
    path: Path | None
    edited_s: float
    workspace: Mapping[str, object]
    robots: Mapping[str, Mapping[str, object]]
    unknown_fields: Mapping[str, object] = field(default_factory=dict)


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

    def write(
        self,
        name: str,
        path: Path | None,
        text: str,
        robots: Mapping[str, Mapping[str, object]],
        unknown_fields: Mapping[str, object] | None = None,
    ) -> None:
        """Write the current state to disk, so that it survives a crash of this process. Raises OSError.

        Args:
            name: Name of the behaviour.
            path: File of the behaviour, or None.
            text: JSON of the workspace, written unchanged.
            robots: Descriptions of the robots in use, by name.
            unknown_fields: Unknown fields of the behaviour file, to be preserved.
        """
        entry = {
            "format": FORMAT_VERSION,
            "pid": os.getpid(),
            "born_s": _process_start_s(os.getpid()),
            "name": name,
            "path": str(path) if path is not None else None,
            "edited_s": self._clock(),
            "robots": robots,
            "others": dict(unknown_fields or {}),
        }
        document = f'{json.dumps(entry, ensure_ascii=False)[:-1]}, "workspace": {text}}}'
        data = document.encode("utf-8", "surrogatepass")
        write_atomically(self._file, data, durable=False, private=True)

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
        if entry is not None and _format_version(entry) > FORMAT_VERSION:
            names.append(str(entry.get("name") or file.name))
    return sorted(names)


def _read_entry(file: Path) -> dict[str, object] | None:
    # None for a malformed journal, or one that is still in use.
    try:
        entry = deep_json.loads(read_regular_file(file, MAX_JOURNAL_BYTES).decode("utf-8", "surrogatepass"))
        if not isinstance(entry, dict) or _is_running(int(entry["pid"]), float(entry["born_s"])):
            return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return entry


def _format_version(entry: Mapping[str, object]) -> int:
    # 1 for journals from before there were versions.
    version = entry.get("format", 1)
    return version if isinstance(version, int) else 1


def _read(file: Path) -> UnsavedWork | None:
    entry: Any = _read_entry(file)
    if entry is None or _format_version(entry) > FORMAT_VERSION:
        return None
    try:
        path = entry["path"]
        return UnsavedWork(
            journal=file,
            name=str(entry["name"]),
            path=Path(path) if path is not None else None,
            edited_s=float(entry["edited_s"]),
            workspace=dict(entry["workspace"]),
            robots={str(name): dict(description) for name, description in dict(entry["robots"]).items()},
            unknown_fields=dict(entry.get("others", {})),
        )
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
