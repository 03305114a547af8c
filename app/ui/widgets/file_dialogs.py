"""Which file? The system's dialogs ask it where they are; Stop stays free meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QWidget

from app.core.documents.file_format import SUFFIX
from nep.i18n import _


class FileDialogs(Protocol):
    """Asks a person for a file; ``take`` is called with the answer, never when the person gives up."""

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which file to open."""

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        """Where to save."""


def show_free(dialog: QFileDialog) -> None:
    """Show a dialog that leaves Stop free: the window can be used, and Stop's keys work in the dialog too.

    Qt's own dialog, not the system's: keys that are pressed there never come to us, and some of them block.
    """
    dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.setWindowModality(Qt.WindowModality.NonModal)
    dialog.show()
    dialog.activateWindow()  # the keys go there, also where no window manager sees to it


class SystemDialogs:
    """The system's own file dialogs: of Windows, of macOS, of a Linux desktop by its portal.

    The window can be used meanwhile: Stop is pressed there. Keys that are pressed in them never come to us.
    """

    def __init__(self, window: QWidget) -> None:
        self._window = window

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Open a behaviour"), folder, take)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog(_("Save the behaviour"), str(Path(suggestion).parent), take)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(SUFFIX.lstrip("."))
        dialog.selectFile(Path(suggestion).name)
        dialog.show()

    def _dialog(self, title: str, folder: str, take: Callable[[Path], None]) -> QFileDialog:
        kind = _("Behaviours")
        dialog = QFileDialog(self._window, title, folder, f"{kind} (*{SUFFIX})")
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowModality(Qt.WindowModality.NonModal)
        dialog.fileSelected.connect(lambda chosen: take(Path(chosen)))
        return dialog
