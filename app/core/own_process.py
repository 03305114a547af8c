"""How Studio starts one of its own modules as a process, also where it is frozen into one program."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

Fate = Literal["", "replaced", "gone"]


def module_command(module: str) -> list[str]:
    """The command that runs one of our modules as a process of its own, also from a frozen build."""
    if getattr(sys, "frozen", False):
        return [sys.executable, "--module", module]
    return [sys.executable, "-m", module]


class OwnProgram:
    """The file of a frozen Studio that is open: what is not loaded yet, and its processes, come from it."""

    def __init__(self, file: Path | None = None) -> None:
        """Remember how it is now; by default that of a frozen build, elsewhere none."""
        frozen = bool(getattr(sys, "frozen", False))
        self._file = file if file is not None or not frozen else Path(sys.executable)
        self._was = self._look()

    def fate(self) -> Fate:
        """What became of it since: "" nothing, "replaced" by an update, "gone" with the package."""
        now = self._look()
        if now == self._was:
            return ""
        return "replaced" if now is not None else "gone"

    def _look(self) -> tuple[int, ...] | None:
        if self._file is None:
            return None
        try:
            about = self._file.stat()
        except OSError:
            return None
        return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns
