"""Folders and pages that other programs of the computer open: its file manager, its browser."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices

_LIBRARIES = "LD_LIBRARY_PATH"
_ORIGINAL = f"{_LIBRARIES}_ORIG"
_FREEZERS = "_PYI_"


@contextmanager
def outside(environ: MutableMapping[str, str], *, is_frozen: bool) -> Iterator[None]:
    """As long as it lasts ``environ`` is what it was before a frozen Studio began.

    The freezer's loader names Studio's own libraries there, for Studio and its processes. Another program
    that inherits this would load ours in the place of its own, and may not start.
    """
    kept = {
        name: value
        for name, value in environ.items()
        if is_frozen and (name in {_LIBRARIES, _ORIGINAL} or name.startswith(_FREEZERS))
    }
    for name in kept:
        del environ[name]
    if _ORIGINAL in kept:
        environ[_LIBRARIES] = kept[_ORIGINAL]
    try:
        yield
    finally:
        if kept:
            environ.pop(_LIBRARIES, None)
            environ.update(kept)


def open_outside(url: QUrl) -> bool:
    """Open a folder or a page in the program that the computer has for it; whether there was one."""
    with outside(os.environ, is_frozen=bool(getattr(sys, "frozen", False))):
        return QDesktopServices.openUrl(url)
