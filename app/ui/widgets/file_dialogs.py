"""Which file? The system's dialogs ask it where they are; Stop stays free meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QStandardPaths, Qt
from PySide6.QtWidgets import QFileDialog, QWidget

from app.core.documents.file_format import SUFFIX
from nep.i18n import _, lazy


@dataclass(frozen=True)
class FileKind:
    """As what something is saved: in words, which `lazy` marks, and by the ending of its name."""

    words: str
    ending: str


def meant(chosen: Path, kind: FileKind, kinds: Sequence[FileKind]) -> tuple[Path, FileKind]:
    """The whole name, and as what: an ending that was typed counts for more than the kind that was chosen."""
    ending = chosen.suffix.lower()
    if ending != kind.ending:
        typed = next((each for each in kinds if each.ending == ending), None)
        return (chosen, typed) if typed is not None else (chosen.with_name(chosen.name + kind.ending), kind)
    return chosen, kind


class FileDialogs(Protocol):
    """Asks a person for a file; ``take`` is called with the answer, never when the person gives up."""

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which file to open."""

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        """Where to save."""

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        take: Callable[[Path, FileKind], None],
    ) -> None:
        """Where to save something that is no behaviour, and as which of these; the path has its ending."""

    def open_picture(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which picture; "" for the folder where this computer keeps pictures."""

    def open_recording(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which recording to play."""

    def open_layout(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which layout to show."""

    def choose_folder(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which folder."""


PICTURE_ENDINGS = (".png", ".jpg", ".jpeg")


def pictures_folder() -> str:
    """Where this computer keeps pictures; the person's own folder where it has no such place."""
    place = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.PicturesLocation)
    return place if place and Path(place).is_dir() else str(Path.home())


BEHAVIOURS = (lazy("Behaviours"), f"*{SUFFIX}")
RECORDINGS = (lazy("Recordings"), "*.mcap")
LAYOUTS = (lazy("Layouts"), "*.nep-layout")
PICTURES = (lazy("Images"), " ".join(f"*{ending}" for ending in PICTURE_ENDINGS))
"""What a dialog offers, in words, and the patterns of the names."""


class SystemDialogs:
    """The system's own file dialogs: of Windows, of macOS, of a Linux desktop by its portal.

    The window can be used meanwhile: Stop is pressed there. Keys that are pressed in them never come to us.
    """

    def __init__(self, window: QWidget) -> None:
        self._window = window

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a behaviour"), folder, take, BEHAVIOURS)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Save behaviour"), str(Path(suggestion).parent), take, BEHAVIOURS)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(SUFFIX.lstrip("."))
        dialog.selectFile(Path(suggestion).name)
        dialog.show()

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        take: Callable[[Path, FileKind], None],
    ) -> None:
        offered = {f"{_(kind.words)} (*{kind.ending})": kind for kind in kinds}

        def chosen(path: Path) -> None:
            take(*meant(path, offered.get(dialog.selectedNameFilter(), kinds[0]), kinds))

        dialog = self._dialog(title, str(suggestion.parent), chosen)
        dialog.setNameFilters(list(offered))
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(kinds[0].ending.lstrip("."))
        dialog.filterSelected.connect(
            lambda words: dialog.setDefaultSuffix(offered[words].ending.lstrip("."))
        )
        dialog.selectFile(suggestion.name)
        dialog.show()

    def open_picture(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Choose an image"), folder or pictures_folder(), take, PICTURES)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def open_recording(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a recording"), folder, take, RECORDINGS)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def open_layout(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a layout"), folder, take, LAYOUTS)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def choose_folder(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Choose a folder"), folder, take)
        dialog.setFileMode(QFileDialog.FileMode.Directory)
        dialog.show()

    def _dialog(
        self, title: str, folder: str, take: Callable[[Path], None], kind: tuple[str, str] | None = None
    ) -> QFileDialog:
        offered = f"{_(kind[0])} ({kind[1]})" if kind is not None else ""
        dialog = QFileDialog(self._window, title, folder, offered)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowModality(Qt.WindowModality.NonModal)
        dialog.fileSelected.connect(lambda chosen: take(Path(chosen)))
        return dialog
