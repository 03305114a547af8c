"""Renaming of behaviour files. Names are valid on every operating system, and no file is overwritten."""

from __future__ import annotations

import os
from pathlib import Path

from app.core.projects.file_format import SUFFIX
from app.core.projects.titles import name_of
from app.errors import DocumentError
from nep.i18n import _
from nep.system.replace_file import replace_file

INVALID_CHARACTERS = '/\\:*?"<>|'
MAX_NAME_BYTES = 200
RESERVED_NAMES = frozenset(
    {"con", "prn", "aux", "nul", *(f"{port}{digit}" for port in ("com", "lpt") for digit in range(1, 10))}
)
"""Names reserved by Windows, rejected on every system so that files can be copied there."""


def renamed_path(path: Path, name: str) -> Path:
    """Return ``path`` with another file name.

    Files in Studio's folder of unsaved behaviours have generated names; their path is returned
    unchanged.
    """
    if name_of(path, "") != path.stem:
        return path
    return path.with_name(f"{name}{path.suffix or SUFFIX}")


def name_problem(name: str, path: Path | None) -> str:
    """Return the reason why a behaviour can't have this name, or "".

    Args:
        name: Proposed name.
        path: File of the behaviour, or None.
    """
    new_name = name.strip()
    if not new_name:
        return _("A behaviour needs a name.")
    if path is None:
        return ""
    for letter in new_name:
        if letter in INVALID_CHARACTERS or not letter.isprintable():
            displayed = letter if letter.isprintable() else " "
            return _("A file name can't contain {sign}.").format(sign=f"“{displayed}”")
    if new_name.endswith(".") or new_name.startswith("."):
        return _("A file name can't begin or end with a full stop.")
    if new_name.partition(".")[0].lower() in RESERVED_NAMES:
        return _("Windows reserves the name “{name}”.").format(name=new_name)
    if len(new_name.encode("utf-8", "surrogatepass")) > MAX_NAME_BYTES:
        return _("The name is too long for a file.")
    new = renamed_path(path, new_name)
    if new != path and os.path.lexists(new) and not _is_same_file(new, path):
        return _("A file named “{name}” already exists in {folder}.").format(
            name=new_name, folder=path.parent.name or path.parent
        )
    return ""


def rename_file(old: Path, new: Path) -> None:
    """Rename a file. If DocumentError is raised, the file keeps its old name.

    An existing file is never overwritten: the new name is first reserved by creating an empty file
    exclusively. (Hard links are no alternative, because the file systems of USB drives don't support
    them.)
    """
    try:
        if not old.is_file():
            raise FileNotFoundError(2, _("the file no longer exists"), str(old))
        is_reserved = not _is_same_file(new, old)
        if is_reserved:
            os.close(os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        try:
            replace_file(old, new)
        except OSError:
            if is_reserved:
                new.unlink(missing_ok=True)
            raise
    except OSError as error:
        template = _("can't rename {file} ({reason})")
        reason = error.strerror or str(error)
        raise DocumentError(
            old, template.format(file=old.name, reason=reason), _("save it in another folder")
        ) from error


def _is_same_file(new: Path, old: Path) -> bool:
    # The same file with other capitals, on case-insensitive file systems.
    try:
        return new.name.casefold() == old.name.casefold() and new.samefile(old)
    except OSError:
        return False
