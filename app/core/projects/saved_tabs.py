"""Saving and restoring the tabs between sessions, with their unsaved work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from app.core.projects.journal import UnsavedWork
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import OpenProjects
from app.core.storage.settings import Settings
from app.errors import SettingsError


class SavedTabs:
    """Storage of the open tabs in the settings, restored at the next start."""

    def __init__(
        self, settings: Settings, projects: OpenProjects, report_error: Callable[[str], object]
    ) -> None:
        # `report_error` is called with a message if the tabs can't be saved.
        self._settings, self._projects, self._report_error = settings, projects, report_error
        self.is_active = False
        """True if the tabs of this window are saved; False in a second window."""
        self._last_session: Mapping[str, object] = {}
        self._saved_revision = -1

    def restore(self, unsaved_work: Sequence[UnsavedWork]) -> list[UnsavedWork]:
        """Restore the tabs of the last session, and start saving changes.

        Args:
            unsaved_work: Unsaved work of crashed sessions.

        Returns:
            Unsaved work that was not restored, because the user must be asked first.
        """
        self.is_active = True
        tabs_state = self._last_session = self._settings.tabs
        restored = self._projects.restore_tabs(
            tabs_state, unsaved_work, has_ended_normally=tabs_state.get("ended_well") is True
        )
        self.save()
        return [each for each in unsaved_work if each.journal not in restored]

    def recover(self, unsaved_work: Sequence[UnsavedWork]) -> None:
        """Restore unsaved work into its tabs, and show the tab that was current."""
        newest_last = sorted(unsaved_work, key=lambda each: each.edited_s)
        recovered = {each.journal.name: self._projects.recover(each) for each in newest_last}
        self._projects.arrange_tabs(self._last_session, recovered)
        self.save()

    def on_edited(self, project: OpenProject, *, was_blank: bool) -> None:
        """Save the tabs after the first edit of an empty behaviour.

        Args:
            project: Behaviour that was edited.
            was_blank: True if the behaviour was new and empty before the edit.
        """
        if was_blank and not project.is_blank:
            self.save()

    def save_if_changed(self) -> None:
        """Save the tabs if they changed.

        Called once a second, so that switching tabs does not wait for the disk.
        """
        if self._projects.revision != self._saved_revision:
            self.save()

    def save(self, *, has_ended_normally: bool = False) -> None:
        """Save the open tabs.

        Args:
            has_ended_normally: True if the window closes normally.
        """
        if not self.is_active:
            return
        self._saved_revision = self._projects.revision
        try:
            self._settings.tabs = {**self._projects.tabs_state(), "ended_well": has_ended_normally}
        except SettingsError as error:
            self._report_error(str(error))
