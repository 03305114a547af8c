"""Environment of a self-test: a folder, settings and a master, isolated from other instances."""

from __future__ import annotations

import os
import socket
import sys
import tempfile
from collections.abc import MutableMapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.core.storage.atomic_file import write_atomically
from app.errors import AppError
from nep.i18n import _
from nep.system.addresses import MASTER_VARIABLE

REPORT, PICTURE, CRASH = "report.json", "window.png", "crash.txt"
EMPTY_REPORT = b"{}\n"
"""Initial content of the report file, which overwrites the report of an earlier test."""


class UnwritableFolderError(AppError):
    """Raised if the folder of the self-test can't be written."""

    def __init__(self, folder: Path, reason: str) -> None:
        self.folder, self.reason = folder, reason
        super().__init__(
            _("can't write to the folder '{folder}' ({reason}); choose another folder").format(
                folder=folder, reason=reason
            )
        )


@dataclass(frozen=True)
class TestEnvironment:
    """Folder for the results of a self-test, which also contains its home folder (settings, log, ...)."""

    folder: Path
    home: Path
    master: str

    def path(self, name: str) -> Path:
        """Return the path of the result file ``name``."""
        return self.folder / name


def prepare(folder: Path, environ: MutableMapping[str, str], *, is_root: bool) -> TestEnvironment:
    """Create the folder for the results, with a home folder in it.

    Result files of an earlier test are removed; other files remain.

    Args:
        folder: Folder for the results.
        environ: Environment variables, in which the home folder and an unused master port are set.
        is_root: True if the user is root. On Linux, the sandbox of the web engine, which can't be used
            as root, is then disabled; the test loads only Studio's own page.

    Raises:
        UnwritableFolderError: The folder can't be created or written.
    """
    folder = Path(os.path.abspath(folder))  # noqa: PTH100 - links are not resolved, so that the name stays as given
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / REPORT, EMPTY_REPORT, durable=False)
        for name in (PICTURE, CRASH):
            (folder / name).unlink(missing_ok=True)
        home = Path(tempfile.mkdtemp(prefix="home-", dir=folder))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UnwritableFolderError(folder, str(reason).lower()) from error
    environment = TestEnvironment(folder, home, f"127.0.0.1:{_free_port()}")
    environ["NEP_STUDIO_HOME"] = str(home)
    environ["NEP_STATE_DIR"] = str(home / "state")
    environ["NEP_GATEWAY"] = "0"  # its ports are fixed, and another instance or test may use them
    environ[MASTER_VARIABLE] = environment.master
    if is_root and sys.platform.startswith("linux"):
        environ.setdefault("QTWEBENGINE_DISABLE_SANDBOX", "1")
    return environment


def remove_home(environment: TestEnvironment) -> None:
    """Remove the home folder of the test. Files that exiting processes still use remain."""
    for path in sorted(environment.home.rglob("*"), reverse=True):
        with suppress(OSError):
            path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
    with suppress(OSError):
        environment.home.rmdir()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
