"""Files with data of the user. A damaged file is renamed, so that its content isn't overwritten."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from app.core.storage.atomic_file import read_regular_file, write_atomically
from nep.errors import NepError
from nep.i18n import _
from nep.system.replace_file import replace_file

T = TypeVar("T")


@dataclass(frozen=True)
class StoredFile(Generic[T]):
    """Result of reading a file with data of the user.

    Attributes:
        value: Parsed content; None if the file is missing or can't be read.
        problem: Message about a file that could not be read, or only partly; otherwise "".
        is_newer: True if a newer Studio wrote the file, which must then not be overwritten.
    """

    value: T | None = None
    problem: str = ""
    is_newer: bool = False


def read_stored(
    path: Path, parse: Callable[[bytes], tuple[T, str]], newer_error: type[NepError], max_bytes: int
) -> StoredFile[T]:
    """Read a file with data of the user; a missing or unreadable file has the value None.

    If the file is damaged, its readable part is used, and it is renamed or copied, for example from
    "alarms.json" to "alarms.damaged.json". A file of a newer Studio isn't changed or used.

    Args:
        path: Path of the file.
        parse: Parses the content; returns the value, and a message about a problem or "". Raises
            `NepError` for an unreadable file.
        newer_error: Exception that ``parse`` raises for a file of a newer Studio.
        max_bytes: Maximum size of the file.
    """
    try:
        data = read_regular_file(path, max_bytes)
    except (FileNotFoundError, NotADirectoryError):
        return StoredFile()
    except OSError as error:
        return StoredFile(None, _save_damaged(path, error.strerror or str(error)))
    try:
        value, problem = parse(data)
    except newer_error as error:
        template = _("Your changes aren't being saved: {reason}. The file is unchanged.")
        return StoredFile(None, template.format(reason=error), is_newer=True)
    except NepError as error:
        return StoredFile(None, _save_damaged(path, str(error)))
    return StoredFile(value, _save_damaged(path, problem, data) if problem else "")


def _save_damaged(path: Path, reason: str, data: bytes | None = None) -> str:
    # With `data`, a copy is stored next to the file, whose readable part is used.
    backup = path.with_name(f"{path.stem}.damaged{path.suffix}")
    with suppress(OSError):
        if data is None:
            replace_file(path, backup)
        else:
            write_atomically(backup, data, durable=False, private=True)
    return _("Reason: {reason}. The file was saved as “{file}”.").format(file=backup.name, reason=reason)
