"""Functions that open folders and web pages in the system's file manager and browser."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices

_LIBRARY_PATH = "LD_LIBRARY_PATH"
_ORIGINAL_LIBRARY_PATH = f"{_LIBRARY_PATH}_ORIG"
_FREEZER_PREFIX = "_PYI_"


@contextmanager
def original_environment(environ: MutableMapping[str, str], *, is_frozen: bool) -> Iterator[None]:
    """Temporarily restore the environment variables that the loader of a frozen Studio has changed.

    The loader sets the library path to the bundled libraries. Another program that inherits this path
    would load those libraries instead of its own and may fail to start.

    Args:
        environ: Environment variables, modified in place.
        is_frozen: True if Studio runs from a frozen bundle; otherwise nothing is changed.
    """
    saved = {
        name: value
        for name, value in environ.items()
        if is_frozen and (name in {_LIBRARY_PATH, _ORIGINAL_LIBRARY_PATH} or name.startswith(_FREEZER_PREFIX))
    }
    for name in saved:
        del environ[name]
    if _ORIGINAL_LIBRARY_PATH in saved:
        environ[_LIBRARY_PATH] = saved[_ORIGINAL_LIBRARY_PATH]
    try:
        yield
    finally:
        if saved:
            environ.pop(_LIBRARY_PATH, None)
            environ.update(saved)


def open_externally(url: QUrl) -> bool:
    """Open a folder or web page in the system's default program; return False on failure."""
    with original_environment(os.environ, is_frozen=bool(getattr(sys, "frozen", False))):
        return QDesktopServices.openUrl(url)
