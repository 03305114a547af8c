"""Stack traces of native crashes."""

from __future__ import annotations

import contextlib
import faulthandler


def enable_crash_trace() -> None:
    """Make this process write the stacks of all threads to stderr on a segmentation fault or abort.

    Does nothing if stderr is missing.
    """
    with contextlib.suppress(OSError, RuntimeError, ValueError, AttributeError):
        faulthandler.enable()
