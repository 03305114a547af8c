"""Which panel has the keyboard, and how it goes from one to the next; and Enter, which presses a button."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractButton, QApplication, QPushButton, QWidget

from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.stop_keys import EveryWindow

_ENTER = frozenset({Qt.Key.Key_Return, Qt.Key.Key_Enter})
_PLAIN = frozenset({Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.KeypadModifier})


class PanelFocus(QObject):
    """Gives the keyboard to panels of the workbench that shows; marks the title of who has it."""

    def __init__(self, bench: Callable[[], Workbench | None], parent: QObject) -> None:
        """``bench`` gives the workbench that shows, None when there is none."""
        super().__init__(parent)
        self._bench = bench
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._changed)

    def next(self, step: int) -> None:
        """Give the keyboard to the next panel that can be seen, or the one before."""
        bench = self._bench()
        docks = [dock for dock in bench.docks.values() if dock.shown()] if bench is not None else []
        if bench is None or not docks:
            return
        current = self.dock()
        place = docks.index(current) if current in docks else (-1 if step > 0 else 0)
        bench.focus_panel(docks[(place + step) % len(docks)])

    def number(self, number: int) -> None:
        """Give the keyboard to the n-th open panel, from 1."""
        bench = self._bench()
        names = bench.open_names() if bench is not None else ()
        if bench is not None and 0 < number <= len(names):
            bench.focus_panel(bench.docks[names[number - 1]])

    def dock(self) -> Dock | None:
        """The panel that has the keyboard."""
        focus, bench = QApplication.focusWidget(), self._bench()
        if bench is None or focus is None:
            return None
        return next((dock for dock in bench.docks.values() if _has(dock, focus)), None)

    def _changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        bench = self._bench()
        if new is None or bench is None:
            return
        for dock in bench.docks.values():
            dock.title.set_active(_has(dock, new))


def _has(dock: Dock, widget: QWidget) -> bool:
    return dock is widget or dock.isAncestorOf(widget)


class EnterKey(EveryWindow):
    """Enter presses the button that has the keyboard, as Space does: on Linux and Windows Qt leaves it out.

    The system's own buttons know Enter.
    """

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
