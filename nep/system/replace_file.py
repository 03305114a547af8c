"""Putting a new file in the place of an old one, also while another program has the old one open."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

from nep.i18n import _

__all__ = ["replace_file"]

_TRIES = 20
_PAUSE_S = 0.05
_SHARING = frozenset({5, 32, 33})
"""Windows' words for "somebody has it open": access denied, sharing violation, lock violation."""


def replace_file(
    new: Path,
    old: Path,
    *,
    replace: Callable[[Path, Path], object] = os.replace,
    pause: Callable[[float], object] | None = None,
) -> None:
    """Let `new` be `old` from now on, at once and whole. Raises `OSError`; then `old` is untouched.

    Windows refuses while another program (a virus scanner, a synchronised folder, an editor) has the old file
    open: it is tried again for a second. `replace` and `pause` are for tests.
    """
    wait = pause or threading.Event().wait
    for tried in range(1, _TRIES + 1):
        try:
            replace(new, old)
        except PermissionError as error:
            if getattr(error, "winerror", None) not in _SHARING:
                raise
            if tried == _TRIES:
                said = _("another program has the file open; close it there")
                raise PermissionError(error.errno, said, str(old)) from error
            wait(_PAUSE_S)
        else:
            return
