"""The title of the behaviour: its name as a tab, undo and redo, and Blocks or Python."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.ui.icons import paint_icon
from app.ui.theme import Theme
from app.ui.widgets import Button, IconButton, Segments, paint

LONGEST_NAME = 280


class BehaviourTab(QWidget):
    """The name of the behaviour that is open; a dot after it while it is not saved."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._name, self._dirty = "", False
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)

    def show_name(self, name: str, dirty: bool) -> None:
        """The name now, and whether there is anything to save."""
        if (name, dirty) != (self._name, self._dirty):
            self._name, self._dirty = name, dirty
            self.setAccessibleName(f"{name}{', not saved' if dirty else ''}")
            self.setToolTip(f"{name}{' (not saved)' if dirty else ''}")
            self.updateGeometry()
            self.update()

    def sizeHint(self) -> QSize:
        width = min(LONGEST_NAME, paint.width_of(self._theme.font("label"), self._name) + 8)
        height = max(28, round(paint.height_of(self._theme.font("label"))) + 6)
        return QSize(round(width) + 12 + 16 + 8 + 10 + (12 if self._dirty else 0), height)

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect())
        ink = theme.colour("selectedText")
        paint.box(painter, rect, theme.radius("small"), theme.colour("selected"))
        paint_icon(painter, QRectF(12, rect.center().y() - 8, 16, 16), "blocks", ink)
        font = theme.font("label")
        font.setWeight(font.Weight.DemiBold)
        words = rect.adjusted(36, 0, -10 - (12 if self._dirty else 0), 0)
        paint.words(painter, words, self._name, font, ink)
        if self._dirty:
            paint_icon(painter, QRectF(rect.right() - 20, rect.center().y() - 5, 10, 10), "dot", ink)
        painter.end()


class BehaviourTitle(QWidget):
    """Fills the title's row of the behaviour panel."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.tab = BehaviourTab(theme)
        self.undo = IconButton(theme, "rotate-ccw", "Undo", "Ctrl+Z", size=32)
        self.redo = IconButton(theme, "rotate-cw", "Redo", "Ctrl+Shift+Z", size=32)
        self.copy = Button(theme, "Copy", "copy", size="small")
        self.copy.setAccessibleName("Copy the program")
        self.copy.hide()
        self.mode = Segments(theme, [("blocks", "Blocks", None), ("python", "Python", None)], name="Show as")
        for button in (self.undo, self.redo):
            button.setEnabled(False)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        row.addWidget(self.tab)
        row.addStretch(1)
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
