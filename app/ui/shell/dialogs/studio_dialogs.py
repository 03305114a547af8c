"""Studio's own answers to "Which file?": each question is asked by one sheet, made at the first of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtWidgets import QWidget

from app.core.storage.settings import RecentFile, Settings, home
from app.ui.shell.dialogs.file_sheet import FileQuestion, FileSheet, FolderPlace, known_places
from app.ui.theme.theme import Theme
from app.ui.widgets.file_dialogs import LAYOUTS, FileKind, pictures_folder
from nep.i18n import lazy

RECORDING = FileQuestion(
    lazy("Open a recording"), lazy("Open"), lazy("No recordings or folders here."),
    endings=(".mcap",), icon="film",
)  # fmt: skip
LAYOUT = FileQuestion(
    lazy("Open a layout"), lazy("Open"), lazy("No layouts or folders here."),
    endings=(LAYOUTS[1].lstrip("*"),), icon="layout-panel-left",
)  # fmt: skip


class StudioDialogs:
    """Asks for files by our own sheet, which is made at the first question."""

    def __init__(self, theme: Theme, window: QWidget, settings: Settings) -> None:
        self._theme, self._window, self._settings = theme, window, settings
        self._sheet: FileSheet | None = None

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which file to open."""
        self._made().ask_open(Path(folder or Path.home()), take)

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        """Where to save."""
        self._made().ask_save(Path(suggestion), take)

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        take: Callable[[Path, FileKind], None],
    ) -> None:
        """Where to save something that is no behaviour, and as what."""
        self._made().ask_save_as(title, suggestion, kinds, take)

    def open_picture(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which picture to take."""
        self._made().ask_picture(Path(folder or pictures_folder()), take)

    def open_recording(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which recording to play."""
        self._made().ask_open(_nearest(folder), take, RECORDING)

    def open_layout(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which layout to show."""
        self._made().ask_open(_nearest(folder), take, LAYOUT)

    def choose_folder(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which folder to keep pictures in."""
        self._made().ask_folder(_nearest(folder), take)

    def _made(self) -> FileSheet:
        if self._sheet is None:
            self._sheet = FileSheet(self._theme, self._window, self._places)
        return self._sheet

    def _places(self) -> tuple[FolderPlace, ...]:
        recent: list[RecentFile] = self._settings.recent
        return known_places(home() / "kept", [file.path for file in recent])


def _nearest(folder: str) -> Path:
    """The folder, or the nearest one above it that there is."""
    wanted = Path(folder)
    return next((each for each in (wanted, *wanted.parents) if each.is_dir()), Path.home())
