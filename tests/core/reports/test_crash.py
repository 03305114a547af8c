"""Tests of detecting crashes, and of the crash location that a process prints."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from app.core.reports.crash import exit_text, fatal_line, is_crash, split_trace


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (-11, "ended by signal 11 (SIGSEGV)"),
        (-6, "ended by signal 6 (SIGABRT)"),
        (-9, "ended by signal 9 (SIGKILL)"),
        (0xC0000005, "ended with the status 0xC0000005 (access violation)"),
        (0xC0000006, "ended with the status 0xC0000006"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="its signals have other numbers")
def test_crash_exit_codes_are_recognised_and_described(code: int, words: str) -> None:
    assert is_crash(code)
    assert exit_text(code) == words


@pytest.mark.parametrize("code", [0, 1, 2, 3, 255, -signal.SIGINT, -signal.SIGTERM, 0xC000013A])
def test_normal_exit_codes_and_termination_signals_are_not_a_crash(code: int) -> None:
    assert not is_crash(code)


def test_unknown_signal_is_described_by_its_number() -> None:
    assert exit_text(-250) == "ended by signal 250"


@pytest.mark.skipif(sys.platform == "win32", reason="a signal")
def test_crash_trace_follows_output_of_the_process() -> None:
    code = (
        "import os, signal, sys\n"
        "from nep.system.crash_trace import enable_crash_trace\n"
        "enable_crash_trace()\n"
        "print('my last words', file=sys.stderr, flush=True)\n"
        "def deep_inside(): os.kill(os.getpid(), signal.SIGSEGV)\n"
        "deep_inside()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert is_crash(done.returncode)
    said, trace = split_trace(done.stderr)
    assert said == "my last words\n"
    assert trace.startswith("Fatal Python error: Segmentation fault")
    assert "deep_inside" in trace


def test_fatal_line_of_a_crash_ignores_exceptions_caught_by_windows() -> None:
    caught = "Windows fatal exception: code 0x800706ba\n\nThread 1\n"
    assert fatal_line("") == ""
    assert fatal_line(caught) == "", "the system's own, which it caught"
    violation = "Windows fatal exception: access violation"
    assert fatal_line(f"{caught}{violation}\n\nThread 1\n{caught}") == violation
    assert fatal_line("Fatal Python error: Aborted\n\nThread 1\n") == "Fatal Python error: Aborted"


def test_output_is_split_only_at_a_crash_trace() -> None:
    assert split_trace("one\ntwo\n") == ("one\ntwo\n", "")
    assert split_trace("a\nWindows fatal exception: access violation\n\nb") == (
        "a\n",
        "Windows fatal exception: access violation\n\nb",
    )


@pytest.mark.skipif(sys.platform == "win32", reason="a closed stderr is another matter there")
def test_crash_handler_works_without_stderr() -> None:
    code = (
        "import sys; sys.stderr = None\n"
        "from nep.system.crash_trace import enable_crash_trace\n"
        "enable_crash_trace(); print('well')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "well\n"
