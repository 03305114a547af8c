"""Tests of the lock that Studios share: exclusive, released when its process dies, with a timeout."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.storage.file_lock import FileLock, locked

HOLDER = """
import sys
from pathlib import Path
from app.core.storage.file_lock import locked
with locked(Path(sys.argv[1])) as held:
    print(held, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Other process that holds the lock until its standard input is closed."""
    root = str(Path(__file__).parents[3])
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path / "file")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": root},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "True\n"
    yield process
    process.kill()
    process.communicate()


def test_lock_is_released_after_use_and_can_be_acquired_again(tmp_path: Path) -> None:
    for _ in range(2):
        with locked(tmp_path / "file") as held:
            assert held


def test_unavailable_lock_times_out(tmp_path: Path, holder: subprocess.Popen[str]) -> None:
    began = time.monotonic()
    with locked(tmp_path / "file", within_s=0.2) as held:
        assert not held
    assert time.monotonic() - began >= 0.2


def test_file_system_without_locks_does_not_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_file: object) -> None:
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr("app.core.storage.file_lock._lock", refuse)
    with locked(tmp_path / "file", within_s=60.0) as held:
        assert not held


def test_lock_is_released_when_its_process_is_killed(tmp_path: Path, holder: subprocess.Popen[str]) -> None:
    holder.kill()
    with locked(tmp_path / "file", within_s=60.0) as held:
        assert held


def test_failure_to_create_the_lock_folder_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with locked(tmp_path / "file" / "below") as held:
        assert not held


def test_file_lock_is_held_until_release_or_process_exit(
    holder: subprocess.Popen[str], tmp_path: Path
) -> None:
    turn, other = FileLock(tmp_path / "file"), FileLock(tmp_path / "file")
    assert not turn.acquire()
    holder.kill()
    holder.wait(60)
    assert turn.acquire()
    assert turn.acquire()
    assert not other.acquire()
    turn.release()
    turn.release()
    assert other.acquire()
    other.release()


def test_acquire_succeeds_if_the_lock_file_cannot_be_created(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    assert FileLock(tmp_path / "file" / "starting").acquire()
