"""A file in which a part of Studio keeps what a person made: what is damaged is put aside, never lost."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from app.core.storage.atomic_file import read_whole, write_atomically
from nep.errors import NepError
from nep.i18n import _
from nep.system.replace_file import replace_file

T = TypeVar("T")


@dataclass(frozen=True)
class KeptFile(Generic[T]):
    """What was read of such a file.

    ``value`` is None when there was nothing, or nothing of it could be read. ``problem`` is a sentence that
    says what became of a file that could not be read, or only in part; "" when all is well. A file that
    ``is_newer`` than this Studio is left as it is, so nothing may be written there.
    """

    value: T | None = None
    problem: str = ""
    is_newer: bool = False


def read_kept(
    path: Path, parse: Callable[[bytes], tuple[T, str]], newer: type[NepError], most_bytes: int
) -> KeptFile[T]:
    """Read a file of at most so many bytes; of one that is damaged what can be read is used.

    ``parse`` gives what is in it, and why that is not all ("" when it is). It raises `NepError` for what
    can't be read at all, and ``newer`` for what a newer Studio wrote. The damaged file is kept beside:
    "alarms.json" as "alarms.damaged.json".
    """
    try:
        data = read_whole(path, most_bytes)
    except (FileNotFoundError, NotADirectoryError):
        return KeptFile()
    except OSError as error:
        return KeptFile(None, _put_aside(path, error.strerror or str(error)))
    try:
        value, problem = parse(data)
    except newer as error:
        said = _("Your changes are not being saved: {reason}. The file is unchanged.")
        return KeptFile(None, said.format(reason=error), is_newer=True)
    except NepError as error:
        return KeptFile(None, _put_aside(path, str(error)))
    return KeptFile(value, _put_aside(path, problem, data) if problem else "")


def _put_aside(path: Path, reason: str, data: bytes | None = None) -> str:
    """Keep the file beside, and say so; with its ``data`` the file itself stays, whose rest is used."""
    beside = path.with_name(f"{path.stem}.damaged{path.suffix}")
    with suppress(OSError):
        if data is None:
            replace_file(path, beside)
        else:
            write_atomically(beside, data, durable=False, private=True)
    return _("The file was saved as “{file}”: {reason}.").format(file=beside.name, reason=reason)
