"""Tests of reading user files: the valid part is used, and an invalid file is backed up."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.core.storage.user_file import StoredFile, read_stored
from nep.errors import NepError


class NewerError(NepError):
    """Error for a file of a newer Studio."""


def words(data: bytes) -> tuple[list[str], str]:
    """Parse letters; report digits as damage and raise for "!" (no text) and "9" (a newer version)."""
    if data == b"!":
        raise NepError("it is no text")
    if data == b"9":
        raise NewerError("it is of a newer Studio")
    kept = [each for each in data.decode() if each.isalpha()]
    return kept, "" if len(kept) == len(data) else "there are figures in it"


def read(path: Path, most_bytes: int = 100) -> StoredFile[list[str]]:
    return read_stored(path, words, NewerError, most_bytes)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "words.json"


def beside(path: Path) -> Path:
    return path.with_name("words.damaged.json")


def test_valid_file_is_read_and_missing_file_is_empty(path: Path) -> None:
    assert read(path) == StoredFile()
    assert read(path / "below") == StoredFile()
    path.write_bytes(b"ab")
    assert read(path) == StoredFile(["a", "b"])
    assert not beside(path).exists()


def test_damaged_file_is_backed_up_and_its_valid_part_is_used(path: Path) -> None:
    path.write_bytes(b"a1b")
    found = read(path)
    assert found.value == ["a", "b"]
    assert found.problem == "Reason: there are figures in it. The file was saved as “words.damaged.json”."
    assert (path.read_bytes(), beside(path).read_bytes()) == (b"a1b", b"a1b")


def test_unreadable_file_is_moved_to_a_backup(path: Path) -> None:
    path.write_bytes(b"!")
    found = read(path)
    assert (found.value, "it is no text" in found.problem, found.is_newer) == (None, True, False)
    assert (path.exists(), beside(path).read_bytes()) == (False, b"!")


def test_oversized_file_or_folder_is_moved_to_a_backup(path: Path) -> None:
    path.write_bytes(b"a" * 101)
    assert "MB" in read(path).problem
    assert beside(path).stat().st_size == 101
    beside(path).unlink()
    path.mkdir()
    assert read(path).value is None
    assert beside(path).is_dir()


def test_file_of_a_newer_version_is_not_modified(path: Path) -> None:
    path.write_bytes(b"9")
    found = read(path)
    assert (found.value, found.is_newer) == (None, True)
    assert found.problem.startswith("Your changes aren't being saved: it is of")
    assert (path.read_bytes(), beside(path).exists()) == (b"9", False)
