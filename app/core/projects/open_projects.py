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

    def __init__(self, create_document: Callable[[], OpenProject] = OpenProject) -> None:
        self._create_document = create_document
        self._robots: tuple[Robot, ...] = ()
        self._topics: tuple[str, ...] = ()
        self._closed_paths: list[Path] = []
        self._compiler: BackgroundWorker[CompiledProgram] = BackgroundWorker("studio-compiler")
        # a separate worker, so that unsaved work never waits for a long compilation
        self._journal_writer: BackgroundWorker[Path] = BackgroundWorker("studio-journal")
        self.revision = 0
        self.current = self._new_document()
        self._documents = [self.current]

    def __iter__(self) -> Iterator[OpenProject]:
        # In the order of the tabs.
        return iter(tuple(self._documents))

    def __len__(self) -> int:
        return len(self._documents)

    @property
    def can_reopen(self) -> bool:
        """True if a closed tab can be reopened."""
        return bool(self._closed_paths)

    # -- opening -----------------------------------------------------------------------------------------

    def new(self) -> OpenProject:
        """Open an empty behaviour in a new tab, or in the current tab if that is empty and unchanged."""
        if self.current.is_blank:
            return self.current
        document = self._new_document()
        document.new(self._free_name(_(DEFAULT_NAME)))
        return self._insert(document)

    def open(self, path: Path) -> OpenProject:
        """Open a file in a new tab, or switch to its tab. If DocumentError is raised, nothing has changed."""
        open_document = self.find_by_path(path)
        if open_document is not None:
            return self._make_current(open_document)
        return self._open_with(lambda document: document.open(path))

    def open_example(self, path: Path) -> OpenProject:
        """Open an example as a new behaviour in a tab.

        A blank current tab is reused. If DocumentError is raised because the file can't be read,
        nothing has changed.
        """
        return self._assign_unique_name(self._open_with(lambda document: document.open_example(path)))

    def copy(self, path: Path, name: str) -> OpenProject:
        """Open a file as a new behaviour in a tab, named ``name`` (made unique).

        A blank current tab is reused. If DocumentError is raised because the file can't be read,
        nothing has changed.
        """
        return self._assign_unique_name(self._open_with(lambda document: document.copy(path, name)))

    def duplicate(self, document: OpenProject) -> OpenProject:
        """Open a copy of a behaviour in a tab next to it."""
        self.show(document)
        copy = self._new_document()
        copy.duplicate(document, self._free_name(_("{name} copy").format(name=document.name)))
        return self._insert(copy)

    def rename(self, document: OpenProject, name: str) -> None:
        """Rename a behaviour and its file. If DocumentError is raised, nothing has changed."""
        old_path = document.path
        document.rename_to(name)
        self._closed_paths = [
            document.path if each == old_path and document.path else each for each in self._closed_paths
        ]
        self.revision += 1

    def recover(self, unsaved: UnsavedWork) -> OpenProject:
        """Restore unsaved work into the tab of its file, or into another tab.

        Another tab is used if the file isn't open, or if its tab contains unsaved changes.
        """
        open_document = self.find_by_path(unsaved.path) if unsaved.path is not None else None
        if open_document is None or open_document.dirty:
            return self._open_with(lambda document: document.recover(unsaved))
        open_document.recover(unsaved)
        return self._make_current(open_document)

    def find_by_path(self, path: Path) -> OpenProject | None:
        """Return the open behaviour whose file is ``path``, or None."""
        resolved = path.resolve()
        return next((each for each in self._documents if each.path and each.path.resolve() == resolved), None)

    def find_by_key(self, key: str) -> OpenProject | None:
        """Return the open behaviour with this key, or None."""
        return next((each for each in self._documents if each.key == key), None)

    def title(self, document: OpenProject) -> str:
        """Return the title of a behaviour, unique among the open behaviours."""
        documents = [*self._documents, *([document] if document not in self._documents else [])]
        return unique_titles([(each.name, each.path) for each in documents])[documents.index(document)]

    # -- tabs --------------------------------------------------------------------------------------------

    def show(self, document: OpenProject) -> None:
        """Make an open behaviour the current one."""
        if document in self._documents and document is not self.current:
            self._make_current(document)

    def neighbour(self, step: int) -> OpenProject:
        """Return the behaviour ``step`` tabs to the right of the current one, wrapping around at the ends."""
        return self._documents[(self._documents.index(self.current) + step) % len(self._documents)]

    def move(self, document: OpenProject, index: int) -> None:
        """Move a tab to an index, counted from 0."""
        if document in self._documents and self._documents.index(document) != index:
            self._documents.remove(document)
            self._documents.insert(max(0, index), document)
            self.revision += 1

    def close(self, document: OpenProject) -> None:
        """Close a tab. Unsaved work must be saved before; otherwise it is offered again at the next start.

        The last tab is replaced with an empty behaviour.
        """
        if document not in self._documents:
            return
        index = self._documents.index(document)
        if document.path is not None:
            self._closed_paths = [
                *(each for each in self._closed_paths if each != document.path),
                document.path,
            ]
            del self._closed_paths[:-MAX_CLOSED_TABS]
        document.close()
        self._compiler.discard(document.key)
        self._documents.remove(document)
        if not self._documents:
            self._documents.append(self._new_document())
        if document is self.current:
            self.current = self._documents[min(index, len(self._documents) - 1)]
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

    def on_saved(self, document: OpenProject) -> None:
        """Detach other tabs from the file that ``document`` was saved to; their blocks become unsaved."""
        for other in self._documents:
            if other is not document and other.path == document.path:
                other.detach_file()
        self.revision += 1

    # -- common input --------------------------------------------------------------------------------------

    def set_connected(self, robots: Sequence[Robot]) -> None:
        """Set the robots that are connected, whose blocks can be used."""
        self._robots = tuple(robots)
        for document in self._documents:
            document.set_connected(robots)

    def set_topics(self, topics: Sequence[str]) -> None:
        """Set the names of the topics that the editor suggests."""
        self._topics = tuple(topics)
        for document in self._documents:
            document.set_topics(topics)

    @property
    def definitions_revision(self) -> object:
        """Value that differs from its previous value if `definitions` may have changed."""
        return tuple((each.key, each.definitions_revision, len(each.robots)) for each in self._documents)

    def definitions(self) -> Mapping[str, object]:
        """Return the block and toolbox definitions for the editor, shared by all tabs.

        The definitions cover the connected robots and the robots used in any open behaviour, so that
        hidden tabs keep their blocks.
        """
        absent = {robot.name: robot for document in self._documents for robot in document.absent_robots}
        return toolbox.editor_definitions(self._robots, tuple(absent.values()), self._topics)

    @property
    def journal_error(self) -> str | None:
        """Reason why unsaved work of a behaviour can't be written; None if there is no error."""
        return next((each.journal_error for each in self._documents if each.journal_error), None)

    def retry_journals(self) -> list[OpenProject]:
        """Retry failed journal writes; return the behaviours whose unsaved work still can't be written.

        Called when the window closes.
        """
        return [each for each in self._documents if not each.retry_journal()]

    def close_all(self) -> None:
        """Close all documents and background threads when the window closes.

        Unsaved work stays in the journals.
        """
        for document in self._documents:
            document.close()
        self._compiler.close()
        self._journal_writer.close()

    # -- between sessions --------------------------------------------------------------------------------

    def tabs_state(self) -> dict[str, object]:
        """Return the open tabs as JSON data for the settings."""
        tabs = [
            {"path": str(each.path) if each.path is not None else None, "journal": each.journal_name}
            for each in self._documents
            if not each.is_blank
        ]
        listed_documents = [each for each in self._documents if not each.is_blank]
        return {
            "tabs": tabs,
            "current": listed_documents.index(self.current) if self.current in listed_documents else 0,
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
        documents_by_tab: dict[int, OpenProject] = {}
        for number, tab in enumerate(tabs if isinstance(tabs, list) else ()):
            if not isinstance(tab, Mapping):
                continue
            entry = unsaved.get(str(tab.get("journal")))
            document = self._restore_tab(tab.get("path"), entry)
            if document is not None:
                documents_by_tab[number] = document
            if entry is not None:
                restored.add(entry.journal)
        if isinstance(current, int) and current in documents_by_tab:
            self.show(documents_by_tab[current])
        return restored

    def arrange_tabs(self, tabs_state: Mapping[str, object], recovered: Mapping[str, OpenProject]) -> None:
        """Move recovered work to the positions of its tabs, and show the tab that was current.

        Tabs opened since the start are moved to the end.

        Args:
            tabs_state: Result of `tabs_state` in the last session.
            recovered: Recovered documents by journal name.
        """
        tabs, current = tabs_state.get("tabs"), tabs_state.get("current")
        documents_by_tab: dict[int, OpenProject] = {}
        for number, tab in enumerate(tabs if isinstance(tabs, list) else ()):
            if isinstance(tab, Mapping):
                path = tab.get("path")
                document = recovered.get(str(tab.get("journal")))
                if document is None and isinstance(path, str):
                    document = self.find_by_path(Path(path))
                if document is not None and document not in documents_by_tab.values():
                    documents_by_tab[number] = document
        ordered = list(documents_by_tab.values())
        self._documents = [*ordered, *(each for each in self._documents if each not in ordered)]
        if isinstance(current, int) and current in documents_by_tab:
            self.current = documents_by_tab[current]
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

    def _new_document(self) -> OpenProject:
        document = self._create_document()
        document.compiler, document.journal_writer = self._compiler, self._journal_writer
        document.set_connected(self._robots)
        document.set_topics(self._topics)
        return document

    def _open_with(self, fill: Callable[[OpenProject], None]) -> OpenProject:
        if self.current.is_blank:
            fill(self.current)
            return self._make_current(self.current)
        document = self._new_document()
        fill(document)
        return self._insert(document)

    def _insert(self, document: OpenProject) -> OpenProject:
        self._documents.insert(self._documents.index(self.current) + 1, document)
        return self._make_current(document)

    def _make_current(self, document: OpenProject) -> OpenProject:
        self.current = document
        self.revision += 1
        return document

    def _assign_unique_name(self, document: OpenProject) -> OpenProject:
        # A behaviour without a file gets a unique name.
        document.name = self._free_name(document.name, excluding=document)
        return document

    def _free_name(self, base_name: str, excluding: OpenProject | None = None) -> str:
        names = {each.name.casefold() for each in self._documents if each is not excluding}
        number, name = 2, base_name
        while name.casefold() in names:
            name = f"{base_name} {number}"
            number += 1
        return name
