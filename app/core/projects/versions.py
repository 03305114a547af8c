"""Earlier versions of behaviour files, copied before Studio overwrites a file.

The file name of a version consists of the original file name, the time of overwriting, and a hash of
the original path. Its modification time is that of the original file.
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

from app.core.projects.file_format import SUFFIX
from app.core.storage.atomic_file import (
    create_private_folder,
    make_private,
    read_regular_file,
    write_atomically,
)
from app.core.storage.folders import data_home, home
from app.errors import DocumentError
from nep.i18n import _
from nep.system.replace_file import replace_file

FOLDER_NAME = "earlier"
MAX_COPIES = 300
MAX_BYTES = 500_000_000
MAX_COPIES_PER_FILE = 30
MIN_COPIES_PER_FILE = 10
"""Number of newest versions of a file that are never deleted.

Among older versions, the version whose removal leaves the smallest gap in time is deleted first.
"""

_STAMP_FORMAT = "%Y-%m-%d %H.%M.%S"
_NAME_PATTERN = re.compile(
    r"(?P<stem>.*), before (?P<stamp>\d{4}-\d\d-\d\d \d\d\.\d\d\.\d\d)(?: (?P<mark>[0-9a-f]{8}))?(?: \d+)?"
    + re.escape(SUFFIX)
)

Stamp = tuple[int, int]


@dataclass(frozen=True)
class SavedVersion:
    """File and a copy of its previous content, which `restore` restores."""

    path: Path
    copy: Path

    def restore(self) -> None:
        """Restore the previous content. If DocumentError is raised, the file is unchanged."""
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
    """Copy the current content of a file as a version; return None if the file is missing or empty.

    At most 300 versions (500 MB) are stored in total, and 30 of each file. If the newest version has
    the same content, it is returned and nothing is copied. Raises DocumentError if the file can't be
    copied.

    Args:
        path: File that will be overwritten.
        folder: Folder of the versions; default: ``earlier`` in Studio's data folder.
        clock: Returns the time in seconds since 1970.
    """
    versions_folder = _versions_folder(folder)
    if not path.is_file() or not path.stat().st_size:
        return None
    try:
        data, file_stat = read_regular_file(path), path.stat()
        newest = next(iter(versions_of(path, versions_folder)), None)
        if (
            newest is not None
            and newest.copy.stat().st_size == len(data)
            and read_regular_file(newest.copy) == data
        ):
            return SavedVersion(path, newest.copy)
        copy = free_path(versions_folder, f"{path.stem}, before", clock(), f" {_path_hash(path)}")
        write_atomically(copy, data, private=True)
        os.utime(copy, ns=(file_stat.st_mtime_ns, file_stat.st_mtime_ns))
    except OSError as error:
        reason = error.strerror or error
        template = _("{file} wasn't saved: its previous version can't be kept ({reason})")
        raise DocumentError(path, template.format(file=path.name, reason=reason)) from error
    with contextlib.suppress(OSError):  # another instance has done this already
        _prune_versions(versions_folder, _path_hash(path))
        _evict_oldest(versions_folder)
    return SavedVersion(path, copy)


@dataclass(frozen=True)
class Version:
    """Earlier version of a file.

    Attributes:
        copy: Path of the version.
        name: Name of the original file, without extension.
        written_s: Time when the content was written, in seconds since 1970.
        replaced_s: Time when the content was overwritten, in seconds since 1970.
        path_hash: Hash of the original path.
    """

    copy: Path
    name: str
    written_s: float
    replaced_s: float
    path_hash: str


def versions_of(path: Path, folder: Path | None = None) -> list[Version]:
    """Return the versions of a file, newest first."""
    path_hash = _path_hash(path)
    return [each for each in _list_versions(_versions_folder(folder)) if each.path_hash == path_hash]


def namesakes_of(path: Path, folder: Path | None = None) -> list[Version]:
    """Return versions of other files with the same name, such as those of a moved file, newest first."""
    path_hash, stem = _path_hash(path), _safe_stem(path.stem)
    return [
        each
        for each in _list_versions(_versions_folder(folder))
        if each.path_hash != path_hash and each.name == stem
    ]


def rename_versions(old: Path, new: Path, folder: Path | None = None) -> None:
    """Assign the versions of a renamed file to its new path. Versions that can't be renamed are skipped."""
    for version in reversed(versions_of(old, folder)):
        copy = free_path(
            _versions_folder(folder), f"{new.stem}, before", version.replaced_s, f" {_path_hash(new)}"
        )
        with contextlib.suppress(OSError):
            replace_file(version.copy, copy)


def free_path(folder: Path, name: str, now_s: float, mark: str = "") -> Path:
    """Return an unused path for a copy.

    Args:
        folder: Folder of the copy.
        name: Name of the original file, without extension.
        now_s: Current time in seconds since 1970.
        mark: Text appended to the file name, such as a hash of the original path.
    """
    stamp = time.strftime(_STAMP_FORMAT, time.localtime(now_s))
    stem = f"{_safe_stem(name)} {stamp}{mark}"
    path = folder / f"{stem}{SUFFIX}"
    number = 2
    while path.exists():
        path = folder / f"{stem} {number}{SUFFIX}"
        number += 1
    return path


def stamp_of(path: Path) -> Stamp | None:
    """Return a value that changes when the file is written; None if the file is missing."""
    try:
        file_stat = path.stat()
    except OSError:
        return None
    return file_stat.st_mtime_ns, file_stat.st_size


def _versions_folder(folder: Path | None) -> Path:
    return folder if folder is not None else data_home() / FOLDER_NAME


def move_old_versions(old: Path | None = None, new: Path | None = None) -> None:
    """Move versions from the configuration folder, which earlier Studios used, to the data folder.

    The moved files are made private to their owner. Files that can't be moved are tried again at the
    next start.
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
    resolved = os.path.normcase(path.resolve())
    return hashlib.sha256(resolved.encode("utf-8", "surrogateescape")).hexdigest()[:8]


def _list_versions(folder: Path) -> list[Version]:
    parsed = [_parse_version(copy) for copy in folder.glob(f"*{SUFFIX}")] if folder.is_dir() else []
    versions = [each for each in parsed if each is not None]
    return sorted(versions, key=lambda each: (each.replaced_s, each.written_s), reverse=True)


def _parse_version(copy: Path) -> Version | None:
    match = _NAME_PATTERN.fullmatch(copy.name)
    if match is None:
        return None
    try:
        written_s = copy.stat().st_mtime
        replaced_s = time.mktime(time.strptime(match["stamp"], _STAMP_FORMAT))
    except (OSError, ValueError, OverflowError):
        return None
    return Version(copy, match["stem"], written_s, replaced_s, match["mark"] or "")


def _prune_versions(folder: Path, path_hash: str) -> None:
    # Removes the version that leaves the smallest gap.
    versions = [each for each in _list_versions(folder) if each.path_hash == path_hash]
    while len(versions) > MAX_COPIES_PER_FILE:
        gaps = {
            index: versions[index - 1].replaced_s - versions[index + 1].replaced_s
            for index in range(MIN_COPIES_PER_FILE, len(versions) - 1)
        }
        versions.pop(min(gaps, key=lambda index: gaps[index])).copy.unlink(missing_ok=True)


def _evict_oldest(folder: Path) -> None:
    remaining_bytes = MAX_BYTES
    for number, version in enumerate(_list_versions(folder)):
        remaining_bytes -= version.copy.stat().st_size
        if number and (number >= MAX_COPIES or remaining_bytes < 0):
            version.copy.unlink(missing_ok=True)
