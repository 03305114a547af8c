"""What a behaviour's file said before Studio wrote over it: kept aside, so that it can be put back."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.core.behaviour_file import SUFFIX
from app.core.files import write_atomically
from app.core.settings import home
from app.errors import DocumentError

COPIES_KEPT = 100

Stamp = tuple[int, int]


@dataclass(frozen=True)
class Earlier:
    """A file as it was; ``copy`` holds those bytes."""

    path: Path
    copy: Path

    def put_back(self) -> None:
        """Write them into the file again. Raises DocumentError; then the file is untouched."""
        try:
            write_atomically(self.path, self.copy.read_bytes())
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DocumentError(self.path, f"can't be put back ({reason}); open {self.copy}") from error


def keep_earlier(
    path: Path, folder: Path | None = None, clock: Callable[[], float] = time.time
) -> Earlier | None:
    """Keep what the file says now; None when there is no file, or nothing in it.

    The copies are in ``folder`` (default: ``earlier`` in Studio's folder), the newest hundred of them. Raises
    DocumentError when it can't be kept.
    """
    where = folder if folder is not None else home() / "earlier"
    if not path.is_file() or not path.stat().st_size:
        return None
    try:
        copy = free_path(where, f"{path.stem}, before", clock())
        write_atomically(copy, path.read_bytes())
    except OSError as error:
        reason = error.strerror or error
        raise DocumentError(path, f"was not saved: what it said before can't be kept ({reason})") from error
    _drop_oldest(where)
    return Earlier(path, copy)


def free_path(folder: Path, name: str, now_s: float) -> Path:
    """A behaviour's file in ``folder`` that is not there yet: its name and when."""
    plain = "".join(c if c.isalnum() or c in " -_," else "_" for c in name).strip() or "behaviour"
    stamp = time.strftime("%Y-%m-%d %H.%M.%S", time.localtime(now_s))
    path = folder / f"{plain} {stamp}{SUFFIX}"
    number = 2
    while path.exists():
        path = folder / f"{plain} {stamp} {number}{SUFFIX}"
        number += 1
    return path


def stamp_of(path: Path) -> Stamp | None:
    """What changes when somebody writes the file; None when there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def _drop_oldest(folder: Path) -> None:
    with contextlib.suppress(OSError):  # another Studio was quicker
        copies = sorted(folder.glob(f"*{SUFFIX}"), key=lambda copy: copy.stat().st_mtime_ns)
        for copy in copies[:-COPIES_KEPT]:
            copy.unlink(missing_ok=True)
