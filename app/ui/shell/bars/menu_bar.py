"""Menu bar that underlines the mnemonics of menus while Alt is held."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QAction, QKeyEvent, QShowEvent
from PySide6.QtWidgets import QMenuBar, QStyleOptionMenuItem

from app.ui.widgets.mnemonics import strip_mnemonic


class _AltKeyFilter(QObject):
    """Event filter that emits `held_changed` when Alt is pressed or released.

    This is an object separate from the menu bar, because Qt installs a menu bar as an event filter of
    the whole application while Alt is held, and events of the web view's internal objects must not
    reach Python.
    """

    held_changed = Signal(bool)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            self.held_changed.emit(event.key() == Qt.Key.Key_Alt)
        elif event.type() in {QEvent.Type.KeyRelease, QEvent.Type.FocusOut}:
            self.held_changed.emit(False)
        return super().eventFilter(watched, event)


class MenuBar(QMenuBar):
    """Menu bar whose mnemonics are underlined only while Alt is held."""

    def __init__(self) -> None:
        super().__init__()
        self._shows_mnemonics = False
        self._alt = _AltKeyFilter(self)
        self._alt.held_changed.connect(self._show_mnemonics)

    @property
    def shows_mnemonics(self) -> bool:
        """True while the mnemonics are underlined."""
        return self._shows_mnemonics

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        window = self.window().windowHandle()
        # receives Alt before the focused widget; installing a filter again is harmless
        if window is not None:
            window.removeEventFilter(self._alt)
            window.installEventFilter(self._alt)

    def _show_mnemonics(self, visible: bool) -> None:
        if visible != self._shows_mnemonics:
            self._shows_mnemonics = visible
            self.update()

    def initStyleOption(self, option: QStyleOptionMenuItem, action: QAction) -> None:
        super().initStyleOption(option, action)
        if not (self._shows_mnemonics or self.hasFocus()):
            option.text = strip_mnemonic(option.text).replace("&", "&&")
