"""The sandbox of the block editor's browser, on a Linux that allows a program no name spaces of its own.

Chromium shuts its processes off twice: by name spaces, and by a filter of system calls. Where a guard such
as AppArmor forbids the first (Ubuntu 24.04 and later, for programs that no profile names), Chromium finds out
too late and ends the whole of Studio. So it is tried beforehand, and then Chromium is told to do without: the
filter stays.
"""

from __future__ import annotations

import ctypes
import logging
import os
import select
import signal
import sys
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from app.ui.startup.qt_log import FLAGS

FILTER_ALONE = "--disable-namespace-sandbox"
OFF = "QTWEBENGINE_DISABLE_SANDBOX"
NEW_USER, NEW_PROCESSES = 0x10000000, 0x20000000
NOWHERE = b"/proc/self/fdinfo"
"""Where Chromium's processes are shut in: a folder that is empty once its process has ended."""
LONGEST_S = 2.0

_log = logging.getLogger("studio.editor")


class SandboxTrial:
    """Tries whether this program may shut a process off as Chromium does, by a process that ends at once."""

    def __init__(self) -> None:
        """Begin; the system takes some 20 ms, in which other things can be done."""
        self._ended, writer = os.pipe()  # it is closed at the other end when that process has ended
        try:
            self._process = os.fork()
            if self._process == 0:
                code = 1
                try:
                    code = 0 if shuts_itself_off() else 1
                finally:
                    os._exit(code)
        except OSError:
            self._process = -1
        finally:
            os.close(writer)

    def allowed(self) -> bool:
        """Whether it could, asked once; False as well when that can't be found out. Waits at most 2 s."""
        if self._process < 0:
            return False
        if not select.select([self._ended], [], [], LONGEST_S)[0]:
            os.kill(self._process, signal.SIGKILL)
        os.close(self._ended)
        return os.waitpid(self._process, 0)[1] == 0


def begin_trial(environ: Mapping[str, str], platform: str) -> SandboxTrial | None:
    """Begin to try it; None where nothing is to be tried. ``platform`` as `sys.platform` says it.

    Somebody may have switched the sandbox off, or have chosen another one by Chromium's flags.
    """
    if not platform.startswith("linux") or environ.get(OFF) or "sandbox" in environ.get(FLAGS, ""):
        return None
    return SandboxTrial()


def fit_sandbox(environ: MutableMapping[str, str], trial: SandboxTrial | None) -> None:
    """Let Chromium do with its filter where the trial has failed; call it before the web engine begins."""
    if trial is not None and not trial.allowed():
        _log.info("no name spaces are allowed here: the block editor's browser has its filter alone")
        environ[FLAGS] = f"{environ.get(FLAGS, '')} {FILTER_ALONE}".strip()


def shuts_itself_off() -> bool:
    """Shut this very process off as Chromium does its own; whether the system let it."""
    if sys.platform == "win32":
        return False
    user, group = os.geteuid(), os.getegid()
    system = ctypes.CDLL(None, use_errno=True)
    if system.unshare(NEW_USER | NEW_PROCESSES) != 0:
        return False
    own = Path("/proc/self")
    try:
        (own / "setgroups").write_text("deny")
        (own / "uid_map").write_text(f"{user} {user} 1")
        (own / "gid_map").write_text(f"{group} {group} 1")
    except OSError:
        return False
    return bool(system.chroot(NOWHERE) == 0)
