"""Which file? The system's own dialogs ask it, the only ones there are; Stop stays free meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QWidget

from app.core.behaviour_file import SUFFIX

FILTER = f"Behaviours (*{SUFFIX})"


class Asks(Protocol):
    """Asks a person for a file; ``take`` is called with the answer, never when the person gives up."""

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        """Which file to open."""

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        """Where to save."""


class SystemDialogs:
    """The system's own file dialogs, not blocking the window."""

    def __init__(self, window: QWidget) -> None:
        self._window = window

    def _show(self, dialog: QFileDialog) -> None:
        """Show a dialog that leaves Stop free: the window can be used, and F12 works in the dialog too."""
        everywhere = Qt.ShortcutContext.ApplicationShortcut
        dialog.addActions([act for act in self._window.actions() if act.shortcutContext() == everywhere])
        dialog.setWindowModality(Qt.WindowModality.NonModal)
        dialog.show()
        dialog.activateWindow()  # the keys go there, also where no window manager sees to it

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog("Open a behaviour", folder, take)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        self._show(dialog)

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        dialog = self._dialog("Save the behaviour", str(Path(suggestion).parent), take)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix(SUFFIX.lstrip("."))
        dialog.selectFile(Path(suggestion).name)
        self._show(dialog)

    def _dialog(self, title: str, folder: str, take: Callable[[Path], None]) -> QFileDialog:
        dialog = QFileDialog(self._window, title, folder, FILTER)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(lambda chosen: take(Path(chosen)))
        return dialog
