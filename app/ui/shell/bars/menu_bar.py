"""Menu bar that underlines the mnemonics of menus while Alt is held."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QRectF, Qt, Signal
from PySide6.QtGui import QAction, QFontMetricsF, QKeyEvent, QPainter, QPaintEvent, QShowEvent
from PySide6.QtWidgets import QMenuBar, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
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

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
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

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        for action in self.actions():
            rect = self.actionGeometry(action)
            if action.isVisible() and not rect.isEmpty():
                self._paint_entry(painter, QRectF(rect), action)
        painter.end()

    def _paint_entry(self, painter: QPainter, rect: QRectF, action: QAction) -> None:
        theme, font, text = self._theme, self.font(), strip_mnemonic(action.text())
        is_active, menu = action is self.activeAction(), action.menu()
        if is_active:
            is_open = isinstance(menu, QWidget) and menu.isVisible()
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            paint.box(painter, rect, theme.radius("small"), theme.colour("pressed" if is_open else "hover"))
        colour = theme.colour("text" if is_active else "textSecondary")
        text_width, metrics = paint.width_of(font, text), QFontMetricsF(font)
        text_left = rect.center().x() - text_width / 2
        paint.text_line(
            painter, QRectF(text_left, rect.top(), text_width + 1, rect.height()), text, font, colour
        )
        letter = action.text().find("&")
        if letter >= 0 and (self._shows_mnemonics or self.hasFocus()):
            start = text_left + paint.width_of(font, text[:letter])
            line = QRectF(start, 0, paint.width_of(font, text[letter]), 1)
            line.moveTop(round(rect.center().y() + metrics.ascent() / 2 + 1))
            painter.fillRect(line, colour)
