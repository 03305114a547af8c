"""From which installation of NEP Studio a process of this computer was started.

The master does not tell its version on the wire; where it runs on this computer, its Python does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from importlib import metadata

    import psutil
else:
    metadata, psutil = lazy_module("importlib.metadata"), lazy_module("psutil")

__all__ = ["Install", "environment_of", "install_in", "install_of"]

_PLACES = ("lib/python*/site-packages", "Lib/site-packages")


@dataclass(frozen=True)
class Install:
    """A version of NEP Studio in a Python environment, and when it was put there (s since 1970)."""

    version: str
    since_s: float
    place: str


def install_of(pid: int) -> Install | None:
    """The installation that a process was started from; None when that is not known."""
    try:
        process = psutil.Process(pid)
        active = process.environ().get("VIRTUAL_ENV", "")
        found = environment_of(process.cmdline(), process.exe(), process.cwd(), active)
    except psutil.Error:
        return None
    return install_in(found) if found is not None else None


def environment_of(command: Sequence[str], executable: str, folder: str, active: str = "") -> Path | None:
    """The Python environment of a program that was started in ``folder``, where ``active`` was activated.

    An environment's own interpreter is a link to the one that the system tells as the executable.
    """
    called = command[0] if command else ""
    if not Path(called).stem.lower().startswith("python"):
        called = executable
    if not Path(called).stem.lower().startswith("python"):
        return None  # of an installer: its Python is inside it
    if Path(called).name == called:
        return Path(active) if active else Path(executable).parent.parent
    return Path(folder, called).parent.parent


def install_in(environment: Path) -> Install | None:
    """NEP Studio in a Python environment; None when it is not there, or there twice."""
    found = [info for place in _PLACES for info in environment.glob(f"{place}/nep_studio-*.dist-info")]
    if len(found) != 1:
        return None
    try:
        since_s = (found[0] / "METADATA").stat().st_mtime
        version = metadata.Distribution.at(found[0]).version
    except (OSError, KeyError, TypeError):  # half an installation
        return None
    return Install(version, since_s, str(environment))
