"""Atomic replacement of a file, even while another program has it open."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

from nep.i18n import _

_MAX_ATTEMPTS = 20
_RETRY_DELAY_S = 0.05
_OPEN_FILE_ERRORS = frozenset({5, 32, 33})
"""Windows error codes for a file in use: access denied, sharing violation, lock violation."""


def replace_file(
    new: Path,
    old: Path,
    *,
    replace: Callable[[Path, Path], object] = os.replace,
    pause: Callable[[float], object] | None = None,
) -> None:
    """Rename `new` to `old` atomically.

    Windows rejects this while another program (virus scanner, cloud sync, editor) has `old` open, so
    the rename is retried for a second.

    Args:
        new: Path of the new file.
        old: Path of the file to replace.
        replace: Renames a file; replaced in tests.
        pause: Waits for a number of seconds; replaced in tests.

    Raises:
        OSError: The file can't be replaced; `old` is unchanged.
    """
    wait = pause or threading.Event().wait
    for attempt in range(1, _MAX_ATTEMPTS + 1):
        try:
            replace(new, old)
        except PermissionError as error:
            if getattr(error, "winerror", None) not in _OPEN_FILE_ERRORS:
                raise
            if attempt == _MAX_ATTEMPTS:
                reason = _("another program has the file open; close the file there")
                raise PermissionError(error.errno, reason, str(old)) from error
            wait(_RETRY_DELAY_S)
        else:
            return
