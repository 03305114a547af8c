"""Tests of saved images: file names, folders, no overwriting and no partial files."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from app.core.messages import snapshots
from app.core.storage.folders import default_pictures_folder
from nep.errors import DecodeError
from nep.messages.message import Message

STAMP_NS = 1_795_164_093_412_000_000


def message(topic: str = "/Pepper/camera", data: bytes | None = None) -> Message:
    png = cv2.imencode(".png", np.zeros((4, 6, 3), np.uint8))[1].tobytes()
    return Message(topic, png if data is None else data, "image", "image", stamp_ns=STAMP_NS)


def test_snapshot_file_is_named_by_topic_and_time(tmp_path) -> None:
    path = snapshots.save(message(), tmp_path / "new" / "folder")
    assert path.parent == tmp_path / "new" / "folder"
    assert path.name.startswith("Pepper camera 2026-11-")
    assert path.name.endswith(".412.png")
    assert path.read_bytes() == bytes(message().data)


def test_same_image_saved_twice_gives_two_files(tmp_path) -> None:
    first, second = snapshots.save(message(), tmp_path), snapshots.save(message(), tmp_path)
    assert second.name == f"{first.stem} 2.png"
    assert first.read_bytes() == second.read_bytes()


def test_invalid_file_name_characters_are_removed(tmp_path) -> None:
    assert snapshots.file_stem(message("../../etc/:*?")).startswith("etc 2026")
    assert snapshots.file_stem(message("//")).startswith("picture 2026")
    assert len(snapshots.file_stem(message("x" * 500))) < 120


def test_invalid_image_leaves_no_file(tmp_path) -> None:
    with pytest.raises(DecodeError):
        snapshots.save(message(data=b"nothing"), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_snapshots_are_saved_in_studio_home_if_set(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    assert default_pictures_folder() == tmp_path / "Pictures"
    monkeypatch.delenv("NEP_STUDIO_HOME")
    assert default_pictures_folder().name == "NEP Studio"
