"""Listing of folders, and file names that are valid on every operating system."""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from app.core.documents.file_format import SUFFIX
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
        size: File size in bytes.
    """

    path: Path
    is_folder: bool
    changed_s: float = 0.0
    size: int = 0


def entries_of(folder: Path, endings: tuple[str, ...] = (SUFFIX,)) -> tuple[FolderEntry, ...]:
    """Return the subfolders of a folder and the files with one of the given extensions.

    Hidden entries are omitted. Raises OSError.
    """
    entries = []
    with os.scandir(folder) as found:
        for each in found:
            if each.name.startswith("."):
                continue
            try:
                facts = each.stat()
            except OSError:
                continue  # a broken link, or deleted meanwhile
            is_folder = stat.S_ISDIR(facts.st_mode)
            if is_folder or each.name.lower().endswith(endings):
                entries.append(FolderEntry(Path(each.path), is_folder, facts.st_mtime, facts.st_size))
            if len(entries) == MAX_ENTRIES:
                break
    return tuple(entries)


def name_problem(name: str) -> str:
    """Return the reason why a file or folder can't have this name; "" if the name is valid."""
    bad = INVALID_CHARACTERS.search(name)
    if bad:
        return _("A name can't contain “{sign}”.").format(sign=bad[0])
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
