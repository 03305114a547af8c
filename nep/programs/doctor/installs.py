"""Detection of the installation of NEP Studio from which a process was started.

The wire doesn't carry the master's version, so the version of a local master is read from its Python
environment.
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


_SITE_PACKAGES = ("lib/python*/site-packages", "Lib/site-packages")


@dataclass(frozen=True)
class Install:
    """Installation of NEP Studio in a Python environment.

    Attributes:
        version: Version of NEP Studio.
        installed_s: Time of the installation (s since 1970).
        location: Folder of the environment.
    """

    version: str
    installed_s: float
    location: str


def install_of(pid: int) -> Install | None:
    """Return the installation from which a process was started, or None if unknown."""
    try:
        process = psutil.Process(pid)
        active_environment = process.environ().get("VIRTUAL_ENV", "")
        environment = environment_of(process.cmdline(), process.exe(), process.cwd(), active_environment)
    except psutil.Error:
        return None
    return install_in(environment) if environment is not None else None


def environment_of(
    command: Sequence[str], executable: str, folder: str, active_environment: str = ""
) -> Path | None:
    """Return the folder of a program's Python environment, or None for a frozen program.

    The interpreter of a virtual environment is a link, whose target the operating system reports as the
    executable. Therefore the command line has priority.

    Args:
        command: Command line of the program.
        executable: Executable that the operating system reports.
        folder: Folder in which the program was started.
        active_environment: Activated virtual environment (VIRTUAL_ENV), or "".
    """
    program = command[0] if command else ""
    if not Path(program).stem.lower().startswith("python"):
        program = executable
    if not Path(program).stem.lower().startswith("python"):
        return None  # frozen by an installer: it contains its Python
    if Path(program).name == program:
        return Path(active_environment) if active_environment else Path(executable).parent.parent
    return Path(folder, program).parent.parent


def install_in(environment: Path) -> Install | None:
    """Return the installation of NEP Studio in an environment; None if there is not exactly one."""
    info_folders = [
        info for pattern in _SITE_PACKAGES for info in environment.glob(f"{pattern}/nep_studio-*.dist-info")
    ]
    if len(info_folders) != 1:
        return None
    try:
        installed_s = (info_folders[0] / "METADATA").stat().st_mtime
        version = metadata.Distribution.at(info_folders[0]).version
    except (OSError, KeyError, TypeError):  # incomplete installation
        return None
    return Install(version, installed_s, str(environment))
