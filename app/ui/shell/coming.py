"""What shows in place of a layout that is made in a moment: Studio's start does not wait for its panels."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.ui.widgets import label

WORDS = {"behaviour": "Getting the blocks ready."}
OTHERS = "Getting the panels ready."


class Coming(QWidget):
    """One quiet sentence in the middle."""

    def __init__(self, layout: str) -> None:
        super().__init__()
        words = WORDS.get(layout, OTHERS)
        self.setAccessibleName(words)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setProperty("ownFocus", True)  # it only keeps the keyboard; there is nothing to ring
        column = QVBoxLayout(self)
        column.addWidget(label(words, "bodyLarge", role="textSecondary"), 1, Qt.AlignmentFlag.AlignCenter)
