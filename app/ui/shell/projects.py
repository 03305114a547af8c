"""Commands for files of behaviours, with their dialogs and toasts: open, save, close and recover.

All operations can be undone, therefore none of them asks for confirmation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from PySide6.QtCore import QObject, QTimer

from app.core.projects.file_format import SUFFIX, file_type_hint
from app.core.projects.journal import UnsavedWork
from app.core.projects.open_project import OpenProject
from app.core.projects.project_files import ClosedProject
from app.core.session import Session
from app.core.storage.folders import closed_tabs_folder
from app.errors import AppError, DocumentError
from app.intents import BlockFix, Intent, OpenBehaviour, SaveBehaviourAs
from app.ui.widgets.file_dialogs import FileDialogs
from nep.i18n import _, ngettext

MAX_FLUSH_MS = 500
RECORDING, LAYOUT = OTHER_SUFFIXES = (".mcap", ".nep-layout")


class ProjectController:
    """Controller that runs the file operations of the session and shows their results.

    Args:
        session: Session with the open projects.
        dialogs: File dialogs.
        show_toast: Shows a toast.
        show_editor: Called when a behaviour was opened or reopened.
        flush: Applies the pending edit of the block editor to its project, then calls a function.
        show_current: Shows the current behaviour without waiting for the next tick.
    """

    def __init__(
        self,
        session: Session,
        dialogs: FileDialogs,
        show_toast: Callable[..., object],
        show_editor: Callable[[], object],
        flush: Callable[[Callable[[], None]], None],
        show_current: Callable[[], object],
    ) -> None:
        self._session, self.dialogs, self._show_toast, self._show_editor = (
            session,
            dialogs,
            show_toast,
            show_editor,
        )
        self._projects = session.documents
        self._flush, self._show_current = flush, show_current
        self.open_recording: Callable[[Path], object] = lambda _path: None
        """Opens a recording that was dropped on the window or passed at startup."""
        self.open_layout: Callable[[Path], object] = lambda _path: None
        """Opens a layout file that was dropped on the window or passed at startup."""

    def new(self) -> None:
        """Create an empty behaviour in a new tab."""
        self._flush(lambda: self._open_tab(self._projects.new))

    def ask_open(self) -> None:
        """Ask for a behaviour file and open it."""
        self._session.alerts.resolve("strange")
        path = self._session.document.path
        self.dialogs.open(str(path.parent if path is not None else Path.home()), self.open)

    def open(self, path: Path) -> None:
        """Open a behaviour file in a tab; an error is shown as an alert."""
        self._flush(lambda: self._open_tab(lambda: self._session.files.open(path)))

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
        self._flush(lambda: self._open_tab(lambda: self._projects.open_example(path)))

    def copy(self, path: Path, name: str) -> None:
        """Open a copy of a saved version in a new tab, without writing a file.

        Args:
            path: File of the version.
            name: Name of the copy.
        """

        def open_copy() -> None:
            self._projects.copy(path, name)
            self._show_toast(_("Opened {name} as a copy").format(name=name))

        self._flush(lambda: self._open_tab(open_copy))

    def recover(self, unsaved: Sequence[UnsavedWork]) -> None:
        """Open behaviours with unsaved changes in tabs, and show the most recently used one."""
        self._flush(lambda: self._open_tab(lambda: self._session.tabs.recover(unsaved)))

    def close(self, *projects: OpenProject) -> None:
        """Close the tabs of projects, stopping their programs.

        Unsaved changes are saved to the project's file or, if it has none, to a new file in the list
        of recent files. The toast offers to restore overwritten files. If saving fails, the tab stays
        open and an alert is shown.
        """

        def close_projects() -> None:
            runs = self._session.runs
            closed_projects = []
            for project in projects:
                if runs.is_running_or_pending(project):
                    runs.stop()
                try:
                    closed_projects.append(self._session.files.close(project))
                except AppError as error:
                    self._projects.show(project)
                    self._report_save_error(error)
            self._notify_closed([each for each in closed_projects if each.is_saved])

        self._flush(close_projects)

    def reopen(self) -> None:
        """Reopen the most recently closed tab."""

        def reopen_project() -> None:
            if self._projects.reopen() is None:
                self._show_toast(_("No closed tabs"))

        self._flush(lambda: self._open_tab(reopen_project))

    def show(self, project: OpenProject) -> None:
        """Show the tab of a project, without waiting for the next tick."""
        self._projects.show(project)
        self._show_current()

    def duplicate(self, project: OpenProject) -> None:
        """Open a copy of a project in a new tab."""
        self._flush(lambda: self._open_tab(lambda: self._projects.duplicate(project)))

    def rename(self, project: OpenProject, name: str) -> bool:
        """Rename a behaviour and its file; return False on failure, which is shown as an alert.

        The toast has an Undo button.
        """
        old_name = project.name
        if name.strip() == old_name:
            return True
        try:
            self._session.files.rename(project, name)
        except AppError as error:
            self._raise_alert(alert_text(error), SaveBehaviourAs(), _("Save somewhere else"))
            return False
        message = _("Renamed {name} to {other}").format(name=old_name, other=project.name)
        self._show_toast(message, _("Undo"), lambda: self.rename(project, old_name))
        return True

    def move(self, project: OpenProject, position: int) -> None:
        """Move the tab of a project to a position, counted from 0."""
        self._projects.move(project, position)
        self._session.tabs.save()

    def save(self) -> None:
        """Save the current behaviour; if it has no file, ask for one."""
        if self._session.document.path is None:
            self.save_as()
        else:
            self._flush(lambda: self._save(None))

    def save_as(self) -> None:
        """Ask for a file and save the current behaviour to it."""
        project = self._session.document
        current_path = project.path
        folder = (
            current_path.parent
            if current_path is not None and current_path.parent != closed_tabs_folder()
            else Path.home()
        )
        suggestion = str(folder / f"{project.name}{SUFFIX}")
        self.dialogs.save(suggestion, lambda path: self._flush(lambda: self._save(path)))

    def fix(self, action: BlockFix) -> bool:
        """Apply a fix to the blocks of the current behaviour; return False if that isn't possible."""
        project = self._session.document
        if not project.can_fix(action):
            return False

        def apply_fix() -> None:
            project.fix(action)

        self._flush(apply_fix)
        return True

    def _save(self, path: Path | None) -> None:
        project = self._session.document
        try:
            result = self._session.files.save(project, path)
        except AppError as error:
            self._report_save_error(error)
            return
        self._session.alerts.resolve("file")
        earlier = result.version
        if earlier is None or result.reason == "edited":
            self._show_toast(_("Saved {name}").format(name=project.name))
            return
        template = (
            _("Saved {name}. The previous file is under Earlier versions.")
            if result.reason == "replaced"
            else _(
                "Saved {name}. Another program had changed the file; its version is under Earlier versions."
            )
        )
        copy_name = _("{name} (previous version)").format(name=project.name)
        message = template.format(name=project.name)
        self._show_toast(message, _("Open"), lambda: self.copy(earlier.copy, copy_name))

    def _open_tab(self, act: Callable[[], object]) -> None:
        try:
            act()
        except AppError as error:
            self._raise_alert(alert_text(error), OpenBehaviour(), _("Open another file"))
            return
        self._session.tabs.save()
        self._session.alerts.resolve("file")
        self._show_editor()

    def _notify_closed(self, closed_projects: Sequence[ClosedProject]) -> None:
        # Shows a toast that names the saved behaviours and offers undo.
        if not closed_projects:
            return
        count = len(closed_projects)
        if count > 1:
            message = ngettext("Saved {count} behaviour", "Saved {count} behaviours", count).format(
                count=count
            )
        else:
            (closed,) = closed_projects
            template = (
                _("Closed {name}. You'll find it under Recent.") if closed.is_new_file else _("Saved {name}")
            )
            message = template.format(name=closed.name)
        restorable = [each for each in closed_projects if each.version is not None]
        if restorable:
            self._show_toast(
                message,
                _("Undo"),
                lambda: self._open_tab(lambda: self._session.files.undo_close(restorable)),
            )
        else:
            self._show_toast(message)

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

    def __init__(
        self,
        parent: QObject,
        flush: Callable[[Callable[[], None]], object],
        close: Callable[[], object],
    ) -> None:
        # `close` is called once if `can_close` had to wait.
        super().__init__(parent)
        self._flush, self._close = flush, close
        self._is_requested = self._is_ready = self._is_waiting = False

    def can_close(self) -> bool:
        """Return True if the window can be closed now.

        The first call requests the pending edit. If it returns False, the window is closed when the
        edit has arrived.
        """
        if not self._is_requested:
            self._is_requested, self._is_ready = True, False
            self._flush(self._on_flushed)
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
