"""What of the window comes back at the next start: its place, its layouts, theme and size of text."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping

from PySide6.QtCore import QByteArray, QSize, Qt
from PySide6.QtWidgets import QMainWindow

from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.ui.theme.system import preference_of
from app.ui.theme.theme import MODES, Mode, Theme

Saved = dict[str, object]
FRAME = QSize(16, 48)  # what a window manager puts around a window, about


def fitting(size: QSize, room: QSize) -> QSize:
    """The size of a first window where a screen has this room: on a small screen Stop would be beside it."""
    fits = size.width() <= room.width() and size.height() <= room.height()
    return size if fits else size.boundedTo(room - FRAME)


class WindowState:
    """Reads and writes what concerns the window: place, layouts, theme, size of text, motion, contrast."""

    def __init__(self, settings: Settings, complain: Callable[[str], object]) -> None:
        """``complain`` is told, in a sentence, what can't be kept."""
        self._settings = settings
        self._complain = complain
        self._said = ""

    def apply_theme(self, theme: Theme) -> None:
        """Give the theme what was chosen before; it is applied once."""
        chosen = self._settings.get("theme", "system")
        mode: Mode = next((mode for mode in MODES if mode == chosen), "system")
        motion = preference_of(self._settings.get("less_motion", None))
        contrast = preference_of(self._settings.get("high_contrast", None))
        theme.begin(mode, self._settings.get("text_percent", 100), motion, contrast)

    def keep_theme(self, theme: Theme) -> None:
        """Keep what is chosen now."""
        self._set("theme", theme.mode)
        self._set("text_percent", theme.text_percent)
        self._set("less_motion", theme.motion)
        self._set("high_contrast", theme.contrast)

    def keep(self, key: str, value: object) -> None:
        """Keep anything that JSON can say."""
        self._set(key, value)

    def place(self, window: QMainWindow) -> bool:
        """Put the window where it was; False when it was nowhere yet."""
        text = self._settings.get("window", "")
        try:
            data = base64.b64decode(text, validate=True)
        except (binascii.Error, ValueError):
            return False
        placed = bool(data) and window.restoreGeometry(QByteArray(data))
        if window.isFullScreen():  # only the large room fills the screen, and it is not there at a start
            window.setWindowState(window.windowState() & ~Qt.WindowState.WindowFullScreen)
        return placed

    def keep_place(self, window: QMainWindow) -> None:
        """Keep where the window is."""
        self._set("window", base64.b64encode(window.saveGeometry().data()).decode("ascii"))

    @property
    def layout(self) -> str:
        """The layout that showed last; "start" for the start page, also when Studio never ran before."""
        return self._settings.get("layout", "start")

    def keep_layout(self, name: str) -> None:
        """Keep which layout shows."""
        self._set("layout", name)

    def layouts(self) -> Mapping[str, object]:
        """Everything that is kept about layouts, by name."""
        kept: Saved = self._settings.get("layouts", {})
        return kept

    def of_layout(self, name: str) -> Mapping[str, object]:
        """What a layout looked like; empty when it never showed."""
        found = self.layouts().get(name)
        return found if isinstance(found, Mapping) else {}

    def forget_layout(self, name: str) -> bool:
        """Keep nothing about a layout any more; False when it is there again at the next start."""
        return self._set("layouts", {key: value for key, value in self.layouts().items() if key != name})

    def chosen(self, base: str) -> str:
        """The name of the own layout that a built-in one's workbench showed last; "" for none."""
        kept: Saved = self._settings.get("chosen_layouts", {})
        name = kept.get(base)
        return name if isinstance(name, str) else ""

    def keep_chosen(self, base: str, name: str) -> None:
        """Keep which own layout a workbench shows."""
        kept: Saved = self._settings.get("chosen_layouts", {})
        self._set("chosen_layouts", {**kept, base: name})

    def keep_layouts(self, found: Mapping[str, Mapping[str, object]]) -> bool:
        """Keep what these layouts look like now; False when they are forgotten at the end."""
        return self._set("layouts", {**self.layouts(), **found})

    def _set(self, key: str, value: object) -> bool:
        try:
            self._settings.set(key, value)
        except SettingsError as error:
            if str(error) != self._said:  # a line for each of the many things that are kept helps nobody
                self._said = str(error)
                self._complain(self._said)
            return False
        self._said = ""
        return True
