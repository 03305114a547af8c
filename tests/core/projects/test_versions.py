"""Tests of earlier versions, which keep the content of files that were overwritten."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from app.core.projects import versions
from app.core.projects.versions import (
    free_path,
    move_old_versions,
    namesakes_of,
    save_version,
    stamp_of,
    versions_of,
)
from app.core.storage.folders import data_home, home
from app.errors import DocumentError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "earlier"


def test_earlier_version_is_restored(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    path.write_bytes(b"one")
    kept = save_version(path, folder)
    path.write_bytes(b"two")
    assert kept is not None
    assert kept.copy.parent == folder
    kept.restore()
    assert path.read_bytes() == b"one"


def test_versions_of_the_same_second_do_not_overwrite_each_other(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    for text in (b"one", b"two"):
        path.write_bytes(text)
        save_version(path, folder, lambda: 0.0)
    assert {copy.read_bytes() for copy in folder.iterdir()} == {b"one", b"two"}


@pytest.mark.parametrize("content", [None, b""])
def test_empty_or_missing_file_has_no_version(tmp_path: Path, folder: Path, content: bytes | None) -> None:
    path = tmp_path / "Round.nepb"
    if content is not None:
        path.write_bytes(content)
    assert save_version(path, folder) is None
    assert not folder.exists()


def test_save_fails_when_previous_version_cannot_be_kept(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    path.write_bytes(b"one")
    folder.write_bytes(b"in the way")
    with pytest.raises(DocumentError, match="wasn't saved: its previous version can't be kept"):
        save_version(path, folder)


def test_restoring_deleted_version_raises_and_keeps_the_file(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    path.write_bytes(b"one")
    kept = save_version(path, folder)
    assert kept is not None
    kept.copy.unlink()
    path.write_bytes(b"two")
    with pytest.raises(DocumentError, match="can't restore "):
        kept.restore()
    assert path.read_bytes() == b"two"


def test_only_newest_versions_are_kept(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(versions, "MAX_COPIES", 2)
    path = tmp_path / "Round.nepb"
    for number in range(4):
        path.write_bytes(b"%d" % number)
        kept = save_version(path, folder, lambda: 0.0)
        assert kept is not None
        os.utime(kept.copy, ns=(number * 10**9, number * 10**9))
    assert {copy.read_bytes() for copy in folder.iterdir()} == {b"2", b"3"}


def test_document_name_becomes_valid_file_name(tmp_path: Path) -> None:
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


def kept(path: Path, folder: Path, text: bytes, written_s: float, replaced_s: float) -> None:
    """Save a version of a file that was written at `written_s` and overwritten at `replaced_s`."""
    path.write_bytes(text)
    os.utime(path, (written_s, written_s))
    assert save_version(path, folder, lambda: replaced_s) is not None


def test_versions_are_listed_newest_first_with_their_times(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    kept(path, folder, b"one", 1000, 2000)
    kept(path, folder, b"two", 2000, 3000)
    found = versions_of(path, folder)
    assert [each.copy.read_bytes() for each in found] == [b"two", b"one"]
    assert [(each.written_s, each.replaced_s) for each in found] == [(2000, 3000), (1000, 2000)]
    assert [each.name for each in found] == ["Round", "Round"]


def test_identical_version_is_not_kept_twice(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    kept(path, folder, b"one", 1000, 2000)
    kept(path, folder, b"one", 1000, 3000)
    assert len(list(folder.iterdir())) == 1


def test_versions_of_same_file_name_in_two_folders_are_separate(tmp_path: Path, folder: Path) -> None:
    here, there = tmp_path / "here" / "a b.nepb", tmp_path / "there" / "a b.nepb"
    for path in (here, there):
        path.parent.mkdir()
        kept(path, folder, path.parent.name.encode(), 1000, 2000)
    (folder / "a b, before 2026-11-20 12.00.00.nepb").write_bytes(b"of an older Studio")
    (folder / "another.nepb").write_bytes(b"no version")
    assert [each.copy.read_bytes() for each in versions_of(here, folder)] == [b"here"]
    others = {each.copy.read_bytes() for each in namesakes_of(here, folder)}
    assert others == {b"there", b"of an older Studio"}


def test_newest_versions_and_a_sample_of_older_ones_are_kept(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "Round.nepb"
    hour, day = 3600.0, 86400.0
    times = [*(number * day for number in range(1, 21)), *(30 * day + number * 60 for number in range(40))]
    for when in times:
        kept(path, folder, str(when).encode(), when - hour, when)
    found = [each.replaced_s for each in versions_of(path, folder)]
    assert len(found) == versions.MAX_COPIES_PER_FILE
    assert found[: versions.MIN_COPIES_PER_FILE] == times[: -versions.MIN_COPIES_PER_FILE - 1 : -1]
    assert len(set(times[:20]) & set(found)) >= 19, "one of nearly each day"


def test_total_size_of_versions_is_limited(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(versions, "MAX_BYTES", 25)
    path = tmp_path / "Round.nepb"
    for number in range(4):
        kept(path, folder, b"%010d" % number, number * 100, number * 1000)
    assert [each.copy.read_bytes()[-1:] for each in versions_of(path, folder)] == [b"3", b"2"]


# ---- storage location ------------------------------------------------------------------------------


def test_versions_are_migrated_once_to_data_folder(tmp_path: Path) -> None:
    old, new = tmp_path / "config" / "earlier", tmp_path / "data" / "earlier"
    document = tmp_path / "mine.nepb"
    document.write_bytes(b"first")
    os.utime(document, (1_000_000, 1_000_000))
    kept = save_version(document, old)
    assert kept is not None
    move_old_versions(old, new)
    assert not old.exists()
    (version,) = versions_of(document, new)
    assert (version.copy.read_bytes(), version.written_s) == (b"first", 1_000_000)
    move_old_versions(old, new)
    assert len(versions_of(document, new)) == 1


def test_versions_that_cannot_be_migrated_are_kept(tmp_path: Path) -> None:
    old, new = tmp_path / "config" / "earlier", tmp_path / "data"
    document = tmp_path / "mine.nepb"
    document.write_bytes(b"first")
    assert save_version(document, old) is not None
    new.write_text("in the way")
    move_old_versions(old, new / "earlier")
    assert len(versions_of(document, old)) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="these variables are those of Linux")
def test_versions_are_stored_in_data_folder_not_in_settings_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("NEP_STUDIO_HOME", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    (tmp_path / "Round.nepb").write_bytes(b"one")
    kept = save_version(tmp_path / "Round.nepb")
    assert kept is not None
    assert kept.copy.is_relative_to(tmp_path / "data" / "nep-studio")
    assert not (tmp_path / "config").exists()


def test_data_folder_follows_xdg_variables_and_nep_studio_home(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("NEP_STUDIO_HOME", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    if sys.platform == "linux":
        assert data_home() == tmp_path / "data" / "nep-studio"
        assert home() == tmp_path / "config" / "nep-studio"
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    assert data_home() == home() == tmp_path
