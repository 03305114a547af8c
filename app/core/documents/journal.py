"""Unsaved work survives a crash: every edit is written to a journal at once, beside the window.

One journal per open behaviour, in ``journal/`` of Studio's folder. It names the process that writes it, so
that a second Studio does not offer what the first one still holds.
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
from app.core.storage.atomic_file import make_private, read_whole, write_atomically
from app.core.storage.settings import home
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

FORMAT = 1
"""Goes up when this version can't understand the journals of the next one."""
LARGEST_JOURNAL_BYTES = 64_000_000
"""Unsaved work comes back also when it is larger than a file may be: it can be made smaller then."""


@dataclass(frozen=True, slots=True)
class Unsaved:
    """Work that a Studio left behind: what it was, which file it belongs to, and when it was last edited."""

    journal: Path
    name: str
    path: Path | None
    edited_s: float
    workspace: Mapping[str, object]
    robots: Mapping[str, Mapping[str, object]]
    others: Mapping[str, object] = field(default_factory=dict)


class Journal:
    """The journal of one open behaviour."""

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        """Journals live in ``folder`` (default: ``journal`` in Studio's folder)."""
        self._folder = folder if folder is not None else home() / "journal"
        self._clock = clock
        self._file = self._folder / f"{uuid.uuid4().hex}.json"

    @property
    def name(self) -> str:
        """The name of its file."""
        return self._file.name

    def write(
        self,
        name: str,
        path: Path | None,
        text: str,
        robots: Mapping[str, Mapping[str, object]],
        others: Mapping[str, object] | None = None,
    ) -> None:
        """Keep the newest state; ``text`` is the JSON of the workspace, taken as it is.

        ``others`` is what else its file says. It survives the death of this process. Raises OSError.
        """
        entry = {
            "format": FORMAT,
            "pid": os.getpid(),
            "born_s": _own_birth(os.getpid()),
            "name": name,
            "path": str(path) if path is not None else None,
            "edited_s": self._clock(),
            "robots": robots,
            "others": dict(others or {}),
        }
        whole = f'{json.dumps(entry, ensure_ascii=False)[:-1]}, "workspace": {text}}}'
        data = whole.encode("utf-8", "surrogatepass")
        write_atomically(self._file, data, durable=False, private=True)

    def discard(self) -> None:
        """The work is saved or given up: nothing is offered at the next start.

        A folder that takes no files has kept none, or keeps one that the next start offers once more.
        """
        with contextlib.suppress(OSError):
            self._file.unlink(missing_ok=True)


def left_behind(folder: Path | None = None) -> list[Unsaved]:
    """Work whose Studio is gone, the newest first. Journals that can't be read are left where they are."""
    folder = folder if folder is not None else home() / "journal"
    make_private(folder, "*.json")
    found = [_read(file) for file in folder.glob("*.json")] if folder.is_dir() else []
    return sorted((entry for entry in found if entry is not None), key=lambda entry: -entry.edited_s)


def of_newer(folder: Path | None = None) -> list[str]:
    """The names of the unsaved work that a newer Studio left behind: it is not touched."""
    folder = folder if folder is not None else home() / "journal"
    found = []
    for file in folder.glob("*.json") if folder.is_dir() else ():
        entry = _entry(file)
        if entry is not None and _format_of(entry) > FORMAT:
            found.append(str(entry.get("name") or file.name))
    return sorted(found)


def _entry(file: Path) -> dict[str, object] | None:
    """What a journal says whose Studio is gone; None for what is none, or still written."""
    try:
        entry = deep_json.loads(read_whole(file, LARGEST_JOURNAL_BYTES).decode("utf-8", "surrogatepass"))
        if not isinstance(entry, dict) or _alive(int(entry["pid"]), float(entry["born_s"])):
            return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return entry


def _format_of(entry: Mapping[str, object]) -> int:
    """The number of its format; 1 for journals from before there were numbers."""
    found = entry.get("format", 1)
    return found if isinstance(found, int) else 1


def _read(file: Path) -> Unsaved | None:
    entry: Any = _entry(file)
    if entry is None or _format_of(entry) > FORMAT:
        return None
    try:
        path = entry["path"]
        return Unsaved(
            journal=file,
            name=str(entry["name"]),
            path=Path(path) if path is not None else None,
            edited_s=float(entry["edited_s"]),
            workspace=dict(entry["workspace"]),
            robots={str(name): dict(td) for name, td in dict(entry["robots"]).items()},
            others=dict(entry.get("others", {})),
        )
    except (ValueError, KeyError, TypeError):
        return None


@lru_cache(maxsize=1)
def _own_birth(pid: int) -> float:
    """When this process began; the id is given because a fork is another one."""
    return psutil.Process(pid).create_time()


def _alive(pid: int, born_s: float) -> bool:
    # a pid alone may belong to another program by now
    try:
        process = psutil.Process(pid)
        return abs(process.create_time() - born_s) < 1.0 and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
