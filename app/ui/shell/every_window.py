"""A filter of what every window of ours hears, also of those that open later: menus, dialogs, and panels."""

from __future__ import annotations

from PySide6.QtCore import QObject
from PySide6.QtGui import QGuiApplication, QWindow
from PySide6.QtWidgets import QApplication


class EveryWindow(QObject):
    """Its `eventFilter` sees what each window gets that has had the keyboard, before anything in it does."""

    def __init__(self, parent: QObject) -> None:
        """It lives as long as ``parent``."""
        super().__init__(parent)
        application = QApplication.instance()
        if isinstance(application, QGuiApplication):
            application.focusWindowChanged.connect(self._listen_to)
        self._listen_to(QGuiApplication.focusWindow())

    def _listen_to(self, window: QWindow | None) -> None:
        if window is not None:
            window.removeEventFilter(self)
            window.installEventFilter(self)
