"""Persistent state of the window: position, layouts and theme."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping
from typing import TypeVar

from PySide6.QtCore import QByteArray, QSize, Qt
from PySide6.QtWidgets import QMainWindow

from app.core.storage.setting import Setting
from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.ui.theme.theme import Theme

T = TypeVar("T")
FRAME_SIZE = QSize(16, 48)  # approximate size of a window manager's frame


def initial_size(size: QSize, room: QSize) -> QSize:
    """Return the initial size of the window, reduced if it doesn't fit the screen.

    Otherwise Stop could be outside a small screen.

    Args:
        size: Preferred size.
        room: Available size of the screen.
    """
    fits = size.width() <= room.width() and size.height() <= room.height()
    return size if fits else size.boundedTo(room - FRAME_SIZE)


class WindowState:
    """Accessor for the settings of the window: position, layouts, theme, text size, motion and contrast."""

    def __init__(self, settings: Settings, report_error: Callable[[str], object]) -> None:
        # `report_error` is called with a message if settings can't be saved.
        self._settings = settings
        self._report_error = report_error
        self._reported_error = ""

    def apply_theme(self, theme: Theme) -> None:
        """Apply the saved mode, text size, motion and contrast to the theme in one update."""
        settings = self._settings
        theme.apply_settings(settings.theme, settings.text_percent, settings.motion, settings.contrast)

    def keep_theme_updated(self, theme: Theme) -> None:
        """Apply later changes of mode, text size, motion and contrast to the theme."""
        self._settings.on_change(Settings.theme, theme.set_mode)
        self._settings.on_change(Settings.text_percent, theme.set_text_percent)
        self._settings.on_change(Settings.motion, theme.set_motion)
        self._settings.on_change(Settings.contrast, theme.set_contrast)

    def restore_geometry(self, window: QMainWindow) -> bool:
        """Restore position and size of the window; return False if none are saved or they are invalid."""
        text = self._settings.window_geometry
        try:
            data = base64.b64decode(text, validate=True)
        except (binascii.Error, ValueError):
            return False
        is_restored = bool(data) and window.restoreGeometry(QByteArray(data))
        if window.isFullScreen():  # only the robot's room uses full screen, and it isn't shown at startup
            window.setWindowState(window.windowState() & ~Qt.WindowState.WindowFullScreen)
        return is_restored

    def save_geometry(self, window: QMainWindow) -> None:
        """Save position and size of the window."""
        self.save(Settings.window_geometry, base64.b64encode(window.saveGeometry().data()).decode("ascii"))

    @property
    def layout(self) -> str:
        """Name of the last layout; "start" for the start page and before the first start."""
        return self._settings.layout

    def save_layout(self, name: str) -> None:
        """Save the name of the current layout."""
        self.save(Settings.layout, name)

    def layouts(self) -> Mapping[str, object]:
        """Return the saved arrangements of all layouts, by name."""
        return self._settings.layouts

    def layout_state(self, name: str) -> Mapping[str, object]:
        """Return the saved arrangement of a layout; empty if there is none."""
        state = self.layouts().get(name)
        return state if isinstance(state, Mapping) else {}

    def delete_layout(self, name: str) -> bool:
        """Delete the saved arrangement of a layout; return False if the settings can't be saved."""
        return self.save(
            Settings.layouts, {key: value for key, value in self.layouts().items() if key != name}
        )

    def selected_layout(self, base: str) -> str:
        """Return the name of the custom layout that a workbench showed last, or "" for the built-in one.

        Args:
            base: Name of the workbench's built-in layout.
        """
        name = self._settings.selected_layouts.get(base)
        return name if isinstance(name, str) else ""

    def save_selected_layout(self, base: str, name: str) -> None:
        """Save the name of the custom layout that a workbench shows.

        Args:
            base: Name of the workbench's built-in layout.
            name: Name of the custom layout, or "" for the built-in one.
        """
        self.save(Settings.selected_layouts, {**self._settings.selected_layouts, base: name})

    def save_layouts(self, layouts: Mapping[str, Mapping[str, object]]) -> bool:
        """Save arrangements of layouts, by name; return False if the settings can't be saved."""
        return self.save(Settings.layouts, {**self.layouts(), **layouts})

    def save(self, setting: Setting[T], value: T) -> bool:
        """Save a setting; report an error once and return False if it can't be saved."""
        try:
            self._settings.set_value(setting, value)
        except SettingsError as error:
            if (
                str(error) != self._reported_error
            ):  # report an error only once, because settings are saved often
                self._reported_error = str(error)
                self._report_error(self._reported_error)
            return False
        self._reported_error = ""
        return True
