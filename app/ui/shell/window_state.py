"""Settings of the window that persist: position, layouts, theme and text size."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping

from PySide6.QtCore import QByteArray, QSize, Qt
from PySide6.QtWidgets import QMainWindow

from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.ui.theme.system import parse_preference
from app.ui.theme.theme import MODES, Mode, Theme

Saved = dict[str, object]
FRAME = QSize(16, 48)  # approximate size of a window manager's frame


def initial_size(size: QSize, room: QSize) -> QSize:
    """Return the initial window size for a screen. On a small screen Stop would otherwise be outside it."""
    fits = size.width() <= room.width() and size.height() <= room.height()
    return size if fits else size.boundedTo(room - FRAME)


class WindowState:
    """Loads and saves position, layouts, theme, text size, motion and contrast of the window."""

    def __init__(self, settings: Settings, complain: Callable[[str], object]) -> None:
        # `complain` is called with a sentence if settings can't be saved.
        self._settings = settings
        self._complain = complain
        self._said = ""

    def apply_theme(self, theme: Theme) -> None:
        """Apply all saved settings to the theme at once."""
        chosen = self._settings.get("theme", "system")
        mode: Mode = next((mode for mode in MODES if mode == chosen), "system")
        motion = parse_preference(self._settings.get("less_motion", None))
        contrast = parse_preference(self._settings.get("high_contrast", None))
        theme.apply_settings(mode, self._settings.get("text_percent", 100), motion, contrast)

    def save_theme(self, theme: Theme) -> None:
        """Save the current settings of the theme."""
        self._set("theme", theme.mode)
        self._set("text_percent", theme.text_percent)
        self._set("less_motion", theme.motion)
        self._set("high_contrast", theme.contrast)

    def save(self, key: str, value: object) -> None:
        """Save a setting, as JSON value."""
        self._set(key, value)

    def restore_geometry(self, window: QMainWindow) -> bool:
        """Restore the position of the window. Return False if none is saved."""
        text = self._settings.get("window", "")
        try:
            data = base64.b64decode(text, validate=True)
        except (binascii.Error, ValueError):
            return False
        placed = bool(data) and window.restoreGeometry(QByteArray(data))
        if window.isFullScreen():  # only the robot's room uses full screen, and it isn't shown at startup
            window.setWindowState(window.windowState() & ~Qt.WindowState.WindowFullScreen)
        return placed

    def save_geometry(self, window: QMainWindow) -> None:
        """Save the window's position."""
        self._set("window", base64.b64encode(window.saveGeometry().data()).decode("ascii"))

    @property
    def layout(self) -> str:
        """Name of the last layout; "start" for the start page, or before the first start."""
        return self._settings.get("layout", "start")

    def save_layout(self, name: str) -> None:
        """Save the name of the current layout."""
        self._set("layout", name)

    def layouts(self) -> Mapping[str, object]:
        """Return all saved layouts by name."""
        kept: Saved = self._settings.get("layouts", {})
        return kept

    def layout_state(self, name: str) -> Mapping[str, object]:
        """Return the saved state of a layout; empty if there is none."""
        found = self.layouts().get(name)
        return found if isinstance(found, Mapping) else {}

    def delete_layout(self, name: str) -> bool:
        """Delete the saved state of a layout; return False if that couldn't be saved."""
        return self._set("layouts", {key: value for key, value in self.layouts().items() if key != name})

    def selected_layout(self, base: str) -> str:
        """Return the name of the custom layout last shown in a built-in layout's workbench, or ""."""
        kept: Saved = self._settings.get("chosen_layouts", {})
        name = kept.get(base)
        return name if isinstance(name, str) else ""

    def save_selected_layout(self, base: str, name: str) -> None:
        """Save the name of the custom layout shown in a workbench."""
        kept: Saved = self._settings.get("chosen_layouts", {})
        self._set("chosen_layouts", {**kept, base: name})

    def save_layouts(self, found: Mapping[str, Mapping[str, object]]) -> bool:
        """Save the states of layouts. Return False on failure."""
        return self._set("layouts", {**self.layouts(), **found})

    def _set(self, key: str, value: object) -> bool:
        try:
            self._settings.set(key, value)
        except SettingsError as error:
            if str(error) != self._said:  # report an error only once, because settings are saved often
                self._said = str(error)
                self._complain(self._said)
            return False
        self._said = ""
        return True
