"""State of the behaviours in the block editor, with or without a loaded page."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.core.documents.workspace_json import EMPTY, WorkspaceJson


@dataclass
class Tab:
    """Behaviour: its newest program, and the run state of its blocks."""

    key: str
    program: WorkspaceJson
    generation: int
    in_page: bool = False  # the page has it, with undo, zoom and scroll position
    states: dict[str, object] = field(default_factory=dict)


class Tabs:
    """Open behaviours, one of them shown.

    The first one has the key "" and is empty: a placeholder until a real one is opened.
    """

    def __init__(self) -> None:
        self._generations = 0
        self._tabs: dict[str, Tab] = {}
        self.shown = self._make("", WorkspaceJson.of(EMPTY))

    def __getitem__(self, key: str) -> Tab | None:
        return self._tabs.get(key)

    def show(self, key: str, program: WorkspaceJson) -> str | None:
        """Show a tab; ``program`` is used the first time.

        Return the key of a removed placeholder, or None.
        """
        before = self.shown
        self.shown = self._tabs.get(key) or self._make(key, program)
        if before.key or before is self.shown:
            return None
        del self._tabs[""]
        return ""

    def close(self, key: str) -> bool:
        """Remove a tab; return whether it existed."""
        gone = self._tabs.pop(key, None)
        if gone is not None and gone is self.shown:
            self.shown = self._make("", WorkspaceJson.of(EMPTY))
        return gone is not None

    def replace(self, program: WorkspaceJson) -> None:
        """Replace the program of the shown tab; pending edits of the old one no longer count."""
        self._generations += 1
        self.shown.generation = self._generations
        self.shown.program = program
        self.shown.states.clear()

    def edited(self, key: str, generation: int) -> Tab | None:
        """Return the tab of an edit; None when it was closed or its program replaced meanwhile."""
        tab = self._tabs.get(key)
        return tab if tab is not None and tab.generation == generation else None

    def page_gone(self) -> None:
        """Mark all tabs as not loaded: the page is lost."""
        for tab in self._tabs.values():
            tab.in_page = False

    def _make(self, key: str, program: WorkspaceJson) -> Tab:
        self._generations += 1
        self._tabs[key] = Tab(key, program, self._generations)
        return self._tabs[key]
