"""File dialogs, which are non-modal so that Stop stays accessible. Native ones are used where available."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QStandardPaths, Qt
from PySide6.QtWidgets import QFileDialog, QWidget

from app.core.projects.file_format import SUFFIX
from nep.i18n import _, lazy


@dataclass(frozen=True)
class FileKind:
    """Type of file that can be saved.

    Attributes:
        label: Description of the type, wrapped in `lazy`.
        suffix: File extension with its dot.
    """

    label: str
    suffix: str


def resolve_kind(path: Path, kind: FileKind, kinds: Sequence[FileKind]) -> tuple[Path, FileKind]:
    """Return the path with a file extension, and the type of the file to save.

    An extension that was typed takes precedence over the selected type.

    Args:
        path: Path that was entered.
        kind: Selected type.
        kinds: Types that were offered.
    """
    suffix = path.suffix.lower()
    if suffix != kind.suffix:
        typed_kind = next((each for each in kinds if each.suffix == suffix), None)
        if typed_kind is None:
            return path.with_name(path.name + kind.suffix), kind
        return path, typed_kind
    return path, kind


class FileDialogs(Protocol):
    """Interface of dialogs that ask for a file.

    Each method calls its `callback` with the path, or doesn't call it on cancel.
    """

    def open(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a behaviour to open."""

    def save(self, suggestion: str, callback: Callable[[Path], None]) -> None:
        """Ask for the folder and name to save a behaviour."""

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        callback: Callable[[Path, FileKind], None],
    ) -> None:
        """Ask for folder, name and type to save a file other than a behaviour.

        Args:
            title: Title of the dialog.
            suggestion: Suggested path, without extension.
            kinds: Types that are offered.
            callback: Called with the path, which has the extension of the type, and the type.
        """

    def open_picture(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for an image file, starting in a folder or, for "", in the user's picture folder."""

    def open_recording(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a recording to open."""

    def open_layout(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a layout file to import."""

    def select_folder(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Ask for a folder."""


PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")


def pictures_folder() -> str:
    """Return the user's picture folder, or the home folder if there is none."""
    folder = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.PicturesLocation)
    return folder if folder and Path(folder).is_dir() else str(Path.home())


BEHAVIOUR_FILTER = (lazy("Behaviours"), f"*{SUFFIX}")
RECORDING_FILTER = (lazy("Recordings"), "*.mcap")
LAYOUT_FILTER = (lazy("Layouts"), "*.nep-layout")
PICTURE_FILTER = (lazy("Images"), " ".join(f"*{ending}" for ending in PICTURE_SUFFIXES))
"""Name filter for images in file dialogs, as label and patterns."""


class SystemDialogs:
    """Native file dialogs of Windows, macOS, or a Linux desktop with the portal.

    The window stays usable while a dialog is open, for example for Stop. Keys pressed in the dialog
    don't reach Studio.
    """

    def __init__(self, window: QWidget) -> None:
        self._window = window

    def open(self, folder: str, callback: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a behaviour"), folder, callback, BEHAVIOUR_FILTER)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def save(self, suggestion: str, callback: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Save behaviour"), str(Path(suggestion).parent), callback, BEHAVIOUR_FILTER)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(SUFFIX.lstrip("."))
        dialog.selectFile(Path(suggestion).name)
        dialog.show()

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        callback: Callable[[Path, FileKind], None],
    ) -> None:
        kinds_by_filter = {f"{_(kind.label)} (*{kind.suffix})": kind for kind in kinds}

        def take_path(path: Path) -> None:
            callback(*resolve_kind(path, kinds_by_filter.get(dialog.selectedNameFilter(), kinds[0]), kinds))

        dialog = self._dialog(title, str(suggestion.parent), take_path)
        dialog.setNameFilters(list(kinds_by_filter))
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(kinds[0].suffix.lstrip("."))
        dialog.filterSelected.connect(
            lambda name_filter: dialog.setDefaultSuffix(kinds_by_filter[name_filter].suffix.lstrip("."))
        )
        dialog.selectFile(suggestion.name)
        dialog.show()

    def open_picture(self, folder: str, callback: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Choose an image"), folder or pictures_folder(), callback, PICTURE_FILTER)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def open_recording(self, folder: str, callback: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a recording"), folder, callback, RECORDING_FILTER)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def open_layout(self, folder: str, callback: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a layout"), folder, callback, LAYOUT_FILTER)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def select_folder(self, folder: str, callback: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Choose a folder"), folder, callback)
        dialog.setFileMode(QFileDialog.FileMode.Directory)
        dialog.show()

    def _dialog(
        self, title: str, folder: str, callback: Callable[[Path], None], kind: tuple[str, str] | None = None
    ) -> QFileDialog:
        name_filter = f"{_(kind[0])} ({kind[1]})" if kind is not None else ""
        dialog = QFileDialog(self._window, title, folder, name_filter)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowModality(Qt.WindowModality.NonModal)
        dialog.fileSelected.connect(lambda path: callback(Path(path)))
        return dialog
