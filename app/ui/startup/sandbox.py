"""Sandbox of the block editor's browser on Linux systems that deny user namespaces.

Chromium isolates its processes by namespaces and by a system call filter. Where namespaces are denied,
for example by AppArmor on Ubuntu 24.04 and later, Chromium crashes Studio. Therefore the creation of
namespaces is tested first; if it fails, Chromium uses only the system call filter.
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

from app.ui.startup.qt_log import FLAGS_VARIABLE

NO_NAMESPACES_FLAG = "--disable-namespace-sandbox"
DISABLE_VARIABLE = "QTWEBENGINE_DISABLE_SANDBOX"
CLONE_NEWUSER, CLONE_NEWPID = 0x10000000, 0x20000000
EMPTY_ROOT = b"/proc/self/fdinfo"
"""Root folder of an isolated process; the folder is empty once the process that created it has ended."""
TIMEOUT_S = 2.0

_log = logging.getLogger("studio.editor")


class SandboxTest:
    """Child process that tests whether this program may create namespaces as Chromium does."""

    def __init__(self) -> None:
        # The test takes about 20 ms, during which other work can be done.
        self._exit_reader, writer = os.pipe()  # the write end is closed when the process has ended
        try:
            self._process_id = os.fork()
            if self._process_id == 0:
                code = 1
                try:
                    code = 0 if try_isolation() else 1
                finally:
                    os._exit(code)
        except OSError:
            self._process_id = -1
        finally:
            os.close(writer)

    def is_allowed(self) -> bool:
        """Return True if namespaces are allowed; False if they are denied or the test fails.

        Blocks for up to 2 s. Can be called only once.
        """
        if self._process_id < 0:
            return False
        if not select.select([self._exit_reader], [], [], TIMEOUT_S)[0]:
            os.kill(self._process_id, signal.SIGKILL)
        os.close(self._exit_reader)
        return os.waitpid(self._process_id, 0)[1] == 0


def start_test(environ: Mapping[str, str], platform: str) -> SandboxTest | None:
    """Start a test of the sandbox if the platform and the environment require one.

    Args:
        environ: Environment variables.
        platform: Value of `sys.platform`.

    Returns:
        The running test; None except on Linux, or if the user has configured the sandbox.
    """
    if (
        not platform.startswith("linux")
        or environ.get(DISABLE_VARIABLE)
        or "sandbox" in environ.get(FLAGS_VARIABLE, "")
    ):
        return None
    return SandboxTest()


def configure_sandbox(environ: MutableMapping[str, str], sandbox_test: SandboxTest | None) -> None:
    """Disable Chromium's namespaces if the test failed; call this before the web engine starts.

    Args:
        environ: Environment variables, modified in place.
        sandbox_test: Test that was started, or None.
    """
    if sandbox_test is not None and not sandbox_test.is_allowed():
        _log.info(
            "user namespaces are not permitted: the block editor's browser uses the system call filter only"
        )
        environ[FLAGS_VARIABLE] = f"{environ.get(FLAGS_VARIABLE, '')} {NO_NAMESPACES_FLAG}".strip()


def try_isolation() -> bool:
    """Isolate this process as Chromium isolates its processes; return False if the system denies it."""
    if sys.platform == "win32":
        return False
    user, group = os.geteuid(), os.getegid()
    system = ctypes.CDLL(None, use_errno=True)
    if system.unshare(CLONE_NEWUSER | CLONE_NEWPID) != 0:
        return False
    process_folder = Path("/proc/self")
    try:
        (process_folder / "setgroups").write_text("deny")
        (process_folder / "uid_map").write_text(f"{user} {user} 1")
        (process_folder / "gid_map").write_text(f"{group} {group} 1")
    except OSError:
        return False
    return bool(system.chroot(EMPTY_ROOT) == 0)
