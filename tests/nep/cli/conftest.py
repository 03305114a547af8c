"""Commands that are typed in the process of the test: a tenth of the time of a process of their own.

What a process of its own shows (both streams as pipes, exit codes, Ctrl+C, terminals) is in `test_command`,
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
    """How a command ended, and what it wrote."""

    returncode: int
    stdout: str
    stderr: str


TypeIn: TypeAlias = Callable[..., Typed]


@pytest.fixture
def type_in(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> TypeIn:
    """Types the words behind `nep` of a command that ends."""

    def typed(*words: str) -> Typed:
        monkeypatch.setattr("sys.argv", ["nep", *words])
        before = signal.getsignal(signal.SIGTERM)  # some commands have a handler of their own
        environment = dict(os.environ)  # where the master is, say, is told to what a command starts
        try:
            code = run()
        finally:
            signal.signal(signal.SIGTERM, before)
            for name in os.environ.keys() - environment.keys():
                del os.environ[name]
            os.environ.update(environment)
        return Typed(code, *capfd.readouterr())

    return typed
