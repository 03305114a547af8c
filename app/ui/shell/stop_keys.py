"""Keys and buttons of Stop while menus, lists, dialogs, sheets and floating panels are open."""

from __future__ import annotations

from collections.abc import Callable, Collection

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence, QMouseEvent, QWindow
from PySide6.QtWidgets import QApplication

from app.ui.widgets.menus import press_stop

_EVENT_TYPES = frozenset({QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress})


class StopKeys(QObject):
    """Event filter that triggers Stop by its keys and buttons before other widgets get the events.

    The filter is installed on every window that becomes active. Shortcuts don't suffice, because open
    menus, lists, pages and fields can consume the key. Buttons don't suffice either, because a click
    outside an open menu or list only closes it.
    """

    def __init__(
        self, parent: QObject, keys: Callable[[], Collection[str]], stop: Callable[[], object]
    ) -> None:
        # `keys` returns the current keys of Stop in QKeySequence's portable spelling; `stop` is called
        # immediately.
        super().__init__(parent)
        self._keys, self._stop = keys, stop
        application = QApplication.instance()
        if isinstance(application, QGuiApplication):
            application.focusWindowChanged.connect(self._install_on)
        self._install_on(QGuiApplication.focusWindow())

    def _install_on(self, window: QWindow | None) -> None:
        # Includes windows that open later: menus, dialogs, floating panels.
        if window is not None:
            window.removeEventFilter(self)
            window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in _EVENT_TYPES and isinstance(event, QKeyEvent):
            key = QKeySequence(event.keyCombination()).toString(QKeySequence.SequenceFormat.PortableText)
            if key in self._keys():
                event.accept()
                if event.type() == QEvent.Type.KeyPress and not event.isAutoRepeat():
                    self._stop()
                return True
        if event.type() == QEvent.Type.MouseButtonPress and isinstance(event, QMouseEvent):
            return self._handle_press(event)
        return super().eventFilter(watched, event)

    def _handle_press(self, event: QMouseEvent) -> bool:
        # If a click outside a popup hits a Stop button, stops and consumes the event.
        if event.button() != Qt.MouseButton.LeftButton or QApplication.activePopupWidget() is None:
            return False
        return press_stop(event.globalPosition().toPoint())
