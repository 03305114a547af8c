"""What the system asks of every program's look: strong contrast and little motion, where it tells."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from typing import Literal

from PySide6.QtCore import Qt
from PySide6.QtGui import QStyleHints

Preference = Literal["system", "on", "off"]
PREFERENCES: tuple[Preference, ...] = ("system", "on", "off")
CLIENT_AREA_ANIMATION = 0x1042  # SPI_GETCLIENTAREAANIMATION of Windows


def preference_of(kept: object) -> Preference:
    """A wish from the settings; those of older versions were only on or off."""
    if isinstance(kept, bool):
        return "on" if kept else "system"
    return next((wish for wish in PREFERENCES if wish == kept), "system")


def wants_contrast(hints: QStyleHints) -> bool:
    """Whether the system asks for strong contrast; False where Qt can't tell."""
    asked = getattr(hints, "accessibility", None)
    return asked is not None and asked().contrastPreference() == Qt.ContrastPreference.HighContrast


def on_contrast(hints: QStyleHints, call: Callable[[], object]) -> None:
    """Call when the system's wish for contrast changes, where Qt can tell."""
    asked = getattr(hints, "accessibility", None)
    if asked is not None:
        asked().contrastPreferenceChanged.connect(call)


def wants_less_motion(platform: str = sys.platform) -> bool:
    """Whether the system asks for little motion; False where it does not tell programs like this one."""
    if platform != "win32":
        return False
    animated = ctypes.c_int(1)
    user32 = getattr(ctypes, "windll").user32  # noqa: B009  there is none elsewhere, and mypy knows
    told = user32.SystemParametersInfoW(CLIENT_AREA_ANIMATION, 0, ctypes.byref(animated), 0)
    return bool(told) and animated.value == 0
