"""Context of a packer: system, interpreter, version and folders."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from nep.version import __version__

__all__ = ["APP", "ROOT", "SYSTEMS", "Context", "PackageError", "this_system"]

ROOT = Path(__file__).resolve().parents[1]
APP = "NEP Studio"
"""Name of the program and of the folder of the frozen program."""
SYSTEMS = ("windows", "macos", "linux")


class PackageError(Exception):
    """Raised if a package can't be built; the message contains the reason and the solution."""


def this_system() -> str:
    """Return the current system, one of `SYSTEMS`."""
    return {"win32": "windows", "darwin": "macos"}.get(sys.platform, "linux")


def _machine() -> str:
    machine = platform.machine().lower()
    return {"amd64": "x86_64", "aarch64": "arm64"}.get(machine, machine)


def source_date_s(root: Path = ROOT) -> int:
    """Return the timestamp for all files of a package, in seconds since 1970.

    The timestamp is $SOURCE_DATE_EPOCH if set, else the time of the last commit, else of
    pyproject.toml.
    """
    source_date = os.environ.get("SOURCE_DATE_EPOCH", "")
    if source_date.isdecimal():
        return int(source_date)
    completed = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=root, capture_output=True, text=True, check=False
    )
    return (
        int(completed.stdout) if completed.returncode == 0 else int((root / "pyproject.toml").stat().st_mtime)
    )


@dataclass(frozen=True)
class Context:
    """Inputs of a packer.

    Attributes:
        system: One of `SYSTEMS`, or "clients".
        python: Command of the interpreter whose environment is frozen.
        root: Folder of the project.
        version: Version of the package.
        machine: Processor architecture.
        epoch: Timestamp for all files of the package, in seconds since 1970.
    """

    system: str
    python: Sequence[str] = (sys.executable,)
    root: Path = ROOT
    version: str = __version__
    machine: str = field(default_factory=_machine)
    epoch: int = field(default_factory=source_date_s)

    @property
    def dist(self) -> Path:
        """Folder of the finished packages."""
        return self.root / "dist"

    @property
    def work(self) -> Path:
        """Folder of intermediate files."""
        return self.root / "build" / "package" / self.system

    @property
    def frozen(self) -> Path:
        """Folder with the frozen program, ready to run."""
        return self.work / "dist" / APP

    @property
    def environ(self) -> Mapping[str, str]:
        """Environment variables for programs started by `run`, chosen for reproducible output."""
        return {
            **os.environ,
            "SOURCE_DATE_EPOCH": str(self.epoch),
            "PYTHONHASHSEED": "0",
            "LC_ALL": "C.UTF-8",
        }

    def run(self, *command: str | Path, cwd: Path | None = None) -> None:
        """Run a program and wait until it exits.

        Args:
            command: Program and arguments.
            cwd: Working folder. Default: the project's folder.

        Raises:
            PackageError: The program is missing or has failed.
        """
        arguments = [str(each) for each in command]
        try:
            completed = subprocess.run(arguments, cwd=cwd or self.root, env=dict(self.environ), check=False)
        except OSError as error:
            raise PackageError(f"'{arguments[0]}' can't be run: {error.strerror}") from error
        if completed.returncode != 0:
            raise PackageError(
                f"'{Path(arguments[0]).name}' exited with {completed.returncode}; its output is above"
            )
