"""Earlier versions of behaviour files, copied before Studio overwrites a file.

The file name of a copy consists of the original file name, the time of overwriting, and a hash of the
original path. The modification time of the copy is that of the original.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.core.documents.file_format import SUFFIX
from app.core.storage.atomic_file import (
    create_private_folder,
    make_private,
    read_regular_file,
    write_atomically,
)
from app.core.storage.settings import data_home, home
from app.errors import DocumentError
from nep.i18n import _
from nep.system.replace_file import replace_file

FOLDER_NAME = "earlier"
MAX_COPIES = 300
MAX_BYTES = 500_000_000
MAX_COPIES_PER_FILE = 30
PROTECTED_COPIES = 10
"""Number of newest versions of a file that are never removed.

Of older versions, the one that leaves the smallest gap in time is removed first.
"""

_STAMP = "%Y-%m-%d %H.%M.%S"
_NAME = re.compile(
    r"(?P<stem>.*), before (?P<stamp>\d{4}-\d\d-\d\d \d\d\.\d\d\.\d\d)(?: (?P<mark>[0-9a-f]{8}))?(?: \d+)?"
    + re.escape(SUFFIX)
)

Stamp = tuple[int, int]


@dataclass(frozen=True)
class SavedVersion:
    """File together with a copy of its earlier content."""

    path: Path
    copy: Path

    def restore(self) -> None:
        """Restore the earlier content. If DocumentError is raised, the file is unchanged."""
        try:
            write_atomically(self.path, read_regular_file(self.copy))
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DocumentError(
                self.path,
                _("can't restore {file} ({reason})").format(file=self.path.name, reason=reason),
                _("open {copy}").format(copy=self.copy),
            ) from error


def save_version(
    path: Path, folder: Path | None = None, clock: Callable[[], float] = time.time
) -> SavedVersion | None:
    """Copy the current content of a file; None if the file is missing or empty.

    The copies are in ``folder`` (default: ``earlier`` in Studio's data folder), at most 300 in total and 30
    for each file. Content that was already copied isn't copied again. Raises DocumentError if the file can't
    be copied.
    """
    where = _versions_folder(folder)
    if not path.is_file() or not path.stat().st_size:
        return None
    try:
        data, written = read_regular_file(path), path.stat()
        newest = next(iter(versions_of(path, where)), None)
        if (
            newest is not None
            and newest.copy.stat().st_size == len(data)
            and read_regular_file(newest.copy) == data
        ):
            return SavedVersion(path, newest.copy)
        copy = free_path(where, f"{path.stem}, before", clock(), f" {_path_hash(path)}")
        write_atomically(copy, data, private=True)
        os.utime(copy, ns=(written.st_mtime_ns, written.st_mtime_ns))
    except OSError as error:
        reason = error.strerror or error
        words = _("{file} was not saved: its previous version can't be kept ({reason})")
        raise DocumentError(path, words.format(file=path.name, reason=reason)) from error
    with contextlib.suppress(OSError):  # another instance has done this already
        _thin_out(where, _path_hash(path))
        _drop_oldest(where)
    return SavedVersion(path, copy)


@dataclass(frozen=True)
class Version:
    """Earlier version of a file: its name, and the times when it was written and overwritten."""

    copy: Path
    name: str
    written_s: float
    replaced_s: float
    path_hash: str


def versions_of(path: Path, folder: Path | None = None) -> list[Version]:
    """Return the versions of a file, newest first."""
    mark = _path_hash(path)
    return [each for each in _newest_first(_versions_folder(folder)) if each.path_hash == mark]


def namesakes_of(path: Path, folder: Path | None = None) -> list[Version]:
    """Return versions of other files with the same name, such as of a moved file, newest first."""
    mark, stem = _path_hash(path), _safe_stem(path.stem)
    return [
        each
        for each in _newest_first(_versions_folder(folder))
        if each.path_hash != mark and each.name == stem
    ]


def rename_versions(old: Path, new: Path, folder: Path | None = None) -> None:
    """Assign the versions of a renamed file to its new name. Versions that can't be renamed are skipped."""
    for each in reversed(versions_of(old, folder)):
        copy = free_path(
            _versions_folder(folder), f"{new.stem}, before", each.replaced_s, f" {_path_hash(new)}"
        )
        with contextlib.suppress(OSError):
            replace_file(each.copy, copy)


def free_path(folder: Path, name: str, now_s: float, mark: str = "") -> Path:
    """Return an unused path in ``folder`` from a name, a time and a mark."""
    stamp = time.strftime(_STAMP, time.localtime(now_s))
    stem = f"{_safe_stem(name)} {stamp}{mark}"
    path = folder / f"{stem}{SUFFIX}"
    number = 2
    while path.exists():
        path = folder / f"{stem} {number}{SUFFIX}"
        number += 1
    return path


def stamp_of(path: Path) -> Stamp | None:
    """Return a value that changes when the file is written; None when it is missing."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def _versions_folder(chosen: Path | None) -> Path:
    return chosen if chosen is not None else data_home() / FOLDER_NAME


def move_old_versions(old: Path | None = None, new: Path | None = None) -> None:
    """Move the versions that an earlier Studio stored in the configuration folder to the data folder.

    Versions that can't be moved are retried at the next start. Only their owner can read them.
    """
    old = old if old is not None else home() / FOLDER_NAME
    new = new if new is not None else data_home() / FOLDER_NAME
    if old != new and old.is_dir():
        with contextlib.suppress(OSError):
            create_private_folder(new)
            for copy in old.glob(f"*{SUFFIX}"):
                if not (new / copy.name).exists():
                    shutil.move(copy, new / copy.name)
            old.rmdir()
    make_private(new, f"*{SUFFIX}")


def _safe_stem(name: str) -> str:
    return "".join(c if c.isalnum() or c in " -_," else "_" for c in name).strip() or "behaviour"


def _path_hash(path: Path) -> str:
    # Differs between files in different folders.
    where = os.path.normcase(path.resolve())
    return hashlib.sha256(where.encode("utf-8", "surrogateescape")).hexdigest()[:8]


def _newest_first(folder: Path) -> list[Version]:
    found = [_parse_version(copy) for copy in folder.glob(f"*{SUFFIX}")] if folder.is_dir() else []
    known = [each for each in found if each is not None]
    return sorted(known, key=lambda each: (each.replaced_s, each.written_s), reverse=True)


def _parse_version(copy: Path) -> Version | None:
    match = _NAME.fullmatch(copy.name)
    if match is None:
        return None
    try:
        written = copy.stat().st_mtime
        replaced = time.mktime(time.strptime(match["stamp"], _STAMP))
    except (OSError, ValueError, OverflowError):
        return None
    return Version(copy, match["stem"], written, replaced, match["mark"] or "")


def _thin_out(folder: Path, mark: str) -> None:
    # Removes the version that leaves the smallest gap.
    found = [each for each in _newest_first(folder) if each.path_hash == mark]
    while len(found) > MAX_COPIES_PER_FILE:
        gaps = {
            place: found[place - 1].replaced_s - found[place + 1].replaced_s
            for place in range(PROTECTED_COPIES, len(found) - 1)
        }
        found.pop(min(gaps, key=lambda place: gaps[place])).copy.unlink(missing_ok=True)


def _drop_oldest(folder: Path) -> None:
    left = MAX_BYTES
    for number, each in enumerate(_newest_first(folder)):
        left -= each.copy.stat().st_size
        if number and (number >= MAX_COPIES or left < 0):
            each.copy.unlink(missing_ok=True)
