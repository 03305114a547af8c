"""Tests of the reduction of window images: flat colours stay exact, other colours are approximated."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tools.small_png import shrink


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """Image of a red area next to a gradient with many colours."""
    made = np.zeros((80, 320, 3), np.uint8)
    made[:, :60] = (0x2D, 0x28, 0xC8)
    across = np.linspace(0, 255, 260, dtype=np.uint8)
    made[:, 60:, 0] = across
    made[:, 60:, 1] = across[::-1]
    made[:, 60:, 2] = np.linspace(0, 255, 80, dtype=np.uint8)[:, None]
    path = tmp_path / "picture.png"
    cv2.imwrite(str(path), made)
    return path


def test_shrunk_image_has_a_smaller_file_and_nearly_the_same_pixels(picture: Path) -> None:
    before, size = cv2.imread(str(picture)), picture.stat().st_size
    assert shrink(picture) == picture.stat().st_size < size
    after = cv2.imread(str(picture))
    assert after.shape == before.shape
    assert (after[:, :60] == before[:, :60]).all()
    assert abs(after.astype(int) - before).mean() < 8
    assert len(np.unique(after.reshape(-1, 3), axis=0)) <= 256


def test_fewer_colours_make_the_file_smaller(picture: Path) -> None:
    before = shrink(picture)
    assert shrink(picture, 64) < before
    assert len(np.unique(cv2.imread(str(picture)).reshape(-1, 3), axis=0)) <= 64


def test_image_with_few_colours_keeps_its_exact_pixels(tmp_path: Path) -> None:
    path = tmp_path / "few.png"
    made = np.arange(0, 250, 5, dtype=np.uint8).reshape(5, 10, 1).repeat(3, axis=2)
    cv2.imwrite(str(path), made)
    shrink(path)
    assert (cv2.imread(str(path)) == made).all()
    with pytest.raises(OSError, match="isn't a readable image"):
        shrink(tmp_path / "missing.png")
