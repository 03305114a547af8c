"""The modules of a frozen program that was replaced or removed while it runs: they still come out of it.

PyInstaller opens the program by its name for each module that is imported. An update puts another file in its
place, in which there is something else at that position (``zlib.error``, or another module); without any file
it raises SystemExit, in the middle of a click or of a message. A file that is open stays what it was.
"""

from __future__ import annotations

import os
import sys
from typing import Protocol

__all__ = ["hold_code"]

LOADER = "pyimod02_importers"
"""PyInstaller's module by which a frozen program imports all others."""


class Archive(Protocol):
    """PyInstaller's reader of the modules in a program."""

    _filename: str


def hold_code() -> bool:
    """Keep the running program's file open and import from it; whether that could be done.

    Linux alone opens an open file once more, with a position of its own. Windows lets nobody replace a
    program that runs. From source there is no such file.
    """
    archive: Archive | None = getattr(sys.modules.get(LOADER), "pyz_archive", None)
    if archive is None or not sys.platform.startswith("linux"):
        return False
    try:
        held = os.open(archive._filename, os.O_RDONLY | os.O_CLOEXEC)  # noqa: SLF001  it has no other place
    except OSError:
        return False
    archive._filename = f"/proc/self/fd/{held}"  # noqa: SLF001
    return True
