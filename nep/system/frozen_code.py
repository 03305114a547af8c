"""Import of modules from a frozen program's file even if the file is replaced or removed meanwhile.

PyInstaller opens the program file by name for each imported module. After an update the file has other
contents at that position (``zlib.error``, or another module); if the file is missing, PyInstaller
raises SystemExit. A file that is already open keeps its contents.
"""

from __future__ import annotations

import os
import sys
from typing import Protocol

LOADER_MODULE = "pyimod02_importers"
"""Name of PyInstaller's import module."""


class Archive(Protocol):
    """PyInstaller's archive of modules."""

    _filename: str


def keep_archive_open() -> bool:
    """Keep the program's file open and import modules from the open file. Return True if this is possible.

    Works on Linux only, where an open file can be reopened with an independent position. Windows locks the
    files of running programs. Returns False if the program is not frozen.
    """
    archive: Archive | None = getattr(sys.modules.get(LOADER_MODULE), "pyz_archive", None)
    if archive is None or not sys.platform.startswith("linux"):
        return False
    try:
        descriptor = os.open(archive._filename, os.O_RDONLY | os.O_CLOEXEC)  # noqa: SLF001 - there is no public API
    except OSError:
        return False
    archive._filename = f"/proc/self/fd/{descriptor}"  # noqa: SLF001
    return True
