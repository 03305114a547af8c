"""The behaviours that are open, as tabs: one of them is current, each has its own file, journal and mark.

The tabs come back at the next start (`kept`, `put_back`); those that were closed can be opened again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from app.blocks import editor_definitions
from app.core.documents.background_worker import BackgroundWorker
from app.core.documents.document import UNNAMED, Compiled, Document
from app.core.documents.journal import Unsaved
from app.core.documents.titles import told_apart
from app.errors import DocumentError
from app.robots.description.description import Robot
from nep.i18n import _

CLOSED_KEPT = 20


class Documents:
    """All open behaviours; there is always at least one. ``revision`` grows when the tabs change."""

    def __init__(self, make: Callable[[], Document] = Document) -> None:
        """``make`` gives each new document."""
        self._make = make
        self._robots: tuple[Robot, ...] = ()
        self._topics: tuple[str, ...] = ()
        self._closed: list[Path] = []
        self._compiler: BackgroundWorker[Compiled] = BackgroundWorker("studio-compiler")
        # of its own: unsaved work never waits for a long compilation
        self._journal_writer: BackgroundWorker[bool] = BackgroundWorker("studio-journal")
        self.revision = 0
        self.current = self._made()
        self._open = [self.current]

    def __iter__(self) -> Iterator[Document]:
        """In the order of their tabs."""
        return iter(tuple(self._open))

    def __len__(self) -> int:
        return len(self._open)

    @property
    def can_reopen(self) -> bool:
        """Whether a tab was closed whose file can be opened again."""
        return bool(self._closed)

    # -- opening -----------------------------------------------------------------------------------------

    def new(self) -> Document:
        """Begin an empty behaviour in a tab of its own; an untouched one is taken as it is."""
        if self.current.blank:
            return self.current
        made = self._made()
        made.new(self._free_name(_(UNNAMED)))
        return self._put(made)

    def open(self, path: Path) -> Document:
        """Open a file in a tab, or show the tab that has it. Raises DocumentError; then nothing changed."""
        there = self.with_path(path)
        if there is not None:
            return self._shown(there)
        return self._filled(lambda document: document.open(path))

    def example(self, path: Path) -> Document:
        """Open an example as a new behaviour in a tab. Raises DocumentError."""
        return self._named_apart(self._filled(lambda document: document.example(path)))

    def copy(self, path: Path, name: str) -> Document:
        """Open a file as a new behaviour of another name in a tab. Raises DocumentError."""
        return self._named_apart(self._filled(lambda document: document.copy(path, name)))

    def duplicate(self, document: Document) -> Document:
        """Open a new behaviour with the same blocks, in the tab beside it."""
        self.show(document)
        made = self._made()
        made.duplicate(document, self._free_name(_("{name} copy").format(name=document.name)))
        return self._put(made)

    def rename(self, document: Document, name: str) -> None:
        """Give a behaviour another name, and its file. Raises DocumentError; then nothing changed."""
        before = document.path
        document.rename_to(name)
        self._closed = [document.path if each == before and document.path else each for each in self._closed]
        self.revision += 1

    def recover(self, unsaved: Unsaved) -> Document:
        """Put back unsaved work: into the tab that has its file, else into a tab of its own."""
        there = self.with_path(unsaved.path) if unsaved.path is not None else None
        if there is None or there.dirty:
            return self._filled(lambda document: document.recover(unsaved))
        there.recover(unsaved)
        return self._shown(there)

    def with_path(self, path: Path) -> Document | None:
        """The open behaviour of that file."""
        wanted = path.resolve()
        return next((each for each in self._open if each.path and each.path.resolve() == wanted), None)

    def with_key(self, key: str) -> Document | None:
        """The open behaviour of that key."""
        return next((each for each in self._open if each.key == key), None)

    def title(self, document: Document) -> str:
        """What an open behaviour is called: no two of them are called the same."""
        opened = [*self._open, *([document] if document not in self._open else [])]
        return told_apart([(each.name, each.path) for each in opened])[opened.index(document)]

    # -- tabs --------------------------------------------------------------------------------------------

    def show(self, document: Document) -> None:
        """Make an open behaviour the current one."""
        if document in self._open and document is not self.current:
            self._shown(document)

    def neighbour(self, step: int) -> Document:
        """The behaviour that many tabs further, round the ends."""
        return self._open[(self._open.index(self.current) + step) % len(self._open)]

    def move(self, document: Document, place: int) -> None:
        """Put a tab to that place, from 0."""
        if document in self._open and self._open.index(document) != place:
            self._open.remove(document)
            self._open.insert(max(0, place), document)
            self.revision += 1

    def close(self, document: Document) -> None:
        """Close a tab; who calls has put its unsaved work somewhere. An empty behaviour follows the last."""
        if document not in self._open:
            return
        place = self._open.index(document)
        if document.path is not None:
            self._closed = [*(each for each in self._closed if each != document.path), document.path]
            del self._closed[:-CLOSED_KEPT]
        document.close()
        self._compiler.forget(document.key)
        self._open.remove(document)
        if not self._open:
            self._open.append(self._made())
        if document is self.current:
            self.current = self._open[min(place, len(self._open) - 1)]
        self.revision += 1

    def reopen(self) -> Document | None:
        """Open the tab that was closed last; None when there is none. Raises DocumentError."""
        while self._closed:
            path = self._closed.pop()
            if self.with_path(path) is None:
                return self.open(path)
        return None

    def saved(self, document: Document) -> None:
        """A behaviour was saved: another tab of the same file has lost it, and keeps its blocks unsaved."""
        for other in self._open:
            if other is not document and other.path == document.path:
                other.lose_file()
        self.revision += 1

    # -- what all of them are told -----------------------------------------------------------------------

    def set_connected(self, robots: Sequence[Robot]) -> None:
        """The robots that are connected now."""
        self._robots = tuple(robots)
        for document in self._open:
            document.set_connected(robots)

    def set_topics(self, topics: Sequence[str]) -> None:
        """The topics that the editor offers to choose from."""
        self._topics = tuple(topics)
        for document in self._open:
            document.set_topics(topics)

    @property
    def definitions_revision(self) -> object:
        """Differs when `definitions` may differ."""
        return tuple((each.key, each.definitions_revision, len(each.robots)) for each in self._open)

    def definitions(self) -> Mapping[str, object]:
        """Blocks and toolbox for the editor: the robots that are connected, and those of any open behaviour.

        They are the same for all tabs, so that a tab that does not show keeps its blocks.
        """
        absent = {robot.name: robot for document in self._open for robot in document.absent}
        return editor_definitions(self._robots, tuple(absent.values()), self._topics)

    @property
    def journal_error(self) -> str | None:
        """Why unsaved work of one of them can't be kept; None when all of it is."""
        return next((each.journal_error for each in self._open if each.journal_error), None)

    def unkept(self) -> list[Document]:
        """Those whose unsaved work can't be kept, also when it is tried once more: the window ends it."""
        return [each for each in self._open if not each.keep_again()]

    def end(self) -> None:
        """The window closes; unsaved work stays in the journals."""
        for document in self._open:
            document.close()
        self._compiler.close()
        self._journal_writer.close()

    # -- from one start to the next ----------------------------------------------------------------------

    def kept(self) -> dict[str, object]:
        """The tabs, as the settings keep them."""
        tabs = [
            {"path": str(each.path) if each.path is not None else None, "journal": each.journal}
            for each in self._open
            if not each.blank
        ]
        shown = [each for each in self._open if not each.blank]
        return {"tabs": tabs, "current": shown.index(self.current) if self.current in shown else 0}

    def put_back(self, kept: Mapping[str, object], left: Iterable[Unsaved], *, ended_well: bool) -> set[Path]:
        """Open the tabs of the last start; the journals that were taken over are returned.

        Unsaved work is taken over when Studio ended well; after a crash a person is asked.
        """
        tabs, current = kept.get("tabs"), kept.get("current")
        unsaved = {each.journal.name: each for each in left} if ended_well else {}
        taken: set[Path] = set()
        opened: dict[int, Document] = {}
        for number, tab in enumerate(tabs if isinstance(tabs, list) else ()):
            if not isinstance(tab, Mapping):
                continue
            found = unsaved.get(str(tab.get("journal")))
            document = self._come_back(tab.get("path"), found)
            if document is not None:
                opened[number] = document
            if found is not None:
                taken.add(found.journal)
        if isinstance(current, int) and current in opened:
            self.show(opened[current])
        return taken

    def arrange(self, kept: Mapping[str, object], recovered: Mapping[str, Document]) -> None:
        """Put unsaved work that was recovered where its tabs were, and show the tab that a person worked on.

        ``recovered`` goes by the names of the journals of then. What was opened since stands behind.
        """
        tabs, current = kept.get("tabs"), kept.get("current")
        found: dict[int, Document] = {}
        for number, tab in enumerate(tabs if isinstance(tabs, list) else ()):
            if isinstance(tab, Mapping):
                path = tab.get("path")
                document = recovered.get(str(tab.get("journal")))
                if document is None and isinstance(path, str):
                    document = self.with_path(Path(path))
                if document is not None and document not in found.values():
                    found[number] = document
        placed = list(found.values())
        self._open = [*placed, *(each for each in self._open if each not in placed)]
        if isinstance(current, int) and current in found:
            self.current = found[current]
        self.revision += 1

    def _come_back(self, path: object, unsaved: Unsaved | None) -> Document | None:
        if unsaved is not None:
            return self.recover(unsaved)
        if not isinstance(path, str) or not Path(path).is_file():
            return None
        try:
            return self.open(Path(path))
        except DocumentError:
            return None  # the file is kept in Recent; opening it there says what is wrong

    # -- inside ------------------------------------------------------------------------------------------

    def _made(self) -> Document:
        made = self._make()
        made.compiler, made.journal_writer = self._compiler, self._journal_writer
        made.set_connected(self._robots)
        made.set_topics(self._topics)
        return made

    def _filled(self, fill: Callable[[Document], None]) -> Document:
        if self.current.blank:
            fill(self.current)
            return self._shown(self.current)
        made = self._made()
        fill(made)
        return self._put(made)

    def _put(self, made: Document) -> Document:
        self._open.insert(self._open.index(self.current) + 1, made)
        return self._shown(made)

    def _shown(self, document: Document) -> Document:
        self.current = document
        self.revision += 1
        return document

    def _named_apart(self, document: Document) -> Document:
        """One without a file gets a name that no other has."""
        document.name = self._free_name(document.name, besides=document)
        return document

    def _free_name(self, wanted: str, besides: Document | None = None) -> str:
        names = {each.name.casefold() for each in self._open if each is not besides}
        number, name = 2, wanted
        while name.casefold() in names:
            name = f"{wanted} {number}"
            number += 1
        return name
