"""Commands that start Studio or one of its modules in a new process, including from a frozen build."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from nep.i18n import LANG_VARIABLE

ExecutableState = Literal["", "replaced", "gone"]


def module_command(module: str) -> list[str]:
    """Return the command that runs one of Studio's modules in a new process."""
    if getattr(sys, "frozen", False):
        return [sys.executable, "--module", module]
    return [sys.executable, "-m", module]


def studio_command(theme: str | None = None) -> list[str]:
    """Return the command that starts Studio like the current process, without files to open.

    Args:
        theme: Theme to use instead of the current one.
    """
    command = [sys.executable] if getattr(sys, "frozen", False) else [sys.executable, "-m", "app"]
    return [*command, *(("--theme", theme) if theme is not None else ())]


def fresh_environ(environ: Mapping[str, str]) -> dict[str, str]:
    """Return a copy of the environment without the language that `nep.i18n.set_initial_language` sets.

    A process started with this environment uses the language in the settings.
    """
    return {name: value for name, value in environ.items() if name not in {LANG_VARIABLE, "LANGUAGE"}}


class OwnProgram:
    """Executable file of a frozen build, which is needed to load modules and to start child processes."""

    def __init__(self, file: Path | None = None) -> None:
        # By default the executable of a frozen build; without one, nothing is checked.
        is_frozen = bool(getattr(sys, "frozen", False))
        self._file = file if file is not None or not is_frozen else Path(sys.executable)
        self._initial_signature = self._signature()

    def executable_state(self) -> ExecutableState:
        """Return the state of the executable file: "" (unchanged), "replaced" (by an update), or "gone".

        The state is always "" if Studio is not a frozen build.
        """
        signature = self._signature()
        if signature == self._initial_signature:
            return ""
        return "replaced" if signature is not None else "gone"

    def _signature(self) -> tuple[int, ...] | None:
        if self._file is None:
            return None
        try:
            file_stat = self._file.stat()
        except OSError:
            return None
        return file_stat.st_dev, file_stat.st_ino, file_stat.st_size, file_stat.st_mtime_ns
