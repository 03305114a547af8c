"""Studio's file dialogs, which share one sheet that is created on first use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtWidgets import QWidget

from app.core.storage.folders import home
from app.core.storage.settings import RecentFile, Settings
from app.ui.shell.dialogs.file_sheet import FileQuestion, FileSheet, FolderLocation, known_locations
from app.ui.theme.theme import Theme
from app.ui.widgets.file_dialogs import LAYOUT_FILTER, FileKind, pictures_folder
from nep.i18n import lazy

RECORDING_QUESTION = FileQuestion(
    lazy("Open a recording"), lazy("Open"), lazy("No recordings or folders here."),
    suffixes=(".mcap",), icon="film",
)  # fmt: skip
LAYOUT_QUESTION = FileQuestion(
    lazy("Open a layout"), lazy("Open"), lazy("No layouts or folders here."),
    suffixes=(LAYOUT_FILTER[1].lstrip("*"),), icon="layout-panel-left",
)  # fmt: skip


class StudioDialogs:
    """Implementation of `FileDialogs` with a `FileSheet`."""

    def __init__(self, theme: Theme, window: QWidget, settings: Settings) -> None:
        self._theme, self._window, self._settings = theme, window, settings
        self._sheet: FileSheet | None = None

    def open(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a behaviour to open."""
        self._get_sheet().ask_open(Path(folder or Path.home()), callback)

    def save(self, suggestion: str, callback: Callable[[Path], None]) -> None:
        """Ask for the folder and name to save a behaviour."""
        self._get_sheet().ask_save(Path(suggestion), callback)

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        callback: Callable[[Path, FileKind], None],
    ) -> None:
        """Ask for folder, name and format to save a file other than a behaviour."""
        self._get_sheet().ask_save_as(title, suggestion, kinds, callback)

    def open_picture(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for an image file."""
        self._get_sheet().ask_picture(Path(folder or pictures_folder()), callback)

    def open_recording(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a recording to open."""
        self._get_sheet().ask_open(_nearest_folder(folder), callback, RECORDING_QUESTION)

    def open_layout(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a layout file to import."""
        self._get_sheet().ask_open(_nearest_folder(folder), callback, LAYOUT_QUESTION)

    def select_folder(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a folder."""
        self._get_sheet().ask_folder(_nearest_folder(folder), callback)

    def _get_sheet(self) -> FileSheet:
        if self._sheet is None:
            self._sheet = FileSheet(self._theme, self._window, self._locations)
        return self._sheet

    def _locations(self) -> tuple[FolderLocation, ...]:
        recent: list[RecentFile] = self._settings.recent_files
        return known_locations(home() / "kept", [file.path for file in recent])


def _nearest_folder(folder: str) -> Path:
    # Nearest existing ancestor of a missing folder.
    path = Path(folder)
    return next((each for each in (path, *path.parents) if each.is_dir()), Path.home())
