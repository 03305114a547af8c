"""What a person can do with the message in the inspector: in its menus and by keys."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence

from app.ui.inspector_parts import plain_words

if TYPE_CHECKING:
    from collections.abc import Callable

    from app.ui.panels.inspector import InspectorPanel
    from app.ui.tree import Node


class InspectorActions(QObject):
    """Copy a value, its path, or the message; find; compare."""

    def __init__(self, panel: InspectorPanel) -> None:
        super().__init__(panel)
        self._panel = panel
        tree = panel.tree
        rows: tuple[tuple[str, str, str, Callable[[], object]], ...] = (
            ("Copy value", "Ctrl+C", "copy", self.copy_value),
            ("Copy path", "Ctrl+Shift+C", "link", self.copy_path),
            ("Copy the message as JSON", "Ctrl+Shift+J", "braces", self.copy_message),
            ("Find a key or value", "Ctrl+F", "search", panel.focus_filter),
            ("Next one", "F3", "", lambda: panel.finder.step(1)),
            ("Previous one", "Shift+F3", "", lambda: panel.finder.step(-1)),
        )
        self._actions: list[QAction] = []
        for words, key, icon, does in rows:
            action = QAction(words, panel)
            action.setShortcut(QKeySequence(key))
            action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            if icon:
                action.setIcon(panel.theme.icon(icon))
            action.triggered.connect(lambda _on=False, do=does: do())
            (tree if key.endswith("C") else panel).addAction(action)  # fields copy their own text
            self._actions.append(action)

    def listed(self) -> list[QAction]:
        """All of them, for a menu."""
        return list(self._actions)

    def set_enabled(self, there: bool) -> None:
        """Whether there is a message in the tree."""
        for action in self._actions:
            action.setEnabled(there)

    def copy_value(self) -> None:
        """Put the chosen value on the clipboard."""
        node = self._chosen()
        if node is not None:
            self._copied(plain_words(node.value), node.path)

    def copy_path(self) -> None:
        """Put the chosen value's path on the clipboard."""
        node = self._chosen()
        if node is not None:
            self._copied(node.path, f"the path {node.path}")

    def copy_message(self) -> None:
        """Put the whole message on the clipboard: JSON as it was sent, anything else as JSON."""
        message = self._panel.message
        if message is None:
            return
        if message.codec == "json":
            text = str(message.data, "utf-8", "replace")
        else:
            text = plain_words(self._panel.model.value())
        self._copied(text, f"the message of {self._panel.subtitle()}")

    def _chosen(self) -> Node | None:
        """The value that is chosen in the tree."""
        index = self._panel.tree.currentIndex()
        return self._panel.model.node(index) if index.isValid() else None

    def _copied(self, text: str, what: str) -> None:
        QGuiApplication.clipboard().setText(text)
        self._panel.context.toast(f"Copied {what}")
