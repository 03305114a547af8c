"""Open behaviours of the block editor, independent of whether the page is loaded."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.blocks.model.workspace_json import EMPTY_WORKSPACE, WorkspaceJson
from app.ui.blockly.messages import BlockState


@dataclass
class Tab:
    """Open behaviour in the block editor.

    Attributes:
        key: Key of the behaviour.
        workspace: Latest workspace, in Blockly's JSON format.
        generation: Number that changes when the workspace is replaced, to detect outdated edits.
        is_loaded: True if the page has loaded the tab.
        states: Newest message of each state of the blocks, such as highlights, by its type.
    """

    key: str
    workspace: WorkspaceJson
    generation: int
    is_loaded: bool = False  # loaded in the page, with undo stack, zoom and scroll position
    states: dict[type[BlockState], BlockState] = field(default_factory=dict)


class Tabs:
    """Open behaviours, exactly one of which is shown.

    The first tab has the key "" and is an empty placeholder until a behaviour is opened.

    Attributes:
        shown_tab: Tab that is shown.
    """

    def __init__(self) -> None:
        self._generations = 0
        self._tabs: dict[str, Tab] = {}
        self.shown_tab = self._create_tab("", WorkspaceJson.from_blocks(EMPTY_WORKSPACE))

    def __getitem__(self, key: str) -> Tab | None:
        return self._tabs.get(key)

    def show(self, key: str, workspace: WorkspaceJson) -> str | None:
        """Show a tab, which is created if necessary.

        Args:
            key: Key of the behaviour.
            workspace: Workspace for a new tab; not used for an existing one.

        Returns:
            The key of the placeholder if it was removed, else None.
        """
        previous = self.shown_tab
        self.shown_tab = self._tabs.get(key) or self._create_tab(key, workspace)
        if previous.key or previous is self.shown_tab:
            return None
        del self._tabs[""]
        return ""

    def close(self, key: str) -> bool:
        """Remove a tab; return False if it doesn't exist. The placeholder replaces the shown tab."""
        tab = self._tabs.pop(key, None)
        if tab is not None and tab is self.shown_tab:
            self.shown_tab = self._create_tab("", WorkspaceJson.from_blocks(EMPTY_WORKSPACE))
        return tab is not None

    def replace(self, workspace: WorkspaceJson) -> None:
        """Replace the workspace of the shown tab; `tab_for_edit` rejects later edits of the old workspace."""
        self._generations += 1
        self.shown_tab.generation = self._generations
        self.shown_tab.workspace = workspace
        self.shown_tab.states.clear()

    def tab_for_edit(self, key: str, generation: int) -> Tab | None:
        """Return the tab to which an edit belongs; None if the tab was closed or its workspace was replaced.

        Args:
            key: Key of the behaviour.
            generation: Value of `Tab.generation` when the edited workspace was loaded.
        """
        tab = self._tabs.get(key)
        return tab if tab is not None and tab.generation == generation else None

    def mark_unloaded(self) -> None:
        """Mark all tabs as not loaded after the page was lost."""
        for tab in self._tabs.values():
            tab.is_loaded = False

    def _create_tab(self, key: str, workspace: WorkspaceJson) -> Tab:
        self._generations += 1
        self._tabs[key] = Tab(key, workspace, self._generations)
        return self._tabs[key]
