"""Open behaviours as tabs; one of them is current.

Tabs are saved and restored at the next start (`OpenProjects.tabs_state`, `OpenProjects.restore_tabs`). Closed
tabs can be reopened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.projects.journal import UnsavedWork
from app.core.projects.open_project import DEFAULT_NAME, CompiledProgram, OpenProject
from app.core.projects.titles import unique_titles
from app.core.storage.background_worker import BackgroundWorker
from app.errors import DocumentError
from app.robots.description.description import Robot
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.blocks.toolbox import definitions as toolbox
else:  # imported after the window is shown
    toolbox = lazy_module("app.blocks.toolbox.definitions")

MAX_CLOSED_TABS = 20


class OpenProjects:
    """Open behaviours; there is always at least one.

    Attributes:
        revision: Counter that increases when the tabs change.
    """

    def __init__(self, create_project: Callable[[], OpenProject] = OpenProject) -> None:
        self._create_project = create_project
        self._robots: tuple[Robot, ...] = ()
        self._topics: tuple[str, ...] = ()
        self._closed_paths: list[Path] = []
        self._compiler: BackgroundWorker[CompiledProgram] = BackgroundWorker("studio-compiler")
        # a separate worker, so that unsaved work never waits for a long compilation
        self._journal_writer: BackgroundWorker[Path] = BackgroundWorker("studio-journal")
        self.revision = 0
        self.current = self._new_project()
        self._projects = [self.current]

    def __iter__(self) -> Iterator[OpenProject]:
        # In the order of the tabs.
        return iter(tuple(self._projects))

    def __len__(self) -> int:
        return len(self._projects)

    @property
    def can_reopen(self) -> bool:
        """True if a closed tab can be reopened."""
        return bool(self._closed_paths)

    # -- opening -----------------------------------------------------------------------------------------

    def new(self) -> OpenProject:
        """Open an empty behaviour in a new tab, or in the current tab if that is empty and unchanged."""
        if self.current.is_blank:
            return self.current
        project = self._new_project()
        project.new(self._free_name(_(DEFAULT_NAME)))
        return self._insert(project)

    def open(self, path: Path) -> OpenProject:
        """Open a file in a new tab, or switch to its tab. If DocumentError is raised, nothing has changed."""
        open_project = self.find_by_path(path)
        if open_project is not None:
            return self._make_current(open_project)
        return self._open_with(lambda project: project.open(path))

    def open_example(self, path: Path) -> OpenProject:
        """Open an example as a new behaviour in a tab.

        A blank current tab is reused. If DocumentError is raised because the file can't be read,
        nothing has changed.
        """
        return self._assign_unique_name(self._open_with(lambda project: project.open_example(path)))

    def copy(self, path: Path, name: str) -> OpenProject:
        """Open a file as a new behaviour in a tab, named ``name`` (made unique).

        A blank current tab is reused. If DocumentError is raised because the file can't be read,
        nothing has changed.
        """
        return self._assign_unique_name(self._open_with(lambda project: project.copy(path, name)))

    def duplicate(self, project: OpenProject) -> OpenProject:
        """Open a copy of a behaviour in a tab next to it."""
        self.show(project)
        copy = self._new_project()
        copy.duplicate(project, self._free_name(_("{name} copy").format(name=project.name)))
        return self._insert(copy)

    def rename(self, project: OpenProject, name: str) -> None:
        """Rename a behaviour and its file. If DocumentError is raised, nothing has changed."""
        old_path = project.path
        project.rename_to(name)
        self._closed_paths = [
            project.path if each == old_path and project.path else each for each in self._closed_paths
        ]
        self.revision += 1

    def recover(self, unsaved: UnsavedWork) -> OpenProject:
        """Restore unsaved work into the tab of its file, or into another tab.

        Another tab is used if the file isn't open, or if its tab contains unsaved changes.
        """
        open_project = self.find_by_path(unsaved.path) if unsaved.path is not None else None
        if open_project is None or open_project.dirty:
            return self._open_with(lambda project: project.recover(unsaved))
        open_project.recover(unsaved)
        return self._make_current(open_project)

    def find_by_path(self, path: Path) -> OpenProject | None:
        """Return the open behaviour whose file is ``path``, or None."""
        resolved = path.resolve()
        return next((each for each in self._projects if each.path and each.path.resolve() == resolved), None)

    def find_by_key(self, key: str) -> OpenProject | None:
        """Return the open behaviour with this key, or None."""
        return next((each for each in self._projects if each.key == key), None)

    def title(self, project: OpenProject) -> str:
        """Return the title of a behaviour, unique among the open behaviours."""
        projects = [*self._projects, *([project] if project not in self._projects else [])]
        return unique_titles([(each.name, each.path) for each in projects])[projects.index(project)]

    # -- tabs --------------------------------------------------------------------------------------------

    def show(self, project: OpenProject) -> None:
        """Make an open behaviour the current one."""
        if project in self._projects and project is not self.current:
            self._make_current(project)

    def neighbour(self, step: int) -> OpenProject:
        """Return the behaviour ``step`` tabs to the right of the current one, wrapping around at the ends."""
        return self._projects[(self._projects.index(self.current) + step) % len(self._projects)]

    def move(self, project: OpenProject, index: int) -> None:
        """Move a tab to an index, counted from 0."""
        if project in self._projects and self._projects.index(project) != index:
            self._projects.remove(project)
            self._projects.insert(max(0, index), project)
            self.revision += 1

    def close(self, project: OpenProject) -> None:
        """Close a tab. Unsaved work must be saved before; otherwise it is offered again at the next start.

        The last tab is replaced with an empty behaviour.
        """
        if project not in self._projects:
            return
        index = self._projects.index(project)
        if project.path is not None:
            self._closed_paths = [
                *(each for each in self._closed_paths if each != project.path),
                project.path,
            ]
            del self._closed_paths[:-MAX_CLOSED_TABS]
        project.close()
        self._compiler.discard(project.key)
        self._projects.remove(project)
        if not self._projects:
            self._projects.append(self._new_project())
        if project is self.current:
            self.current = self._projects[min(index, len(self._projects) - 1)]
        self.revision += 1

    def reopen(self) -> OpenProject | None:
        """Reopen the tab closed last whose file isn't open already; return None if there is none.

        Raises DocumentError if the file can't be read.
        """
        while self._closed_paths:
            path = self._closed_paths.pop()
            if self.find_by_path(path) is None:
                return self.open(path)
        return None

    def on_saved(self, project: OpenProject) -> None:
        """Detach other tabs from the file that ``project`` was saved to; their blocks become unsaved."""
        for other in self._projects:
            if other is not project and other.path == project.path:
                other.detach_file()
        self.revision += 1

    # -- common input --------------------------------------------------------------------------------------

    def set_connected(self, robots: Sequence[Robot]) -> None:
        """Set the robots that are connected, whose blocks can be used."""
        self._robots = tuple(robots)
        for project in self._projects:
            project.set_connected(robots)

    def set_topics(self, topics: Sequence[str]) -> None:
        """Set the names of the topics that the editor suggests."""
        self._topics = tuple(topics)
        for project in self._projects:
            project.set_topics(topics)

    @property
    def definitions_revision(self) -> object:
        """Value that differs from its previous value if `definitions` may have changed."""
        return tuple((each.key, each.definitions_revision, len(each.robots)) for each in self._projects)

    def definitions(self) -> Mapping[str, object]:
        """Return the block and toolbox definitions for the editor, shared by all tabs.

        The definitions cover the connected robots and the robots used in any open behaviour, so that
        hidden tabs keep their blocks.
        """
        absent = {robot.name: robot for project in self._projects for robot in project.absent_robots}
        return toolbox.editor_definitions(self._robots, tuple(absent.values()), self._topics)

    @property
    def journal_error(self) -> str | None:
        """Reason why unsaved work of a behaviour can't be written; None if there is no error."""
        return next((each.journal_error for each in self._projects if each.journal_error), None)

    def retry_journals(self) -> list[OpenProject]:
        """Retry failed journal writes; return the behaviours whose unsaved work still can't be written.

        Called when the window closes.
        """
        return [each for each in self._projects if not each.retry_journal()]

    def close_all(self) -> None:
        """Close all projects and background threads when the window closes.

        Unsaved work stays in the journals.
        """
        for project in self._projects:
            project.close()
        self._compiler.close()
        self._journal_writer.close()

    # -- between sessions --------------------------------------------------------------------------------

    def tabs_state(self) -> dict[str, object]:
        """Return the open tabs as JSON data for the settings."""
        tabs = [
            {"path": str(each.path) if each.path is not None else None, "journal": each.journal_name}
            for each in self._projects
            if not each.is_blank
        ]
        listed_projects = [each for each in self._projects if not each.is_blank]
        return {
            "tabs": tabs,
            "current": listed_projects.index(self.current) if self.current in listed_projects else 0,
        }

    def restore_tabs(
        self,
        tabs_state: Mapping[str, object],
        unsaved_work: Iterable[UnsavedWork],
        *,
        has_ended_normally: bool,
    ) -> set[Path]:
        """Restore the tabs of the last session; return the paths of the journals that were restored.

        Args:
            tabs_state: Result of `tabs_state` in the last session.
            unsaved_work: Unsaved work found at the start.
            has_ended_normally: True if the last session ended normally; then unsaved work is restored without
                asking.
        """
        tabs, current = tabs_state.get("tabs"), tabs_state.get("current")
        unsaved = {each.journal.name: each for each in unsaved_work} if has_ended_normally else {}
        restored: set[Path] = set()
        projects_by_tab: dict[int, OpenProject] = {}
        for number, tab in enumerate(tabs if isinstance(tabs, list) else ()):
            if not isinstance(tab, Mapping):
                continue
            entry = unsaved.get(str(tab.get("journal")))
            project = self._restore_tab(tab.get("path"), entry)
            if project is not None:
                projects_by_tab[number] = project
            if entry is not None:
                restored.add(entry.journal)
        if isinstance(current, int) and current in projects_by_tab:
            self.show(projects_by_tab[current])
        return restored

    def arrange_tabs(self, tabs_state: Mapping[str, object], recovered: Mapping[str, OpenProject]) -> None:
        """Move recovered work to the positions of its tabs, and show the tab that was current.

        Tabs opened since the start are moved to the end.

        Args:
            tabs_state: Result of `tabs_state` in the last session.
            recovered: Recovered projects by journal name.
        """
        tabs, current = tabs_state.get("tabs"), tabs_state.get("current")
        projects_by_tab: dict[int, OpenProject] = {}
        for number, tab in enumerate(tabs if isinstance(tabs, list) else ()):
            if isinstance(tab, Mapping):
                path = tab.get("path")
                project = recovered.get(str(tab.get("journal")))
                if project is None and isinstance(path, str):
                    project = self.find_by_path(Path(path))
                if project is not None and project not in projects_by_tab.values():
                    projects_by_tab[number] = project
        ordered = list(projects_by_tab.values())
        self._projects = [*ordered, *(each for each in self._projects if each not in ordered)]
        if isinstance(current, int) and current in projects_by_tab:
            self.current = projects_by_tab[current]
        self.revision += 1

    def _restore_tab(self, path: object, unsaved: UnsavedWork | None) -> OpenProject | None:
        if unsaved is not None:
            return self.recover(unsaved)
        if not isinstance(path, str) or not Path(path).is_file():
            return None
        try:
            return self.open(Path(path))
        except DocumentError:
            return None  # the file stays in Recent; opening it there reports the problem

    # -- private -----------------------------------------------------------------------------------------

    def _new_project(self) -> OpenProject:
        project = self._create_project()
        project.compiler, project.journal_writer = self._compiler, self._journal_writer
        project.set_connected(self._robots)
        project.set_topics(self._topics)
        return project

    def _open_with(self, fill: Callable[[OpenProject], None]) -> OpenProject:
        if self.current.is_blank:
            fill(self.current)
            return self._make_current(self.current)
        project = self._new_project()
        fill(project)
        return self._insert(project)

    def _insert(self, project: OpenProject) -> OpenProject:
        self._projects.insert(self._projects.index(self.current) + 1, project)
        return self._make_current(project)

    def _make_current(self, project: OpenProject) -> OpenProject:
        self.current = project
        self.revision += 1
        return project

    def _assign_unique_name(self, project: OpenProject) -> OpenProject:
        # A behaviour without a file gets a unique name.
        project.name = self._free_name(project.name, excluding=project)
        return project

    def _free_name(self, base_name: str, excluding: OpenProject | None = None) -> str:
        names = {each.name.casefold() for each in self._projects if each is not excluding}
        number, name = 2, base_name
        while name.casefold() in names:
            name = f"{base_name} {number}"
            number += 1
        return name
