"""File operations on behaviours: open, save, close and recover.

All operations can be undone, therefore none of them asks for confirmation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

from PySide6.QtCore import QObject, QTimer

from app.blocks.fixes.fixes import fix
from app.core.alerts.intents import Intent, OpenBehaviour, SaveBehaviourAs
from app.core.documents.document import Document
from app.core.documents.file_format import SUFFIX, file_type_hint
from app.core.documents.journal import UnsavedWork
from app.core.documents.versions import SavedVersion, free_path, save_version, stamp_of
from app.core.session import Session
from app.core.storage import deep_json
from app.core.storage.settings import closed_tabs_folder
from app.errors import AppError, DocumentError, SettingsError
from app.ui.widgets.file_dialogs import FileDialogs
from nep.i18n import _, ngettext

MAX_FLUSH_MS = 500
RECORDING, LAYOUT = OTHER_SUFFIXES = (".mcap", ".nep-layout")


@runtime_checkable
class SupportsFlush(Protocol):
    """Interface of a panel that can hold an edit which the document doesn't contain yet."""

    def flush(self, callback: Callable[[], None]) -> None:
        """Apply the pending edit to the document, then call ``callback``."""


@runtime_checkable
class SupportsShowCurrent(Protocol):
    """Interface of a panel that shows the current behaviour."""

    def show_current(self) -> None:
        """Update the panel to the current behaviour immediately, without waiting for the next tick."""


class ClosedTab:
    """Record of a closed tab.

    Args:
        document: Document of the tab.
        message: Text for the toast, or "" if nothing was saved.
        earlier_version: Previous version of the file, or None if no file was overwritten.
    """

    def __init__(
        self, document: Document, message: str = "", earlier_version: SavedVersion | None = None
    ) -> None:
        self.message, self.earlier_version = message, earlier_version
        self.workspace = document.workspace
        self.stamp = stamp_of(document.path) if document.path is not None else None


class DocumentController:
    """Controller that implements the file operations on open behaviours.

    Args:
        session: Session with the documents.
        dialogs: File dialogs.
        show_toast: Shows a toast.
        show_editor: Called when a behaviour was opened or reopened.
        editor: Returns the panel with the block editor, or None before it is created.
        clock: Returns the Unix time in s.
    """

    def __init__(
        self,
        session: Session,
        dialogs: FileDialogs,
        show_toast: Callable[..., object],
        show_editor: Callable[[], object],
        editor: Callable[[], object],
        clock: Callable[[], float] = time.time,
    ) -> None:
        # `editor` returns the behaviour panel, or None before it exists.
        self._session, self.dialogs, self._show_toast, self._show_editor = (
            session,
            dialogs,
            show_toast,
            show_editor,
        )
        self._documents = session.documents
        self._editor, self._clock = editor, clock
        self.open_recording: Callable[[Path], object] = lambda _path: None
        """Opens a recording that was dropped on the window or passed at startup."""
        self.open_layout: Callable[[Path], object] = lambda _path: None
        """Opens a layout file that was dropped on the window or passed at startup."""

    def new(self) -> None:
        """Create an empty behaviour in a new tab."""
        self.run_after_flush(lambda: self._open_tab(self._documents.new))

    def ask_open(self) -> None:
        """Ask for a behaviour file and open it."""
        self._session.alerts.resolve("strange")
        path = self._session.document.path
        self.dialogs.open(str(path.parent if path is not None else Path.home()), self.open)

    def open(self, path: Path) -> None:
        """Open a behaviour file in a tab; an error is shown as an alert."""

        def open_document() -> None:
            self._documents.open(path)
            self._add_recent(path)

        self.run_after_flush(lambda: self._open_tab(open_document))

    def open_all(self, paths: Sequence[Path]) -> None:
        """Open files from the command line, from a drop, or from a later start of Studio.

        Of several recordings or layout files only the last one is opened. Files of unknown types are
        listed in an alert.
        """
        self._session.alerts.resolve("strange")
        unknown_files = [path for path in paths if path.suffix.lower() not in {SUFFIX, *OTHER_SUFFIXES}]
        for path in paths:
            if path.suffix.lower() == SUFFIX:
                self.open(path)
        for suffix, open_file in ((LAYOUT, self.open_layout), (RECORDING, self.open_recording)):
            for path in [each for each in paths if each.suffix.lower() == suffix][-1:]:  # only one is shown
                open_file(path)
        if unknown_files:
            self._raise_alert(
                unknown_type_text(unknown_files), OpenBehaviour(), _("Open another file"), alert="strange"
            )

    def open_example(self, path: Path) -> None:
        """Open a copy of an example in a new tab."""
        self.run_after_flush(lambda: self._open_tab(lambda: self._documents.open_example(path)))

    def copy(self, path: Path, name: str) -> None:
        """Open a copy of a saved version in a new tab, without writing a file.

        Args:
            path: File of the version.
            name: Name of the copy.
        """

        def open_copy() -> None:
            self._documents.copy(path, name)
            self._show_toast(_("Opened {name} as a copy").format(name=name))

        self.run_after_flush(lambda: self._open_tab(open_copy))

    def recover(self, unsaved: Sequence[UnsavedWork]) -> None:
        """Open behaviours with unsaved changes in tabs, and show the most recently used one."""
        self.run_after_flush(lambda: self._open_tab(lambda: self._session.tabs.recover(unsaved)))

    def close(self, *documents: Document) -> None:
        """Close the tabs of documents, stopping their programs.

        Unsaved changes are saved to the document's file or, if it has none, to a new file in the list
        of recent files. The toast offers to restore overwritten files. If saving fails, the tab stays
        open and an alert is shown.
        """

        def close_documents() -> None:
            runs = self._session.runs
            closed_tabs = []
            for document in documents:
                if runs.is_running_or_pending(document):
                    runs.stop()
                closed_tab = self._save_before_close(document)
                if closed_tab is None:
                    continue
                self._documents.close(document)
                closed_tabs.append(closed_tab)
            self._session.tabs.save()
            self._notify_closed([each for each in closed_tabs if each.message])

        self.run_after_flush(close_documents)

    def reopen(self) -> None:
        """Reopen the most recently closed tab."""

        def reopen_document() -> None:
            if self._documents.reopen() is None:
                self._show_toast(_("No closed tabs"))

        self.run_after_flush(lambda: self._open_tab(reopen_document))

    def show(self, document: Document) -> None:
        """Show the tab of a document, without waiting for the next tick."""
        self._documents.show(document)
        editor = self._editor()
        if isinstance(editor, SupportsShowCurrent):
            editor.show_current()

    def duplicate(self, document: Document) -> None:
        """Open a copy of a document in a new tab."""
        self.run_after_flush(lambda: self._open_tab(lambda: self._documents.duplicate(document)))

    def rename(self, document: Document, name: str) -> bool:
        """Rename a behaviour and its file; return False on failure, which is shown as an alert.

        The toast has an Undo button.
        """
        old_name, old_path = document.name, document.path
        if name.strip() == old_name:
            return True
        try:
            self._documents.rename(document, name)
        except AppError as error:
            self._raise_alert(alert_text(error), SaveBehaviourAs(), _("Save somewhere else"))
            return False
        self._session.tabs.save()
        if old_path is not None and document.path is not None:
            try:
                self._session.settings.rename_recent(old_path, document.path)
            except SettingsError as error:
                self._session.console.add("warn", "studio", str(error))
        message = _("Renamed {name} to {other}").format(name=old_name, other=document.name)
        self._show_toast(message, _("Undo"), lambda: self.rename(document, old_name))
        return True

    def move(self, document: Document, position: int) -> None:
        """Move the tab of a document to a position, counted from 0."""
        self._documents.move(document, position)
        self._session.tabs.save()

    def save(self) -> None:
        """Save the current behaviour; if it has no file, ask for one."""
        if self._session.document.path is None:
            self.save_as()
        else:
            self.run_after_flush(lambda: self._save(None))

    def save_as(self) -> None:
        """Ask for a file and save the current behaviour to it."""
        document = self._session.document
        current_path = document.path
        folder = (
            current_path.parent
            if current_path is not None and current_path.parent != closed_tabs_folder()
            else Path.home()
        )
        suggestion = str(folder / f"{document.name}{SUFFIX}")
        self.dialogs.save(suggestion, lambda path: self.run_after_flush(lambda: self._save(path)))

    def fix(self, action: str) -> bool:
        """Apply a fix to the blocks of the current behaviour.

        Args:
            action: Action of a problem, such as ``limit:ID``.

        Returns:
            False if the action isn't a fix or can't be applied.
        """
        document = self._session.document
        if deep_json.run_deep(lambda: fix(document.workspace, action)) is None:
            return False

        def apply_fix() -> None:
            document.fix(action)

        self.run_after_flush(apply_fix)
        return True

    def run_after_flush(self, callback: Callable[[], None]) -> None:
        """Call a function after the pending edit of the block editor was applied to the document."""
        editor = self._editor()
        if isinstance(editor, SupportsFlush):
            editor.flush(callback)
        else:
            callback()

    def _save(self, path: Path | None) -> None:
        document = self._session.document
        try:
            earlier, template = self._back_up(document, path)
            document.save(path)
        except AppError as error:
            self._report_save_error(error)
            return
        self._documents.on_saved(document)
        self._session.tabs.save()
        self._session.alerts.resolve("file")
        if document.path is not None:
            self._add_recent(document.path)
        if earlier is None:
            self._show_toast(_("Saved {name}").format(name=document.name))
            return
        copy_name = _("{name} (previous version)").format(name=document.name)
        message = template.format(name=document.name)
        self._show_toast(message, _("Open"), lambda: self.copy(earlier.copy, copy_name))

    def _back_up(self, document: Document, path: Path | None) -> tuple[SavedVersion | None, str]:
        # Backs up a file before it is overwritten; returns the text for the toast with the placeholder
        # "name". Raises DocumentError if content from elsewhere can't be backed up; Studio's own content is
        # backed up without text if possible.
        current_path = document.path
        if path is not None and (current_path is None or path.resolve() != current_path.resolve()):
            return save_version(path), _("Saved {name}. The previous file is under Earlier versions.")
        if current_path is not None and document.is_changed_externally:
            return save_version(current_path), _(
                "Saved {name}. Another program had changed the file; its version is under Earlier versions."
            )
        if current_path is not None and document.dirty:
            try:
                save_version(current_path)
            except DocumentError as error:
                message = _("Can't keep the earlier version: {error}").format(error=error)
                self._session.console.add("warn", "studio", message)
        return None, ""

    def _open_tab(self, act: Callable[[], object]) -> None:
        try:
            act()
        except AppError as error:
            self._raise_alert(alert_text(error), OpenBehaviour(), _("Open another file"))
            return
        self._session.tabs.save()
        self._session.alerts.resolve("file")
        self._show_editor()

    def _save_before_close(self, document: Document) -> ClosedTab | None:
        # Returns None and raises an alert if saving fails.
        if not document.dirty:
            return ClosedTab(document)
        name, path = document.name, document.path
        try:
            earlier = save_version(path) if path is not None else None
            if path is None:
                document.save(free_path(closed_tabs_folder(), name, self._clock()))
            else:
                document.save()
        except AppError as error:
            self._documents.show(document)
            self._report_save_error(error)
            return None
        if document.path is not None:
            self._add_recent(document.path, name)
        message = _("Saved {name}") if path is not None else _("Closed {name}. You'll find it under Recent.")
        return ClosedTab(document, message.format(name=name), earlier)

    def _notify_closed(self, closed_tabs: Sequence[ClosedTab]) -> None:
        # Shows a toast that names the saved behaviours and offers undo.
        if not closed_tabs:
            return
        message = closed_tabs[0].message
        if len(closed_tabs) > 1:
            message = ngettext("Saved {count} behaviour", "Saved {count} behaviours", len(closed_tabs))
            message = message.format(count=len(closed_tabs))
        restorable_tabs = [each for each in closed_tabs if each.earlier_version is not None]
        if restorable_tabs:
            self._show_toast(
                message, _("Undo"), lambda: self._open_tab(lambda: self._undo_close(restorable_tabs))
            )
        else:
            self._show_toast(message)

    def _undo_close(self, closed_tabs: Sequence[ClosedTab]) -> None:
        # Restores the files, and reopens the tabs with unsaved work.
        for tab in closed_tabs:
            if tab.earlier_version is None:
                continue
            if stamp_of(tab.earlier_version.path) != tab.stamp:
                name = _("{name} (previous version)").format(name=tab.earlier_version.path.stem)
                self._documents.copy(tab.earlier_version.copy, name)  # the file was changed since then
                continue
            # the user may have reopened the tab before pressing "Undo"
            reopened_document = self._documents.find_by_path(tab.earlier_version.path)
            tab.earlier_version.restore()
            if reopened_document is not None:
                reopened_document.on_file_reverted()
            else:
                self._documents.open(tab.earlier_version.path).apply_edit(tab.workspace)

    def _add_recent(self, path: Path, name: str | None = None) -> None:
        try:
            self._session.settings.add_recent(path, name or self._session.document.name)
        except SettingsError as error:
            self._session.console.add("warn", "studio", str(error))

    def _report_save_error(self, error: Exception) -> None:
        self._raise_alert(alert_text(error), SaveBehaviourAs(), _("Save somewhere else"))

    def _raise_alert(self, text: AlertText, intent: Intent, button: str, alert: str = "file") -> None:
        self._session.alerts.raise_alert(
            alert, "error", text.title, text.detail, button=button, intent=intent
        )


class AlertText(NamedTuple):
    """Text of an alert.

    Attributes:
        title: Problem, as a sentence.
        detail: Advice, or "".
    """

    title: str
    detail: str


def alert_text(error: Exception) -> AlertText:
    """Return the text of the alert for an error while a file is opened or saved."""
    if not isinstance(error, DocumentError):
        return AlertText(_as_sentence(str(error)), "")
    has_file_name = error.path is not None and error.reason.startswith(
        error.path.name
    )  # the name is not capitalised
    title = f"{error.reason}." if has_file_name else _as_sentence(error.reason)
    return AlertText(title, _as_sentence(error.advice))


def unknown_type_text(paths: Sequence[Path]) -> AlertText:
    """Return the text of the alert for files of unknown types."""
    names = [path.name or str(path) for path in paths]
    text, others = _("{file} isn't a behaviour"), len(names) - 1
    if others:
        text = ngettext(
            "{file} and {count} more aren't behaviours", "{file} and {count} more aren't behaviours", others
        )
    return AlertText(f"{text.format(file=names[0], count=others)}.", _as_sentence(file_type_hint()))


def _as_sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}." if text else ""


class FlushBeforeClose(QObject):
    """Helper that applies the pending edit of the block editor before the window closes.

    The window closes after at most 0.5 s, even if the block editor doesn't respond.
    """

    def __init__(self, parent: QObject, editor: Callable[[], object], close: Callable[[], object]) -> None:
        # `close` is called once if `can_close` had to wait.
        super().__init__(parent)
        self._editor, self._close = editor, close
        self._is_requested = self._is_ready = self._is_waiting = False

    def can_close(self) -> bool:
        """Return True if the window can be closed now.

        The first call requests the pending edit. If it returns False, the window is closed when the
        edit has arrived.
        """
        if not self._is_requested:
            self._is_requested, self._is_ready = True, False
            editor = self._editor()
            if isinstance(editor, SupportsFlush):
                editor.flush(self._on_flushed)
            else:
                self._is_ready = True
            self._is_waiting = not self._is_ready
            if self._is_waiting:
                QTimer.singleShot(MAX_FLUSH_MS, self, self._on_flushed)
        return self._is_ready

    def reset(self) -> None:
        """Reset the state after closing the window was cancelled."""
        self._is_requested = self._is_ready = self._is_waiting = False

    def _on_flushed(self) -> None:
        self._is_ready = True
        if self._is_waiting:
            self._is_waiting = False
            QTimer.singleShot(0, self, self._close)
