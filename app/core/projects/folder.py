"""Listing of folders, and file names that are valid on every operating system."""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from app.core.projects.file_format import SUFFIX
from nep.i18n import _

MAX_ENTRIES = 5000
INVALID_CHARACTERS = re.compile(r'[/\\:*?"<>|\x00-\x1f]')
RESERVED_NAMES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
"""File names reserved by Windows, rejected on every system so that files can be copied there."""
MAX_NAME_LENGTH = 120


@dataclass(frozen=True)
class FolderEntry:
    """File or subfolder of a folder.

    Attributes:
        path: Path of the entry.
        is_folder: True for a folder.
        changed_s: Time of the last change in seconds since 1970.
        size_bytes: File size in bytes.
    """

    path: Path
    is_folder: bool
    changed_s: float = 0.0
    size_bytes: int = 0


def entries_of(folder: Path, endings: tuple[str, ...] = (SUFFIX,)) -> tuple[FolderEntry, ...]:
    """Return the subfolders of a folder and the files with one of the given extensions.

    Hidden entries and broken links are omitted. At most `MAX_ENTRIES` are returned. Raises OSError if
    the folder can't be read.
    """
    entries = []
    with os.scandir(folder) as dir_entries:
        for dir_entry in dir_entries:
            if dir_entry.name.startswith("."):
                continue
            try:
                file_stat = dir_entry.stat()
            except OSError:
                continue  # a broken link, or deleted meanwhile
            is_folder = stat.S_ISDIR(file_stat.st_mode)
            if is_folder or dir_entry.name.lower().endswith(endings):
                entries.append(
                    FolderEntry(Path(dir_entry.path), is_folder, file_stat.st_mtime, file_stat.st_size)
                )
            if len(entries) == MAX_ENTRIES:
                break
    return tuple(entries)


def name_problem(name: str) -> str:
    """Return the reason why a file or folder can't have this name; "" if it is valid or empty."""
    invalid = INVALID_CHARACTERS.search(name)
    if invalid:
        return _("A name can't contain “{sign}”.").format(sign=invalid[0])
    if name.startswith("."):
        return _("A name that begins with a full stop hides the file.")
    if RESERVED_NAMES.fullmatch(name) or name.endswith((".", " ")):
        return _("Some computers don't support this file name. Choose another one.")
    if len(name) > MAX_NAME_LENGTH:
        return _("This name is too long.")
    return ""


def parse_absolute_path(typed: str) -> Path | None:
    """Return the typed text as a path if it is absolute; None if it is only a name."""
    path = Path(typed).expanduser() if typed.startswith("~") else Path(typed)
    return path if path.is_absolute() and path.name else None


def free_name(folder: Path, name: str, ending: str = SUFFIX) -> str:
    """Return an unused file name without extension: ``name``, or a numbered name such as "Greeting 2"."""
    number, candidate = 2, name
    while (folder / f"{candidate}{ending}").exists():
        candidate, number = f"{name} {number}", number + 1
    return candidate
