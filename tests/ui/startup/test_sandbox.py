"""Tests of the browser sandbox on systems that restrict namespaces, where it would crash Studio."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import pytest

from app.ui.startup.qt_log import FLAGS_VARIABLE
from app.ui.startup.sandbox import (
    DISABLE_VARIABLE,
    NO_NAMESPACES_FLAG,
    SandboxTest,
    configure_sandbox,
    start_test,
)

ROOT = Path(__file__).resolve().parents[3]
GUARDED = """
import ctypes, os, struct
from app.ui.startup.sandbox import SandboxTest
LOAD, EQUAL, SET, RETURN = 0x20, 0x15, 0x45, 0x06
ALLOW, REFUSE = 0x7FFF0000, 0x00050000
CLONE, CHROOT, UNSHARE = 56, 161, 272
class Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("lines", ctypes.c_char_p)]
def guard(call, bits, error):
    lines = [(LOAD, 0, 0, 0), (EQUAL, 0, 3, call), (LOAD, 0, 0, 16), (SET, 0 if bits else 1, 1, bits),
             (RETURN, 0, 0, REFUSE | error), (RETURN, 0, 0, ALLOW)]
    if not bits:
        lines = [(LOAD, 0, 0, 0), (EQUAL, 0, 1, call), (RETURN, 0, 0, REFUSE | error), (RETURN, 0, 0, ALLOW)]
    made = b"".join(struct.pack("HBBI", *line) for line in lines)
    system = ctypes.CDLL(None)
    assert system.prctl(38, 1, 0, 0, 0) == 0
    assert system.prctl(22, 2, ctypes.byref(Program(len(lines), made))) == 0
def told(*of):
    if (child := os.fork()) == 0:
        if of:
            guard(*of)
        os._exit(0 if SandboxTest().is_allowed() else 1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
print(told(), told(UNSHARE, 0x10000000, 13), told(UNSHARE, 0x20000000, 1), told(CHROOT, 0, 1))
"""
"""Program that prints whether the sandbox is allowed under each of four restrictions.

These are: none, no user namespaces, no other namespaces within one, no chroot.
"""


class Told(SandboxTest):
    """Sandbox test with a given result."""

    def __init__(self, outcome: bool) -> None:
        self._outcome = outcome

    def is_allowed(self) -> bool:
        return self._outcome


@pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="the guard has its numbers"
)
def test_each_namespace_restriction_is_detected() -> None:
    done = subprocess.run(
        [sys.executable, "-c", GUARDED], cwd=ROOT, capture_output=True, text=True, timeout=140, check=True
    )
    free, *guarded = done.stdout.split()
    if free == "False":
        pytest.skip("this computer itself allows no name spaces")
    assert guarded == ["False"] * 3


def test_namespace_sandbox_is_disabled_without_namespaces_and_user_flags_are_kept() -> None:
    environ = {FLAGS_VARIABLE: "--log-level=3"}
    configure_sandbox(environ, Told(False))
    assert environ == {FLAGS_VARIABLE: f"--log-level=3 {NO_NAMESPACES_FLAG}"}


def test_no_sandbox_flags_are_set_with_namespaces_or_without_a_test_process() -> None:
    environ: dict[str, str] = {}
    configure_sandbox(environ, Told(True))
    configure_sandbox(environ, None)
    assert environ == {}


@pytest.mark.parametrize(
    ("environ", "platform"),
    [
        ({}, "win32"),
        ({}, "darwin"),
        ({DISABLE_VARIABLE: "1"}, "linux"),
        ({FLAGS_VARIABLE: "--no-sandbox"}, "linux"),
    ],
)
def test_no_sandbox_test_runs_outside_linux_or_if_the_user_set_the_option(
    environ: dict[str, str], platform: str
) -> None:
    assert start_test(environ, platform) is None
