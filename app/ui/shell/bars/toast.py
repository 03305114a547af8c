"""Toast at the bottom right that confirms an action of the user for six seconds. Not used for errors."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QTimer
from PySide6.QtGui import QEnterEvent
from PySide6.QtWidgets import QGraphicsDropShadowEffect, QHBoxLayout, QWidget

from app.ui.shell.bars.floating_card import FloatingCard
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button
from app.ui.widgets.labels import label

MARGIN = 16
BOTTOM_MARGIN = 42
RECHECK_INTERVAL_MS = 1000


class Toast(FloatingCard):
    """Card with one sentence and an optional button; stays open while hovered or focused."""

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(window)
        self._theme = theme
        self._button_callback: Callable[[], object] | None = None
        self._until: Callable[[], bool] | None = None
        self._label = label("", "bodyLarge", wrap=True)
        self.button = Button(theme, "", kind="ghost", size="small")
        self.button.clicked.connect(self._on_button_pressed)
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 10, 12, 10)
        row.setSpacing(10)
        row.addWidget(self._label)
        row.addWidget(self.button)
        shadow = QGraphicsDropShadowEffect(self)
        shadow.setBlurRadius(24)
        shadow.setOffset(0, 6)
        shadow.setColor(theme.colour("shadow"))
        self.setGraphicsEffect(shadow)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self._on_timeout)

    @property
    def text(self) -> str:
        """Sentence of the current or last toast."""
        return self._label.text()

    def show_toast(
        self,
        text: str,
        button: str = "",
        run: Callable[[], object] | None = None,
        *,
        until: Callable[[], bool] | None = None,
    ) -> None:
        """Show a sentence for some seconds, with an optional button.

        Args:
            text: Sentence.
            button: Text of the button, such as "Undo"; "" for no button.
            run: Callback of the button.
            until: Returns True when the sentence is outdated, which closes the toast early.
        """
        self._until = until
        self._label.setText(text)
        self.setAccessibleName(text)
        paint.announce(self, text)
        self._button_callback = run
        self.button.set_label(button)
        paint.show_when(self.button, bool(button and run))
        self.show()
        self.place()
        self.raise_()
        self._timer.start(self._theme.duration("toastShown"))

    def refresh(self) -> None:
        """Close the toast if its `until` returns True; called on every tick."""
        if self._until is not None and self._until():
            self._until = None
            self.hide()

    def place(self) -> None:
        """Move the toast to the bottom right of the window, or to the left of a sheet docked there."""
        window = self.parentWidget()
        if window is not None:
            self._fit(window.width() - 2 * MARGIN)
            sheets = [
                each for each in window.findChildren(Overlay) if each.is_docked_right and each.isVisible()
            ]
            right = min((each.x() for each in sheets), default=window.width())
            if right - self.width() < 2 * MARGIN:
                right = window.width()
            left = right - self.width() - MARGIN
            self.move(max(MARGIN, left), window.height() - self.height() - BOTTOM_MARGIN)

    def _fit(self, room: int) -> None:
        other_width = self.sizeHint().width() - self._label.sizeHint().width()
        text_width = paint.width_of(self._label.font(), self._label.text()) + 2
        width = min(room, round(text_width) + other_width)
        layout = self.layout()
        height = layout.totalHeightForWidth(width) if layout is not None else 0
        self.resize(width, max(height, layout.minimumSize().height() if layout is not None else 0))

    def enterEvent(self, event: QEnterEvent) -> None:
        self._timer.stop()
        super().enterEvent(event)

    def leaveEvent(self, event: QEvent) -> None:
        self._timer.start(self._theme.duration("toastShown"))
        super().leaveEvent(event)

    def _on_timeout(self) -> None:
        if self.button.hasFocus() or self.underMouse():
            self._timer.start(RECHECK_INTERVAL_MS)
        else:
            self.hide()

    def _on_button_pressed(self) -> None:
        callback, self._button_callback = self._button_callback, None
        self.hide()
        if callback is not None:
            callback()
