"""Actions of the inspector for menus and the keyboard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QKeyCombination, QObject, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeyEvent, QKeySequence

from app.ui.panels.watch.inspector.tree_model import field_of
from app.ui.panels.watch.inspector.values import clipboard_text
from nep.i18n import _

if TYPE_CHECKING:
    from collections.abc import Callable

    from PySide6.QtWidgets import QWidget

    from app.ui.panels.watch.inspector.body import InspectorBody
    from app.ui.panels.watch.inspector.tree_model import TreeNode
    from app.ui.theme.theme import Theme
    from nep.messages.message import Message


FIND_KEY = QKeyCombination(Qt.KeyboardModifier.ControlModifier, Qt.Key.Key_F)


class InspectorActions(QObject):
    """Actions to copy, plot and find values, and to step through messages.

    Args:
        panel: Panel in which the shortcuts work.
        body: Contents of the panel.
        current_message: Returns the message shown, or None.
        value: Returns the decoded payload of the message shown.
        find: Gives the find field the focus.
        toast: Shows a toast.
        plot: Plots the field with a path.
    """

    def __init__(
        self,
        theme: Theme,
        panel: QWidget,
        body: InspectorBody,
        current_message: Callable[[], Message | None],
        value: Callable[[], object],
        *,
        find: Callable[[], object],
        toast: Callable[[str], None],
        plot: Callable[[str], object],
    ) -> None:
        super().__init__(panel)
        self._body, self._current_message, self._value, self._toast, self._plot = (
            body,
            current_message,
            value,
            toast,
            plot,
        )
        rows: tuple[tuple[str, str, str, Callable[[], object]], ...] = (
            (_("Copy value"), "Ctrl+C", "copy", self.copy_value),
            (_("Copy path"), "Ctrl+Shift+C", "link", self.copy_path),
            (_("Copy the message as JSON"), "Ctrl+Shift+J", "braces", self.copy_message),
            (_("Plot"), "Ctrl+Shift+L", "chart-line", self.plot),
            (_("Find a key or value"), "Ctrl+F", "search", find),
            (_("Next"), "F3", "", lambda: body.finder.step(1)),
            (_("Previous"), "Shift+F3", "", lambda: body.finder.step(-1)),
            (_("Previous message"), "Alt+Left", "step-back", lambda: body.history.step(-1)),
            (_("Next message"), "Alt+Right", "step-forward", lambda: body.history.step(1)),
        )
        self._find = find
        panel.installEventFilter(self)
        self._actions: list[QAction] = []
        for text, key, icon, callback in rows:
            action = QAction(text, panel)
            action.setShortcut(QKeySequence(key))
            action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            if icon:
                action.setIcon(theme.icon(icon))
            action.triggered.connect(lambda _on=False, callback=callback: callback())
            (body.tree if key.endswith("C") else panel).addAction(action)  # text fields have their own Ctrl+C
            self._actions.append(action)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # Ctrl+F searches the panel; without this filter, the window's shortcut would search the blocks.
        if isinstance(event, QKeyEvent) and event.keyCombination() == FIND_KEY:
            if event.type() == QEvent.Type.ShortcutOverride:
                event.accept()
                return True
            if event.type() == QEvent.Type.KeyPress:
                self._find()
                return True
        return super().eventFilter(watched, event)

    def menu_actions(self) -> list[QAction]:
        """Return all actions, for a menu."""
        return list(self._actions)

    def set_enabled(self, has_message: bool) -> None:
        """Enable or disable all actions.

        Args:
            has_message: True if the tree shows a message.
        """
        for action in self._actions:
            action.setEnabled(has_message)

    def copy_value(self) -> None:
        """Copy the selected value to the clipboard."""
        node = self._selected_node()
        if node is not None:
            self._copy_text(clipboard_text(node.value), _("Copied {path}").format(path=node.path))

    def copy_path(self) -> None:
        """Copy the field path of the selected value to the clipboard."""
        node = self._selected_node()
        if node is not None:
            self._copy_text(node.path, _("Copied the path {path}").format(path=node.path))

    def plot(self) -> None:
        """Plot the selected value; if it can't be plotted, show the reason in a toast.

        Numbers, texts, booleans and lists of numbers can be plotted.
        """
        node = self._selected_node()
        path = field_of(node) if node is not None else ""
        if path:
            self._plot(path)
        elif node is not None:
            template = _(
                "Can't plot {path}. Only numbers, texts, booleans and lists of numbers can be plotted."
            )
            self._toast(template.format(path=node.path))

    def copy_message(self) -> None:
        """Copy the whole message to the clipboard.

        JSON payloads are copied unchanged, others are converted to JSON.
        """
        message = self._current_message()
        if message is None:
            return
        if message.codec == "json":
            text = str(message.data, "utf-8", "replace")
        else:
            text = clipboard_text(self._value())
        self._copy_text(text, _("Copied the message of {topic}").format(topic=message.topic))

    def _selected_node(self) -> TreeNode | None:
        index = self._body.tree.currentIndex()
        return self._body.model.node(index) if index.isValid() else None

    def _copy_text(self, text: str, message: str) -> None:
        QGuiApplication.clipboard().setText(text)
        self._toast(message)
