"""What the window knows of the behaviours in the block editor, whether its page is there or not."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.core.documents.workspace_json import EMPTY, WorkspaceJson


@dataclass
class Tab:
    """One behaviour: its newest program, and what its blocks show of a run."""

    key: str
    program: WorkspaceJson
    generation: int
    in_page: bool = False  # the page holds it, with its undo, zoom and scroll position
    states: dict[str, object] = field(default_factory=dict)


class Tabs:
    """The behaviours that are open, one of them shown.

    The first has the key "" and is empty: it stands for "nothing opened yet", and goes when a real one comes.
    """

    def __init__(self) -> None:
        self._generations = 0
        self._tabs: dict[str, Tab] = {}
        self.shown = self._make("", WorkspaceJson.of(EMPTY))

    def __getitem__(self, key: str) -> Tab | None:
        return self._tabs.get(key)

    def show(self, key: str, program: WorkspaceJson) -> str | None:
        """Turn to this one; ``program`` counts the first time. The key of a tab that went for it."""
        before = self.shown
        self.shown = self._tabs.get(key) or self._make(key, program)
        if before.key or before is self.shown:
            return None
        del self._tabs[""]
        return ""

    def close(self, key: str) -> bool:
        """Forget this one; whether there was such a one."""
        gone = self._tabs.pop(key, None)
        if gone is not None and gone is self.shown:
            self.shown = self._make("", WorkspaceJson.of(EMPTY))
        return gone is not None

    def replace(self, program: WorkspaceJson) -> None:
        """Put another program in the place of the shown one; edits of the old one no longer count."""
        self._generations += 1
        self.shown.generation = self._generations
        self.shown.program = program
        self.shown.states.clear()

    def edited(self, key: str, generation: int) -> Tab | None:
        """The tab which an edit belongs to; None when it was closed or its program replaced meanwhile."""
        tab = self._tabs.get(key)
        return tab if tab is not None and tab.generation == generation else None

    def page_gone(self) -> None:
        """The page and everything in it is lost."""
        for tab in self._tabs.values():
            tab.in_page = False

    def _make(self, key: str, program: WorkspaceJson) -> Tab:
        self._generations += 1
        self._tabs[key] = Tab(key, program, self._generations)
        return self._tabs[key]
