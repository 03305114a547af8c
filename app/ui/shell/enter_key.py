"""Enter presses the button that has the keyboard, as Space does: on Linux and Windows Qt leaves it out."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractButton, QApplication, QPushButton, QWidget

from app.ui.shell.every_window import EveryWindow

_ENTER = frozenset({Qt.Key.Key_Return, Qt.Key.Key_Enter})
_PLAIN = frozenset({Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.KeypadModifier})


class EnterKey(EveryWindow):
    """Listens to the keys of every window of ours that a person uses; the system's own buttons know Enter."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Give the button under the keyboard a Space instead; holding Enter down does not repeat it."""
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress and _plain_enter(event):
            button = QApplication.focusWidget()
            if isinstance(button, QAbstractButton) and not isinstance(button, QPushButton):
                if not event.isAutoRepeat():
                    _space(button)
                return True
        return super().eventFilter(watched, event)


def _plain_enter(event: QKeyEvent) -> bool:
    menu_is_open = QApplication.activePopupWidget() is not None
    return event.key() in _ENTER and event.modifiers() in _PLAIN and not menu_is_open


def _space(button: QWidget) -> None:
    for kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
        QApplication.sendEvent(button, QKeyEvent(kind, Qt.Key.Key_Space, Qt.KeyboardModifier.NoModifier, " "))
