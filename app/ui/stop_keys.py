"""Stop's keys work whatever is open: menus, lists, dialogs, sheets, and panels that float."""

from __future__ import annotations

from collections.abc import Callable, Collection

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence, QWindow
from PySide6.QtWidgets import QApplication

_KINDS = frozenset({QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress})


class StopKeys(QObject):
    """Hears the keys of every window of ours before anything in it does.

    A shortcut is not enough: an open menu or list, a page or a field that claims the key would have it.
    """

    def __init__(
        self, parent: QObject, keys: Callable[[], Collection[str]], stop: Callable[[], object]
    ) -> None:
        """``keys`` are Stop's keys of the moment, as `QKeySequence` spells them; ``stop`` is done at once."""
        super().__init__(parent)
        self._keys, self._stop = keys, stop
        application = QApplication.instance()
        if isinstance(application, QGuiApplication):
            application.focusWindowChanged.connect(self._listen_to)
        self._listen_to(QGuiApplication.focusWindow())

    def _listen_to(self, window: QWindow | None) -> None:
        if window is not None:
            window.removeEventFilter(self)
            window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in _KINDS and isinstance(event, QKeyEvent):
            pressed = QKeySequence(event.keyCombination()).toString(QKeySequence.SequenceFormat.PortableText)
            if pressed in self._keys():
                event.accept()
                if event.type() == QEvent.Type.KeyPress and not event.isAutoRepeat():
                    self._stop()
                return True
        return super().eventFilter(watched, event)
