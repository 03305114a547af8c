"""What a running behaviour asks: a card over the window, which takes the keyboard and covers no Stop."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPoint, QRect, QRectF, Qt
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QApplication,
    QGraphicsDropShadowEffect,
    QHBoxLayout,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)
from shiboken6 import isValid

from app.core.run.asking import AskedQuestion
from app.ui.shell.bars.floating_card import FloatingCard
from app.ui.shell.dialogs.overlay import stops_in
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, paint
from app.ui.widgets.menus import EditMenu
from nep.i18n import _

WIDE = 460
MARGIN = 16
LOWER = 0.8  # how far down the window its lower edge is: over the blocks, not over what is below them
LONGEST_ANSWER = 10_000


class QuestionCard(FloatingCard):
    """The question, a field and a button. Enter answers; Esc answers nothing. While paused it is held."""

    def __init__(self, theme: Theme, window: QWidget, answer: Callable[[AskedQuestion, str], object]) -> None:
        """``answer`` gets the question and what was typed."""
        super().__init__(window)
        self._theme, self._answer = theme, answer
        self._question: AskedQuestion | None = None
        self._before: QWidget | None = None
        self._held = False
        self.words = label("", "heading", wrap=True)
        self.field = QLineEdit()
        self.field.setMaxLength(LONGEST_ANSWER)
        self.field.setProperty("focusRadius", theme.radius("control"))
        EditMenu(theme, self.field)
        self.button = Button(theme, _("Answer"), kind="primary", size="form")
        self.button.clicked.connect(self._done)
        row = QHBoxLayout()
        row.setSpacing(10)
        row.addWidget(self.field, 1)
        row.addWidget(self.button)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 16)
        column.setSpacing(10)
        column.addWidget(self.words)
        column.addLayout(row)
        shadow = QGraphicsDropShadowEffect(self)
        shadow.setBlurRadius(32)
        shadow.setOffset(0, 8)
        shadow.setColor(theme.colour("shadow"))
        self.setGraphicsEffect(shadow)

    def show_question(self, question: AskedQuestion | None, *, held: bool) -> None:
        """Show this question, or none; ``held`` while the behaviour is paused. Called with every tick."""
        if question != self._question:
            self._question = question
            if question is None:
                self._leave()
            else:
                self._open(question)
        if question is not None and held != self._held:
            self._hold(held=held)

    def _open(self, question: AskedQuestion) -> None:
        words = question.words.strip() or _("The behaviour asks you something")
        self.words.setText(words)
        self.setAccessibleName(words)
        self.field.setAccessibleName(words)
        self.field.clear()
        self._hold(held=False)
        if not self.isVisible():
            self._before = QApplication.focusWidget()
        self.show()
        self.place()
        self.raise_()
        self.field.setFocus(Qt.FocusReason.PopupFocusReason)
        paint.announce(self, words)

    def _leave(self) -> None:
        """Go, and give the keyboard back to where it was."""
        inside = self.isAncestorOf(focus) if (focus := QApplication.focusWidget()) is not None else False
        before, self._before = self._before, None
        if inside and before is not None and isValid(before) and before.isVisible():
            before.setFocus(Qt.FocusReason.PopupFocusReason)
        self.hide()

    def _hold(self, *, held: bool) -> None:
        self._held = held
        self.field.setReadOnly(held)
        self.field.setPlaceholderText(_("Press Go on first") if held else "")
        self.button.setEnabled(not held)

    def place(self) -> None:
        """Go to the middle of the lower part of the window, or higher so that no Stop is covered."""
        window = self.parentWidget()
        layout = self.layout()
        if window is None or layout is None:
            return
        self.field.setMinimumHeight(self.button.sizeHint().height())
        wide = min(window.width() - 2 * MARGIN, round(self._theme.scaled(WIDE)))
        high = min(
            max(layout.totalHeightForWidth(wide), layout.minimumSize().height()), window.height() - 2 * MARGIN
        )
        bottom = round(window.height() * LOWER)
        place = QRect(
            QPoint((window.width() - wide) // 2, bottom - high),
            QPoint((window.width() + wide) // 2, bottom),
        )
        covered = [
            stop
            for stop in (QRect(each.mapTo(window, QPoint()), each.size()) for each in stops_in(window))
            if stop.intersects(place)
        ]
        if covered:
            place.moveBottom(min(stop.top() for stop in covered) - MARGIN)
        self.setGeometry(place)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._done()
        elif event.key() == Qt.Key.Key_Escape:
            self.field.clear()
            self._done()
        else:
            super().keyPressEvent(event)

    def _done(self) -> None:
        question = self._question
        if question is not None and not self._held:
            self._answer(question, self.field.text())

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        painter.setPen(Qt.PenStyle.NoPen)
        rect = QRectF(self.rect())
        paint.box(painter, rect, theme.radius("large"), theme.colour("raised"), theme.colour("borderStrong"))
        painter.end()
