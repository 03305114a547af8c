"""Stop's keys and buttons work whatever is open: menus, lists, dialogs, sheets, and panels that float."""

from __future__ import annotations

from collections.abc import Callable, Collection

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence, QMouseEvent, QWindow
from PySide6.QtWidgets import QApplication

from app.ui.widgets.menus import press_stop

_KINDS = frozenset({QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress})


class StopKeys(QObject):
    """Hears the keys of every window of ours that has had the keyboard, before anything in it does.

    A shortcut is not enough: an open menu or list, a page or a field that claims the key would have it.
    A button is not enough either: while a menu or a list is open, the press beside it only closes it.
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
        """Also to those that open later: menus, dialogs, and panels that float."""
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
        if event.type() == QEvent.Type.MouseButtonPress and isinstance(event, QMouseEvent):
            return self._pressed(event)
        return super().eventFilter(watched, event)

    def _pressed(self, event: QMouseEvent) -> bool:
        """Whether a press beside what pops up was on a button that stops, and is done with."""
        if event.button() != Qt.MouseButton.LeftButton or QApplication.activePopupWidget() is None:
            return False
        return press_stop(event.globalPosition().toPoint())
