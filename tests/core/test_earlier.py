"""What files said before they were written over."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.core import earlier
from app.core.earlier import free_path, keep_earlier, stamp_of
from app.errors import DocumentError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "earlier"


def test_a_file_comes_back_as_it_was(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    path.write_bytes(b"one")
    kept = keep_earlier(path, folder)
    path.write_bytes(b"two")
    assert kept is not None
    assert kept.copy.parent == folder
    kept.put_back()
    assert path.read_bytes() == b"one"


def test_a_copy_of_the_same_second_replaces_none(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    for text in (b"one", b"two"):
        path.write_bytes(text)
        keep_earlier(path, folder, lambda: 0.0)
    assert {copy.read_bytes() for copy in folder.iterdir()} == {b"one", b"two"}


@pytest.mark.parametrize("content", [None, b""])
def test_there_may_be_nothing_to_keep(tmp_path: Path, folder: Path, content: bytes | None) -> None:
    path = tmp_path / "Round.nepb"
    if content is not None:
        path.write_bytes(content)
    assert keep_earlier(path, folder) is None
    assert not folder.exists()


def test_what_can_not_be_kept_is_said(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    path.write_bytes(b"one")
    folder.write_bytes(b"in the way")
    with pytest.raises(DocumentError, match="was not saved: what it said before can't be kept"):
        keep_earlier(path, folder)


def test_a_copy_that_is_gone_leaves_the_file(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    path.write_bytes(b"one")
    kept = keep_earlier(path, folder)
    assert kept is not None
    kept.copy.unlink()
    path.write_bytes(b"two")
    with pytest.raises(DocumentError, match="can't be put back"):
        kept.put_back()
    assert path.read_bytes() == b"two"


def test_only_the_newest_copies_stay(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(earlier, "COPIES_KEPT", 2)
    path = tmp_path / "Round.nepb"
    for number in range(4):
        path.write_bytes(b"%d" % number)
        kept = keep_earlier(path, folder, lambda: 0.0)
        assert kept is not None
        os.utime(kept.copy, ns=(number * 10**9, number * 10**9))
    assert {copy.read_bytes() for copy in folder.iterdir()} == {b"2", b"3"}


def test_a_name_becomes_a_file_name(tmp_path: Path) -> None:
    path = free_path(tmp_path, "a/b: c", 0)
    assert path.parent == tmp_path
    assert path.name.startswith("a_b_ c ")


def test_writing_a_file_changes_its_stamp(tmp_path: Path) -> None:
    path = tmp_path / "a"
    assert stamp_of(path) is None
    path.write_bytes(b"1")
    before = stamp_of(path)
    path.write_bytes(b"12")
    assert stamp_of(path) != before
