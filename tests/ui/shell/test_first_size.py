"""The window of a first start fits the screen: Stop is at its right end."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QSize

from app.ui.shell.main_window import FIRST_SIZE
from app.ui.shell.window_state import FRAME, initial_size


def test_large_screen_uses_the_default_window_size() -> None:
    assert initial_size(FIRST_SIZE, QSize(1600, 1000)) == FIRST_SIZE
    assert initial_size(FIRST_SIZE, FIRST_SIZE) == FIRST_SIZE


@pytest.mark.parametrize("room", [QSize(1280, 800), QSize(1366, 768), QSize(1600, 860)])
def test_window_and_its_frame_fit_a_smaller_screen(room: QSize) -> None:
    size = initial_size(FIRST_SIZE, room) + FRAME
    assert size.width() <= room.width() + (FRAME.width() if room.width() > FIRST_SIZE.width() else 0)
    assert size.height() <= room.height()
