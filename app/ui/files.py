"""Opening, saving and putting back behaviours; nothing is lost, so nothing asks."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, runtime_checkable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QWidget

from app.blocks.mend import mend
from app.core.behaviour_file import SUFFIX
from app.core.journal import Unsaved
from app.core.session import Session
from app.core.settings import home
from app.errors import AppError, SettingsError

FILTER = f"Behaviours (*{SUFFIX})"


@runtime_checkable
class Flushes(Protocol):
    """A panel that may hold an edit which the document has not seen yet."""

    def flush(self, done: Callable[[], None]) -> None:
        """Call ``done`` once the newest edit is in the document."""


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


def kept_path(folder: Path, name: str, now_s: float) -> Path:
    """A free file name in ``folder`` for work that never had one."""
    plain = "".join(c if c.isalnum() or c in " -_" else "_" for c in name).strip() or "behaviour"
    stamp = time.strftime("%Y-%m-%d %H.%M.%S", time.localtime(now_s))
    path = folder / f"{plain} {stamp}{SUFFIX}"
    number = 2
    while path.exists():
        path = folder / f"{plain} {stamp} {number}{SUFFIX}"
        number += 1
    return path


class Files:
    """The document's files. ``say`` is the toast, ``shown`` is called when another document shows."""

    def __init__(
        self,
        session: Session,
        asks: Asks,
        say: Callable[[str], object],
        shown: Callable[[], object],
        editor: Callable[[], object],
        clock: Callable[[], float] = time.time,
    ) -> None:
        """``editor`` gives the behaviour panel, or None while there is none."""
        self._session, self._asks, self._say, self._shown = session, asks, say, shown
        self._editor, self._clock = editor, clock

    def new(self) -> None:
        """Begin an empty behaviour."""
        self.with_newest(lambda: self._replace(self._session.document.new))

    def ask_open(self) -> None:
        """Let a person choose a file and open it."""
        path = self._session.document.path
        self._asks.open(str(path.parent if path is not None else Path.home()), self.open)

    def open(self, path: Path) -> None:
        """Open a behaviour file; what is wrong with it becomes an alert."""

        def opened() -> None:
            self._session.document.open(path)
            self._remember(path)

        self.with_newest(lambda: self._replace(opened, path))

    def example(self, path: Path) -> None:
        """Open an example as a new behaviour."""
        self.with_newest(lambda: self._replace(lambda: self._session.document.example(path), path))

    def recover(self, unsaved: Unsaved) -> None:
        """Put back what a Studio that died left behind."""
        self.with_newest(lambda: self._replace(lambda: self._session.document.recover(unsaved)))

    def save(self) -> None:
        """Save, or ask where when the behaviour has no file yet."""
        if self._session.document.path is None:
            self.save_as()
        else:
            self.with_newest(lambda: self._save(None))

    def save_as(self) -> None:
        """Ask where, then save there."""
        document = self._session.document
        folder = document.path.parent if document.path is not None else Path.home()
        suggestion = str(folder / f"{document.name}{SUFFIX}")
        self._asks.save(suggestion, lambda path: self.with_newest(lambda: self._save(path)))

    def mend(self, action: str) -> bool:
        """Change the blocks as a problem's button says; False when it says nothing about blocks."""
        document = self._session.document
        if mend(document.workspace, action) is None:
            return False

        def change() -> None:
            made = mend(document.workspace, action)
            if made is not None:
                document.edited(made)
                document.revision += 1

        self.with_newest(change)
        return True

    def with_newest(self, then: Callable[[], None]) -> None:
        """Do something once the editor's newest edit is in the document."""
        editor = self._editor()
        if isinstance(editor, Flushes):
            editor.flush(then)
        else:
            then()

    def _save(self, path: Path | None) -> None:
        document = self._session.document
        try:
            document.save(path)
        except AppError as error:
            self._complain(str(error), "file.save_as", "Save somewhere else")
            return
        self._session.alerts.cure("file")
        if document.path is not None:
            self._remember(document.path)
        self._say(f"Saved {document.name}")

    def _replace(self, act: Callable[[], None], path: Path | None = None) -> None:
        """Show another document; unsaved work is put where Recent finds it."""
        if not self._keep():
            return
        try:
            act()
        except AppError as error:
            name = path.name if path is not None else "the file"
            self._complain(f"{name} can't be opened: {error}", "file.open", "Open another file")
            return
        self._session.alerts.cure("file")
        self._shown()

    def _keep(self) -> bool:
        document = self._session.document
        if not document.dirty:
            return True
        had_file, name = document.path is not None, document.name
        path = document.path or kept_path(home() / "kept", document.name, self._clock())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            document.save(None if had_file else path)
        except (AppError, OSError) as error:
            self._complain(str(error), "file.save_as", "Save somewhere else")
            return False
        self._remember(path, name)
        self._say(f"Saved {name}" if had_file else f"Kept {name} in Recent")
        return True

    def _remember(self, path: Path, name: str | None = None) -> None:
        try:
            self._session.settings.add_recent(path, name or self._session.document.name)
        except SettingsError as error:
            self._session.console.add("warn", "studio", str(error))

    def _complain(self, sentence: str, action: str, button: str) -> None:
        title = sentence[:1].upper() + sentence[1:].rstrip(".") + "."
        self._session.alerts.put("file", "error", title, button=button, action=action)
