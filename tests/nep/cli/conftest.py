"""Fixtures that run commands in the test process, in a tenth of the time of a separate process.

Standard streams as pipes, exit codes of processes, Ctrl+C and terminals are tested in `test_command`,
`test_streams`, `test_interrupts` and `test_terminal`.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import pytest

from nep.cli.app import run


class Typed(NamedTuple):
    """Exit code and output of a command."""

    returncode: int
    stdout: str
    stderr: str


TypeIn: TypeAlias = Callable[..., Typed]


@pytest.fixture
def type_in(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> TypeIn:
    """Function that runs `nep` with the given arguments and returns its exit code and output."""

    def typed(*words: str) -> Typed:
        monkeypatch.setattr("sys.argv", ["nep", *words])
        before = signal.getsignal(signal.SIGTERM)  # some commands install their own handler
        environment = dict(os.environ)  # commands set variables for child processes, such as NEP_MASTER
        try:
            code = run()
        finally:
            signal.signal(signal.SIGTERM, before)
            for name in os.environ.keys() - environment.keys():
                del os.environ[name]
            os.environ.update(environment)
        return Typed(code, *capfd.readouterr())

    return typed
