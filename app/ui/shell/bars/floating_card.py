"""A card that lies over a window without darkening it: it keeps its place when either has another size."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QWidget


class FloatingCard(QWidget):
    """Hidden at first. Subclasses say in `place` where it lies."""

    def __init__(self, window: QWidget) -> None:
        """A card over ``window``."""
        super().__init__(window)
        window.installEventFilter(self)
        self.hide()

    def place(self) -> None:
        """Go to its place, with the size that its words need now."""
        raise NotImplementedError

    def event(self, event: QEvent) -> bool:
        done = super().event(event)
        if event.type() == QEvent.Type.LayoutRequest and self.isVisible():
            self.place()
        return done

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self.isVisible():
            self.place()
        return super().eventFilter(watched, event)
