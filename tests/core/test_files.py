"""Atomic writing: the old file or the new one, never a part."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.core.files import write_atomically


def test_it_writes_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "a.json"
    write_atomically(path, b"one")
    write_atomically(path, b"two")
    assert path.read_bytes() == b"two"
    assert [file.name for file in path.parent.iterdir()] == ["a.json"]


@pytest.mark.skipif(os.name != "posix", reason="Windows does not replace a file that is open")
@pytest.mark.parametrize("durable", [True, False])
def test_who_reads_meanwhile_reads_the_old_file_to_its_end(tmp_path: Path, durable: bool) -> None:
    path = tmp_path / "a.json"
    write_atomically(path, b"one", durable=durable)
    with path.open("rb") as reader:
        write_atomically(path, b"second", durable=durable)
        assert reader.read() == b"one"
    assert path.read_bytes() == b"second"


def test_nothing_is_never_written_over_something(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_atomically(path, b"one")
    with pytest.raises(ValueError, match="empty"):
        write_atomically(path, b"")
    assert path.read_bytes() == b"one"


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.mkdir()
    (path / "inside").write_text("kept")
    with pytest.raises(OSError, match="irectory"):
        write_atomically(path, b"data")
    assert (path / "inside").read_text() == "kept"
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


@pytest.mark.skipif(os.name != "posix", reason="kills with SIGKILL")
def test_a_killed_writer_never_leaves_a_part(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    code = (
        "import sys, pathlib\n"
        "from app.core.files import write_atomically\n"
        "path = pathlib.Path(sys.argv[1])\n"
        "n = 0\n"
        "while True:\n"
        "    write_atomically(path, (str(n % 10) * 200_000).encode(), durable=False)\n"
        "    if n == 0: print('ready', flush=True)\n"
        "    n += 1\n"
    )
    for _ in range(5):
        process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        assert process.stdout.readline().strip() == b"ready"
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        data = path.read_bytes()
        assert len(data) == 200_000
        assert len(set(data)) == 1


def test_what_killed_writers_left_is_swept_away_but_no_write_that_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "a [1].nepb"
    old, young = tmp_path / ".a [1].nepb.x1.part", tmp_path / ".a [1].nepb.x2.part"
    other = tmp_path / ".b.nepb.x3.part"
    for each in (old, young, other):
        each.write_text("half")
    for each in (old, other):
        os.utime(each, (1.0, 1.0))
    write_atomically(path, b"whole")
    assert (old.exists(), young.exists(), other.exists()) == (False, True, True)
