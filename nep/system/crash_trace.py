"""Stack traces of native crashes."""

from __future__ import annotations

import contextlib
import faulthandler

__all__ = ["say_where_it_crashes"]


def say_where_it_crashes() -> None:
    """Write the stacks of all threads to stderr when this process crashes (segmentation fault, abort).

    Does nothing if stderr is missing.
    """
    with contextlib.suppress(OSError, RuntimeError, ValueError, AttributeError):
        faulthandler.enable()
