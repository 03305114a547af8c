"""Keep importing from a frozen program whose file is replaced or removed while it runs.

PyInstaller opens the program file by name for each imported module. After an update the file has other
contents at that position (``zlib.error``, or another module); without the file it raises SystemExit. An open
file stays as it was.
"""

from __future__ import annotations

import os
import sys
from typing import Protocol

__all__ = ["hold_code"]

LOADER = "pyimod02_importers"
"""PyInstaller's import module."""


class Archive(Protocol):
    """PyInstaller's archive of modules."""

    _filename: str


def hold_code() -> bool:
    """Keep the program's file open and import from it; return True if possible.

    Linux only: it can reopen an open file with a position of its own. Windows locks the files of running
    programs. Returns False when run from source.
    """
    archive: Archive | None = getattr(sys.modules.get(LOADER), "pyz_archive", None)
    if archive is None or not sys.platform.startswith("linux"):
        return False
    try:
        held = os.open(archive._filename, os.O_RDONLY | os.O_CLOEXEC)  # noqa: SLF001 - there is no public API
    except OSError:
        return False
    archive._filename = f"/proc/self/fd/{held}"  # noqa: SLF001
    return True
