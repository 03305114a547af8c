"""Opening, saving, closing and putting back behaviours; nothing is lost, so nothing asks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QWidget

from app.blocks.mend import mend
from app.core import deep_json
from app.core.behaviour_file import SUFFIX
from app.core.document import Document
from app.core.journal import Unsaved
from app.core.session import Session
from app.core.settings import home
from app.errors import AppError, DocumentError, SettingsError

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
    """The open behaviours' files. ``say`` is the toast, ``shown`` is called when another one shows."""

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
        self._documents = session.documents
        self._editor, self._clock = editor, clock

    def new(self) -> None:
        """Begin an empty behaviour in a tab of its own."""
        self.with_newest(lambda: self._show(self._documents.new))

    def ask_open(self) -> None:
        """Let a person choose a file and open it."""
        self._session.alerts.cure("strange")
        path = self._session.document.path
        self._asks.open(str(path.parent if path is not None else Path.home()), self.open)

    def open(self, path: Path) -> None:
        """Open a behaviour file in a tab; what is wrong with it becomes an alert."""

        def opened() -> None:
            self._documents.open(path)
            self._remember(path)

        self.with_newest(lambda: self._show(opened))

    def open_all(self, paths: Sequence[Path]) -> None:
        """Open files that came from outside: the command line, a drop, another start.

        Those that are no behaviours become one alert, the others open.
        """
        self._session.alerts.cure("strange")
        strange = [path for path in paths if path.suffix.lower() != SUFFIX]
        for path in paths:
            if path not in strange:
                self.open(path)
        if strange:
            self._complain(strange_words(strange), "file.open", "Open another file", alert="strange")

    def example(self, path: Path) -> None:
        """Open an example as a new behaviour."""
        self.with_newest(lambda: self._show(lambda: self._documents.example(path)))

    def recover(self, left: Sequence[Unsaved]) -> None:
        """Put back what a Studio that died left behind, each in its tab."""

        def put_back() -> None:
            for unsaved in left:
                self._documents.recover(unsaved)

        self.with_newest(lambda: self._show(put_back))

    def close(self, document: Document) -> None:
        """Close a tab. Its program is stopped; unsaved work goes to its file, or where Recent finds it."""

        def closed() -> None:
            runs = self._session.runs
            if runs.active and runs.document is document:
                runs.stop()
            if self._keep(document):
                self._documents.close(document)
                self._session.tabs.keep()

        self.with_newest(closed)

    def reopen(self) -> None:
        """Open the tab that was closed last."""

        def reopened() -> None:
            if self._documents.reopen() is None:
                self._say("No tab was closed")

        self.with_newest(lambda: self._show(reopened))

    def show(self, document: Document) -> None:
        """Show an open behaviour's tab."""
        self._documents.show(document)
        self._session.tabs.keep()

    def move(self, document: Document, place: int) -> None:
        """Put a tab to another place."""
        self._documents.move(document, place)
        self._session.tabs.keep()

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
        if deep_json.deeply(lambda: mend(document.workspace, action)) is None:
            return False

        def change() -> None:
            document.mend(action)

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
            self._cant_save(error)
            return
        self._documents.saved(document)
        self._session.tabs.keep()
        self._session.alerts.cure("file")
        if document.path is not None:
            self._remember(document.path)
        self._say(f"Saved {document.name}")

    def _show(self, act: Callable[[], object]) -> None:
        """Show another tab."""
        try:
            act()
        except AppError as error:
            self._complain(sentence_of(error), "file.open", "Open another file")
            return
        self._session.tabs.keep()
        self._session.alerts.cure("file")
        self._shown()

    def _keep(self, document: Document) -> bool:
        """Save what is not saved yet; False, and an alert, when that can't be done."""
        if not document.dirty:
            return True
        had_file, name = document.path is not None, document.name
        path = document.path or kept_path(home() / "kept", document.name, self._clock())
        try:
            document.save(None if had_file else path)
        except AppError as error:
            self._documents.show(document)
            self._cant_save(error)
            return False
        self._remember(path, name)
        self._say(f"Saved {name}" if had_file else f"Kept {name} in Recent")
        return True

    def _remember(self, path: Path, name: str | None = None) -> None:
        try:
            self._session.settings.add_recent(path, name or self._session.document.name)
        except SettingsError as error:
            self._session.console.add("warn", "studio", str(error))

    def _cant_save(self, error: Exception) -> None:
        self._complain(sentence_of(error), "file.save_as", "Save somewhere else")

    def _complain(self, sentence: str, action: str, button: str, alert: str = "file") -> None:
        what, _, then = sentence.partition("; ")
        detail = f"{then[:1].upper()}{then[1:]}." if then else ""
        self._session.alerts.put(alert, "error", f"{what}.", detail, button=button, action=action)


def sentence_of(error: Exception) -> str:
    """What is wrong with a file, beginning with its name."""
    if isinstance(error, DocumentError) and error.path is not None:
        return f"{error.path.name} {error.reason}"
    words = str(error)
    return words[:1].upper() + words[1:]


def strange_words(paths: Sequence[Path]) -> str:
    """What is wrong with files that are no behaviours."""
    names = [path.name or str(path) for path in paths]
    shown = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    are = "is no behaviour" if len(names) == 1 else "are no behaviours"
    return f"{shown} {are}; behaviours are files ending in {SUFFIX}"
