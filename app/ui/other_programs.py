"""Opens folders and web pages in the system's file manager and browser."""

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
    """Temporarily restore the environment that was in place before the frozen Studio changed it.

    The loader of a frozen Studio sets the library path to its bundled libraries. Another program that
    inherits this path would load those instead of its own and may fail to start.
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
    """Open a folder or web page in the system's default program; return False on failure."""
    with outside(os.environ, is_frozen=bool(getattr(sys, "frozen", False))):
        return QDesktopServices.openUrl(url)
