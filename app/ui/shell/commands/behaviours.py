"""Commands for open behaviours: tabs, blocks, run and step, and restoring of tabs at startup."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Protocol

from PySide6.QtCore import QUrl

from app.blocks.model.stack import Stack
from app.core.projects.journal import UnsavedWork
from app.core.projects.open_project import OpenProject
from app.core.session import Session
from app.core.storage.settings import RecentFile
from app.errors import SettingsError
from app.ui.other_programs import open_externally
from app.ui.shell.commands.shell import Shell
from app.ui.shell.projects import ProjectController
from nep.i18n import _, ngettext
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.ui.shell.dialogs import version_history
else:
    version_history = lazy_module("app.ui.shell.dialogs.version_history")

OfferButton = tuple[str, Callable[[], object]]


class ShowOffer(Protocol):
    """Function that shows an offer with two buttons, given as (text, callback)."""

    def __call__(self, title: str, detail: str, yes: OfferButton, no: OfferButton) -> None: ...


def show_blocks_panel(shell: Shell) -> None:
    """Show the Behaviour layout with the blocks panel in front."""
    shell.show_layout("behaviour")
    shell.open_panel("behaviour")


class BehaviourCommands:
    """Handlers of the commands for behaviours and their tabs.

    Methods with a project key as argument return False if there is no such project.
    """

    def __init__(self, shell: Shell, session: Session, files: ProjectController) -> None:
        self._shell, self._session, self._files = shell, session, files
        self._version_sheet: version_history.VersionHistorySheet | None = None

    def run_or_resume(self) -> None:
        """Resume a paused program, or run the current behaviour.

        Before a run, the newest edit of the block editor is applied.
        """
        runs = self._session.runs
        if runs.view().state == "paused":
            runs.resume()
        else:
            self._shell.flush(partial(self._replace_run, runs.run))

    def _replace_run(self, start: Callable[[], object]) -> None:
        # Shows a toast with the name of the behaviour that was stopped by this run.
        session = self._session
        runs, current_project, running_project = session.runs, session.document, session.runs.document
        was_active = runs.active
        start()
        if (
            was_active
            and running_project is not None
            and running_project is not current_project
            and not runs.is_running_or_pending(running_project)
        ):
            self._shell.show_toast(
                _("Stopped “{stopped}” to run “{name}”").format(
                    stopped=session.documents.title(running_project),
                    name=session.documents.title(current_project),
                )
            )

    def run_named(self, name: str) -> str:
        """Run an open or recent behaviour by its name, unless another program is running.

        Returns:
            The reason why the behaviour can't be run, or "".
        """
        session = self._session
        if session.runs.active:
            return _("another behaviour is running")
        project = next((each for each in session.documents if session.documents.title(each) == name), None)
        if project is not None:
            self._files.show(project)
        else:
            path = next((file.path for file in session.settings.recent_files if file.name == name), None)
            if path is None:
                return _("no behaviour has this name")
            self._files.open(path)

        def start() -> None:
            if session.documents.title(session.document) == name:
                session.runs.run()

        self._shell.flush(start)
        return ""

    def try_stack(self, stack: Stack) -> None:
        """Run a single script, after the newest edit of the block editor was applied."""
        run_stack = partial(self._session.runs.try_stack, stack)
        self._shell.flush(partial(self._replace_run, run_stack))

    def restart(self) -> None:
        """Restart the running behaviour, after the newest edit of the block editor was applied."""
        self._shell.flush(self._session.runs.restart)

    def run_step(self) -> None:
        """Run the next block, after the newest edit of the block editor was applied."""
        self._shell.flush(self._session.runs.step)

    def start_demo(self) -> None:
        """Start the virtual Pepper and open the first example."""
        self._session.launcher.start_virtual_robot()
        self._shell.show_layout("behaviour")
        if self._shell.examples:
            self._files.open_example(self._shell.examples[0].path)

    def switch_tab(self, step: int) -> None:
        """Show another tab by its offset from the current one, wrapping around.

        Args:
            step: Number of positions to the right; negative to the left.
        """
        self._files.show(self._session.documents.neighbour(step))
        show_blocks_panel(self._shell)

    def close(self) -> None:
        """Close the current tab."""
        self._files.close(self._session.document)

    def show_tab(self, key: str) -> bool:
        """Show the tab with this key; return False if there is none."""
        return self._apply_to_project(key, self._files.show)

    def close_tab(self, key: str) -> bool:
        """Close the tab with this key; return False if there is none."""
        return self._apply_to_project(key, self._files.close)

    def close_other_tabs(self, key: str) -> bool:
        """Close all tabs except the one with this key; return False if there is no such tab."""
        projects = self._session.documents
        return self._apply_to_project(
            key, lambda project: self._files.close(*(other for other in projects if other is not project))
        )

    def save_tab_as(self, key: str) -> bool:
        """Show a tab and ask for a file to save its behaviour to; return False if there is no such tab."""

        def save_as(project: OpenProject) -> None:
            self._files.show(project)
            self._files.save_as()

        return self._apply_to_project(key, save_as)

    def rename_tab(self, key: str, name: str) -> bool:
        """Rename a behaviour; return False if there is no such tab."""
        return self._apply_to_project(key, lambda project: self._files.rename(project, name))

    def duplicate_tab(self, key: str) -> bool:
        """Open a copy of a behaviour in a new tab; return False if there is no such behaviour."""
        return self._apply_to_project(key, self._files.duplicate)

    def save_tab(self, key: str) -> bool:
        """Show a tab and save its behaviour; return False if there is no such tab."""

        def save(project: OpenProject) -> None:
            self._files.show(project)
            self._files.save()

        return self._apply_to_project(key, save)

    def show_folder(self, key: str) -> bool:
        """Open the folder of a behaviour's file in the file manager; return False if there is no such tab.

        Nothing is opened for a behaviour that was never saved.
        """

        def show(project: OpenProject) -> None:
            if project.path is None:
                return
            folder = project.path.parent
            if not open_externally(QUrl.fromLocalFile(str(folder))):
                self._shell.show_toast(_("The file is in {folder}").format(folder=folder))

        return self._apply_to_project(key, show)

    def move_tab(self, key: str, position: int) -> bool:
        """Move a tab to another position, counted from 0; return False if there is no such tab."""
        return self._apply_to_project(key, lambda project: self._files.move(project, position))

    def _apply_to_project(self, key: str, act: Callable[[OpenProject], object]) -> bool:
        project = self._session.documents.find_by_key(key)
        if project is not None:
            act(project)
        return project is not None

    def show_earlier_versions(self) -> None:
        """Open the version history of the current behaviour, after its newest edit was applied."""
        self._shell.flush(self._show_versions)

    def _show_versions(self) -> None:
        if self._version_sheet is None:
            self._version_sheet = version_history.VersionHistorySheet(
                self._shell.theme, self._shell.surface, self._files.copy, self._files.save
            )
        project = self._session.document
        title = self._session.documents.title(project)
        self._version_sheet.show_for(project.project, project.path, title=title)

    def clear_recent(self) -> None:
        """Clear the list of recent files and show a toast with an Undo button."""
        old_files: list[RecentFile] = self._session.settings.all_recent_files
        message = _("Recent files cleared")
        if not self._set_recent([]):
            message = _("This change couldn't be saved. The recent files will reappear when Studio restarts.")
        self._shell.show_toast(message, _("Undo"), lambda: self._set_recent(old_files))

    def _set_recent(self, files: list[RecentFile]) -> bool:
        is_saved = True
        try:
            self._session.settings.set_recent(files)
        except SettingsError as error:
            self._shell.log_problem(str(error))
            is_saved = False
        self._shell.show_recent()
        return is_saved

    def restore_tabs(self, unsaved_work: Sequence[UnsavedWork], offer: ShowOffer) -> None:
        """Restore the tabs of the last session, and offer to recover unsaved changes.

        Args:
            unsaved_work: Changes that were not saved, for example because of a crash.
            offer: Shows the offer; called only if changes remain that the tabs don't contain.
        """
        remaining_work = self._session.tabs.restore(unsaved_work)
        if not remaining_work:
            return

        def discard() -> None:
            for unsaved in remaining_work:
                unsaved.journal.unlink(missing_ok=True)

        offer(
            _("Restore unsaved work?"),
            unsaved_text(remaining_work),
            (_("Restore"), lambda: self._files.recover(remaining_work)),
            (_("Discard"), discard),
        )


def unsaved_text(unsaved: Sequence[UnsavedWork]) -> str:
    """Return a sentence about behaviours with unsaved changes; of more than two, only the first is named."""
    if len(unsaved) == 1:
        return _("“{name}” wasn't saved before Studio closed.").format(name=unsaved[0].name)
    if len(unsaved) == 2:
        return _("“{name}” and “{other}” weren't saved before Studio closed.").format(
            name=unsaved[0].name, other=unsaved[1].name
        )
    return ngettext(
        "“{name}” and {count} other weren't saved before Studio closed.",
        "“{name}” and {count} others weren't saved before Studio closed.",
        len(unsaved) - 1,
    ).format(name=unsaved[0].name, count=len(unsaved) - 1)
