"""Files of the open projects: open, save, close and undo, with earlier versions and recent files.

Nothing is lost by any of these operations, therefore none of them asks for confirmation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.blocks.model.project import Project
from app.core.projects.open_project import OpenProject, SaveResult
from app.core.projects.open_projects import OpenProjects
from app.core.projects.saved_tabs import SavedTabs
from app.core.projects.versions import SavedVersion, Stamp, free_path, stamp_of
from app.core.storage.folders import closed_tabs_folder
from app.core.storage.settings import Settings
from app.errors import SettingsError
from nep.i18n import _


@dataclass(frozen=True)
class ClosedProject:
    """Project that was closed.

    Attributes:
        name: Name of the project.
        project: Content when it was closed.
        is_saved: True if unsaved work was saved to a file.
        is_new_file: True if that file was created, because the project had none.
        version: Previous content of the file; None if nothing was overwritten.
        stamp: Stamp of the file after closing; None if there is no file.
    """

    name: str
    project: Project
    is_saved: bool = False
    is_new_file: bool = False
    version: SavedVersion | None = None
    stamp: Stamp | None = None


class ProjectFiles:
    """File operations on open projects.

    Args:
        projects: Open projects.
        tabs: Storage of the open tabs.
        settings: Settings with the recent files.
        report_warning: Called with a message if something less important than the file can't be saved.
        clock: Returns the time in seconds since 1970.
    """

    def __init__(
        self,
        projects: OpenProjects,
        tabs: SavedTabs,
        settings: Settings,
        report_warning: Callable[[str], object],
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._projects, self._tabs, self._settings = projects, tabs, settings
        self._report_warning, self._clock = report_warning, clock

    def open(self, path: Path) -> OpenProject:
        """Open a file in a tab. If DocumentError is raised, nothing has changed."""
        project = self._projects.open(path)
        self._add_recent(path, project.name)
        return project

    def save(self, project: OpenProject, path: Path | None = None) -> SaveResult:
        """Save a project and keep the previous content of its file.

        Args:
            project: Project to save.
            path: File, which becomes the file of the project; None for the current file.

        Raises:
            DocumentError: The file can't be written, or content of another program can't be kept.
        """
        result = project.save(path)
        if result.version_error:
            self._report_warning(
                _("Can't keep the earlier version: {error}").format(error=result.version_error)
            )
        self._projects.on_saved(project)
        self._tabs.save()
        if project.path is not None:
            self._add_recent(project.path, project.name)
        return result

    def rename(self, project: OpenProject, name: str) -> None:
        """Rename a project and its file. If DocumentError is raised, nothing has changed."""
        old_path = project.path
        self._projects.rename(project, name)
        self._tabs.save()
        if old_path is not None and project.path is not None:
            try:
                self._settings.rename_recent(old_path, project.path)
            except SettingsError as error:
                self._report_warning(str(error))

    def close(self, project: OpenProject) -> ClosedProject:
        """Close a project after saving its unsaved work.

        Work of a project without a file is saved to a new file in Studio's folder. If AppError is raised
        because saving fails, the project stays open.
        """
        closed = self._save_unsaved_work(project)
        self._projects.close(project)
        self._tabs.save()
        return closed

    def _save_unsaved_work(self, project: OpenProject) -> ClosedProject:
        name, is_new_file = project.name, project.path is None
        if not project.dirty:
            return ClosedProject(name, project.project)
        new_path = free_path(closed_tabs_folder(), name, self._clock()) if is_new_file else None
        result = project.save(new_path, requires_version=True)
        if project.path is None:
            return ClosedProject(name, project.project)
        self._add_recent(project.path, name)
        return ClosedProject(name, project.project, True, is_new_file, result.version, stamp_of(project.path))

    def undo_close(self, closed_projects: Sequence[ClosedProject]) -> None:
        """Restore the overwritten files of closed projects, and open the projects with their unsaved work.

        If a file was changed since then, its previous content is opened as a copy. Raises DocumentError if a
        file can't be restored.
        """
        for closed in closed_projects:
            version = closed.version
            if version is None:
                continue
            if stamp_of(version.path) != closed.stamp:
                name = _("{name} (previous version)").format(name=version.path.stem)
                self._projects.copy(version.copy, name)
                continue
            reopened_project = self._projects.find_by_path(version.path)  # the user was faster
            version.restore()
            if reopened_project is not None:
                reopened_project.on_file_reverted()
            else:
                self._projects.open(version.path).apply_project(closed.project)

    def _add_recent(self, path: Path, name: str) -> None:
        try:
            self._settings.add_recent(path, name)
        except SettingsError as error:
            self._report_warning(str(error))
