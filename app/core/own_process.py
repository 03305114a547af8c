"""How Studio starts one of its own modules as a process, also where it is frozen into one program."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from nep.i18n import LANG_VARIABLE

Fate = Literal["", "replaced", "gone"]


def module_command(module: str) -> list[str]:
    """The command that runs one of our modules as a process of its own, also from a frozen build."""
    if getattr(sys, "frozen", False):
        return [sys.executable, "--module", module]
    return [sys.executable, "-m", module]


def studio_command(theme: str | None = None) -> list[str]:
    """The command that starts Studio itself as this one was, without the files that it was given."""
    own = [sys.executable] if getattr(sys, "frozen", False) else [sys.executable, "-m", "app"]
    return [*own, *(("--theme", theme) if theme is not None else ())]


def fresh_environ(environ: Mapping[str, str]) -> dict[str, str]:
    """Return the environment without the language that `nep.i18n.begin` set, so that the settings count."""
    return {name: value for name, value in environ.items() if name not in {LANG_VARIABLE, "LANGUAGE"}}


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
