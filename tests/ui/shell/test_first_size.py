"""Tests of the initial window size, which fits the screen so that Stop is visible."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QSize

from app.ui.shell.main_window import DEFAULT_SIZE
from app.ui.shell.window_state import FRAME_SIZE, initial_size


def test_large_screen_uses_the_default_window_size() -> None:
    assert initial_size(DEFAULT_SIZE, QSize(1600, 1000)) == DEFAULT_SIZE
    assert initial_size(DEFAULT_SIZE, DEFAULT_SIZE) == DEFAULT_SIZE


@pytest.mark.parametrize("room", [QSize(1280, 800), QSize(1366, 768), QSize(1600, 860)])
def test_window_and_its_frame_fit_a_smaller_screen(room: QSize) -> None:
    size = initial_size(DEFAULT_SIZE, room) + FRAME_SIZE
    assert size.width() <= room.width() + (FRAME_SIZE.width() if room.width() > DEFAULT_SIZE.width() else 0)
    assert size.height() <= room.height()
