"""Tests of atomic writes: a file has its old or its new content, never a part."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import read_file
from app.core.projects.journal import Journal, unsaved_work
from app.core.projects.versions import move_old_versions, save_version
from app.core.storage.atomic_file import read_regular_file, write_atomically
from app.core.storage.settings import Settings
from app.errors import DocumentError
from nep.system.replace_file import replace_file


def test_write_creates_and_replaces_a_file(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "a.json"
    write_atomically(path, b"one")
    write_atomically(path, b"two")
    assert path.read_bytes() == b"two"
    assert [file.name for file in path.parent.iterdir()] == ["a.json"]


@pytest.mark.skipif(os.name != "posix", reason="Windows does not replace a file that is open")
@pytest.mark.parametrize("durable", [True, False])
def test_open_reader_reads_the_old_file_to_its_end(tmp_path: Path, durable: bool) -> None:
    path = tmp_path / "a.json"
    write_atomically(path, b"one", durable=durable)
    with path.open("rb") as reader:
        write_atomically(path, b"second", durable=durable)
        assert reader.read() == b"one"
    assert path.read_bytes() == b"second"


def test_empty_data_never_overwrites_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_atomically(path, b"one")
    with pytest.raises(ValueError, match="empty"):
        write_atomically(path, b"")
    assert path.read_bytes() == b"one"


def test_streamed_write_is_complete_or_absent(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_atomically(path, (f"{n}\n".encode() for n in range(1000)))
    assert path.read_text().splitlines() == [str(n) for n in range(1000)]

    def parts() -> Iterator[bytes]:
        yield b"half"
        raise OSError(28, "no space left")

    with pytest.raises(OSError, match="no space left"):
        write_atomically(path, parts())
    assert len(path.read_text().splitlines()) == 1000
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]


def test_failed_write_over_a_folder_keeps_its_content_and_leaves_no_temporary_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.mkdir()
    (path / "inside").write_text("kept")
    said = "irectory" if os.name == "posix" else "has the file open"  # Windows reports only denied access
    with pytest.raises(OSError, match=said):
        write_atomically(path, b"data")
    assert (path / "inside").read_text() == "kept"
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


@pytest.mark.skipif(os.name != "posix", reason="kills with SIGKILL")
def test_killed_writer_never_leaves_a_partial_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    code = (
        "import sys, pathlib\n"
        "from app.core.storage.atomic_file import write_atomically\n"
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


def test_stale_temporary_files_are_deleted_but_not_those_in_use(tmp_path: Path) -> None:
    path = tmp_path / "a [1].nepb"
    old, young = tmp_path / ".a [1].nepb.x1.part", tmp_path / ".a [1].nepb.x2.part"
    other = tmp_path / ".b.nepb.x3.part"
    for each in (old, young, other):
        each.write_text("half")
    for each in (old, other):
        os.utime(each, (1.0, 1.0))
    write_atomically(path, b"whole")
    assert (old.exists(), young.exists(), other.exists()) == (False, True, True)


# ---- reading files ---------------------------------------------------------------------------------


def test_regular_file_is_read_up_to_the_size_limit(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"x" * 1000)
    assert read_regular_file(path, 1000) == b"x" * 1000
    if os.name == "posix":  # on Windows, creating symbolic links needs a privilege
        (tmp_path / "link").symlink_to(path)
        assert read_regular_file(tmp_path / "link", 1000) == b"x" * 1000
    with pytest.raises(OSError, match=r"the limit is 0 MB"):
        read_regular_file(path, 999)
    with pytest.raises(FileNotFoundError):
        read_regular_file(tmp_path / "none")


@pytest.mark.skipif(os.name != "posix", reason="needs pipes and devices that look like files")
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "link to a pipe", "link to a device"])
def test_non_regular_file_is_rejected_with_reason(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "settings.json"
    real = tmp_path / "real" if kind.startswith("link") else path
    if "pipe" in kind:
        os.mkfifo(real)
    elif "folder" in kind:
        real.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    if kind.startswith("link"):
        path.symlink_to(real if "pipe" in kind else "/dev/zero")
    with pytest.raises(OSError, match=r"not a file, but a folder, a pipe or a device"):
        read_regular_file(path)
    with pytest.raises(DocumentError, match="can't read "):
        read_file(path)
    assert save_version(path, tmp_path / "earlier") is None
    assert unsaved_work(tmp_path) == []
    assert Settings(tmp_path).text_percent == 100
    Settings(tmp_path).text_percent = 150
    assert Settings(tmp_path).text_percent == 150


@pytest.mark.skipif(os.name != "posix", reason="needs pipes that look like files")
def test_pipe_in_place_of_a_file_does_not_block(tmp_path: Path) -> None:
    for name in ("settings.json", "Round.nepb"):
        os.mkfifo(tmp_path / name)
    assert Settings(tmp_path).text_percent == 100
    with pytest.raises(DocumentError):
        read_file(tmp_path / "Round.nepb")


# ---- file permissions ------------------------------------------------------------------------------


@pytest.fixture
def open_umask() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def modes(folder: Path) -> dict[str, int]:
    found = {".": folder} | {file.name: file for file in folder.iterdir() if not file.name.endswith(".lock")}
    return {name: file.stat().st_mode & 0o777 for name, file in found.items()}


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes")
@pytest.mark.usefixtures("open_umask")
def test_user_data_files_are_private_regardless_of_umask(tmp_path: Path) -> None:
    home = tmp_path / "home"
    Settings(home).text_percent = 150
    Journal(home / "journal").write(Project.of_blocks("x", {}), None)
    document = tmp_path / "mine.nepb"
    document.write_bytes(b"{}")
    kept = save_version(document, home / "earlier")
    assert kept is not None
    assert modes(home) == {".": 0o700, "settings.json": 0o600, "journal": 0o700, "earlier": 0o700}
    assert set(modes(home / "journal").values()) == {0o700, 0o600}
    assert modes(home / "earlier") == {".": 0o700, kept.copy.name: 0o600}
    kept.restore()
    assert document.stat().st_mode & 0o777 == 0o666  # a behaviour file keeps its permissions


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes")
@pytest.mark.parametrize(("umask", "mode"), [(0o077, 0o600), (0o022, 0o644), (0o002, 0o664)])
def test_new_behaviour_file_follows_umask(tmp_path: Path, umask: int, mode: int) -> None:
    path = tmp_path / "mine.nepb"
    before = os.umask(umask)
    try:
        write_atomically(path, b"{}")
        write_atomically(path, b"{ }")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == mode
    assert [file.name for file in tmp_path.iterdir()] == ["mine.nepb"]


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes")
@pytest.mark.usefixtures("open_umask")
def test_permissions_of_files_from_earlier_versions_are_tightened_at_start(tmp_path: Path) -> None:
    home = tmp_path / "home"
    for folder in (home, home / "journal", home / "earlier"):
        folder.mkdir()
        (folder / "settings.json").write_text("{}")
    (home / "earlier" / "settings.json").rename(home / "earlier" / "settings.json.nepb")
    (home / "somebody's.sh").write_text("")
    Settings(home)
    unsaved_work(home / "journal")
    move_old_versions(home / "earlier", home / "earlier")
    for folder in (home, home / "journal", home / "earlier"):
        found = modes(folder)
        assert found.pop(".") == 0o700
        assert found.pop("somebody's.sh", 0o666) == 0o666
        assert {mode for name, mode in found.items() if "." in name} == {0o600}


# ---- files in use by another program ---------------------------------------------------------------


def busy(code: int) -> PermissionError:
    error = PermissionError(13, "in use")
    error.winerror = code  # type: ignore[attr-defined,unused-ignore]
    return error


@pytest.mark.parametrize("code", [5, 32, 33])
def test_replacing_a_file_in_use_is_retried(tmp_path: Path, code: int) -> None:
    errors, waited = [busy(code), busy(code)], []

    def replace(new: Path, old: Path) -> None:
        if errors:
            raise errors.pop()
        new.replace(old)

    (tmp_path / "new").write_text("new")
    replace_file(tmp_path / "new", tmp_path / "old", replace=replace, pause=waited.append)
    assert (tmp_path / "old").read_text() == "new"
    assert len(waited) == 2


def test_file_that_stays_in_use_is_reported(tmp_path: Path) -> None:
    waited: list[float] = []

    def replace(new: Path, old: Path) -> None:
        raise busy(32)

    with pytest.raises(PermissionError, match="another program has the file open; close the file there"):
        replace_file(tmp_path / "new", tmp_path / "old", replace=replace, pause=waited.append)
    assert 0 < sum(waited) <= 1


def test_permission_error_of_a_file_not_in_use_is_not_retried(tmp_path: Path) -> None:
    def replace(new: Path, old: Path) -> None:
        raise PermissionError(13, "read only")

    waited: list[float] = []
    with pytest.raises(PermissionError, match="read only"):
        replace_file(tmp_path / "new", tmp_path / "old", replace=replace, pause=waited.append)
    assert waited == []
