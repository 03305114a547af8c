"""Accessibility preferences of the system for high contrast and reduced motion."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QStyleHints

SPI_GETCLIENTAREAANIMATION = 0x1042  # action of SystemParametersInfoW on Windows


def prefers_contrast(hints: QStyleHints) -> bool:
    """Return True if the system requests high contrast; False if Qt is too old to report it."""
    accessibility = getattr(hints, "accessibility", None)
    return (
        accessibility is not None
        and accessibility().contrastPreference() == Qt.ContrastPreference.HighContrast
    )


def on_contrast_changed(hints: QStyleHints, callback: Callable[[], object]) -> None:
    """Register a callback for changes of the system's contrast preference, if Qt reports them."""
    accessibility = getattr(hints, "accessibility", None)
    if accessibility is not None:
        accessibility().contrastPreferenceChanged.connect(callback)


def prefers_reduced_motion(platform: str = sys.platform) -> bool:
    """Return True if the system requests reduced motion; False where programs can't query it."""
    if platform != "win32":
        return False
    is_animation_enabled = ctypes.c_int(1)
    user32 = getattr(ctypes, "windll").user32  # noqa: B009  mypy knows that it exists only on Windows
    has_succeeded = user32.SystemParametersInfoW(
        SPI_GETCLIENTAREAANIMATION, 0, ctypes.byref(is_animation_enabled), 0
    )
    return bool(has_succeeded) and is_animation_enabled.value == 0
