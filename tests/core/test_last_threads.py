"""Tests of the exit of a process whose threads don't end."""

from __future__ import annotations

import subprocess
import sys
import threading

from app.__main__ import join_threads

PROGRAM = """
import logging, sys, threading
from app.__main__ import end_process
logging.basicConfig()
wait = threading.Event().wait
threading.Thread(target=wait, name="{name}", daemon={daemon}).start()
print("kept", flush=False)
sys.exit(end_process(3, 0.1))
"""
IMMEDIATE = """
import atexit, os
from app.__main__ import end_process
atexit.register(os._exit, 7)
print("kept")
end_process(3, is_immediate=True)
"""


def ran(name: str, *, daemon: bool) -> subprocess.CompletedProcess[str]:
    program = PROGRAM.format(name=name, daemon=daemon)
    return subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True, timeout=120
    )


def test_process_exits_and_logs_the_threads_still_running() -> None:
    done = ran("never ends", daemon=False)
    assert (done.returncode, done.stdout) == (3, "kept\n")
    assert "exiting while threads are still running: 'never ends'" in done.stderr


def test_daemon_threads_are_not_waited_for() -> None:
    done = ran("a daemon", daemon=True)
    assert (done.returncode, done.stdout, done.stderr) == (3, "kept\n", "")


def test_immediate_exit_keeps_output_and_exit_code_and_skips_cleanup() -> None:
    done = subprocess.run(
        [sys.executable, "-c", IMMEDIATE], check=False, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout, done.stderr) == (3, "kept\n", "")


def test_thread_that_ends_in_time_is_joined() -> None:
    go, gone = threading.Event(), threading.Event()

    def last() -> None:
        go.wait(30)
        gone.set()

    thread = threading.Thread(target=last, name="last")
    thread.start()
    assert "last" in join_threads(0.0)
    go.set()
    assert "last" not in join_threads(30.0)
    assert gone.is_set()
