"""The title of the behaviour: the open ones as tabs, undo and redo, and Blocks or Python."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.ui.panels.behaviour.tabs import BehaviourTabs
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, Segments


class BehaviourTitle(QWidget):
    """Fills the title's row of the behaviour panel."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.tabs = BehaviourTabs(theme)
        self.undo = IconButton(theme, "rotate-ccw", "Undo", "Ctrl+Z", size=32)
        self.redo = IconButton(theme, "rotate-cw", "Redo", "Ctrl+Shift+Z", size=32)
        self.undo.setProperty("command", "edit.undo")
        self.redo.setProperty("command", "edit.redo")
        self.copy = Button(theme, "Copy", "copy", size="small")
        self.copy.setAccessibleName("Copy the program")
        self.copy.hide()
        self.mode = Segments(theme, [("blocks", "Blocks", None), ("python", "Python", None)], name="Show as")
        for button in (self.undo, self.redo):
            button.setEnabled(False)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        row.addWidget(self.tabs, 1)
        for widget in (self.undo, self.redo, self.copy):
            row.addWidget(widget)
        row.addSpacing(8)
        row.addWidget(self.mode)

    def show_mode(self, mode: str) -> None:
        """Undo and redo belong to the blocks, copy to the program."""
        self.mode.set_value(mode)
        self.undo.setVisible(mode == "blocks")
        self.redo.setVisible(mode == "blocks")
        self.copy.setVisible(mode == "python")
