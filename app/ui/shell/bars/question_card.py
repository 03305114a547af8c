"""Card for questions of a running behaviour. The card takes the focus and never covers Stop."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QKeyEvent
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
from app.ui.shell.bars.choices import GAP, ChoiceGrid
from app.ui.shell.bars.floating_card import FloatingCard
from app.ui.shell.dialogs.overlay import stop_buttons_in
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, paint
from app.ui.widgets.lists.scroll_areas import ContentScrollArea
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

WIDTH, WIDTH_WITH_CHOICES = 460, 560
MARGIN = 16
BOTTOM_SHARE = 0.8  # lower edge as a share of the window's height: above the panels below the blocks
MAX_ANSWER_LENGTH = 10_000


class QuestionCard(FloatingCard):
    """Card with a question, and a text field or choices for the answer.

    Enter submits the answer; Esc submits an empty answer. The card is disabled while the behaviour is
    paused.
    """

    def __init__(self, theme: Theme, window: QWidget, answer: Callable[[AskedQuestion, str], object]) -> None:
        # `answer` gets the question and the text or choice.
        super().__init__(window)
        self._theme, self._on_answer = theme, answer
        self._question: AskedQuestion | None = None
        self._previous_focus: QWidget | None = None
        self._is_paused = False
        self.text_label = label("", "heading", wrap=True)
        self.field = QLineEdit()
        self.field.setMaxLength(MAX_ANSWER_LENGTH)
        self.field.setProperty("focusRadius", theme.radius("control"))
        FieldContextMenu(theme, self.field)
        self.button = Button(theme, _("Answer"), kind="primary", size="form")
        self.button.clicked.connect(self._submit)
        self.choices = ChoiceGrid(theme)
        self.choices.selected.connect(self._send)
        self._choice_area = ContentScrollArea(self.choices)
        self.choices.focus_moved.connect(lambda button: self._choice_area.ensureWidgetVisible(button, 0, GAP))
        self._hint = label(_("Press Resume first"), "small", role="textSecondary")
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # receives the keys while the card is disabled
        row = QHBoxLayout()
        row.setSpacing(10)
        row.addWidget(self.field, 1)
        row.addWidget(self.button)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 16)
        column.setSpacing(10)
        column.addWidget(self.text_label)
        column.addLayout(row)
        column.addWidget(self._choice_area)
        column.addWidget(self._hint)
        shadow = QGraphicsDropShadowEffect(self)
        shadow.setBlurRadius(32)
        shadow.setOffset(0, 8)
        shadow.setColor(theme.colour("shadow"))
        self.setGraphicsEffect(shadow)

    def show_question(self, question: AskedQuestion | None, *, paused: bool) -> None:
        """Show a question, or hide the card; called on every tick.

        Args:
            question: Question, or None to hide the card.
            paused: True to disable the card while the behaviour is paused.
        """
        if question != self._question:
            self._question = question
            if question is None:
                self._close()
            else:
                self._open(question)
        if question is not None and paused != self._is_paused:
            self._set_paused(paused=paused)

    def _open(self, question: AskedQuestion) -> None:
        text = question.text.strip() or _("The behaviour has a question")
        self.text_label.setText(text)
        self.setAccessibleName(text)
        self.field.setAccessibleName(text)
        self.field.clear()
        self.choices.show_choices(question.choices)
        self._choice_area.updateGeometry()  # a hidden card isn't notified of changed size hints
        self.choices.setAccessibleName(text)
        typed = not question.choices
        self.field.setVisible(typed)
        self.button.setVisible(typed)
        self._choice_area.setVisible(not typed)
        if not self.isVisible():
            self._previous_focus = QApplication.focusWidget()
        self._set_paused(paused=False)
        self.show()
        self.place()
        self.raise_()
        self.focus_input()
        paint.announce(self, ", ".join((text, *question.choices)))

    def focus_input(self) -> None:
        """Set the focus to the input if there is a question and the card is enabled."""
        if self._question is None or self._is_paused:
            return
        if self.choices.buttons:
            self.choices.focus_first()
        else:
            self.field.setFocus(Qt.FocusReason.PopupFocusReason)

    def _close(self) -> None:
        had_focus = self._has_focus()
        before, self._previous_focus = self._previous_focus, None
        if had_focus and before is not None and isValid(before) and before.isVisible():
            before.setFocus(Qt.FocusReason.PopupFocusReason)
        self.hide()

    def _has_focus(self) -> bool:
        focus = QApplication.focusWidget()
        return focus is not None and (focus is self or self.isAncestorOf(focus))

    def _set_paused(self, *, paused: bool) -> None:
        had_focus = self._has_focus()
        self._is_paused = paused
        if had_focus and paused and self.choices.buttons:
            # Otherwise Qt would move the focus from the disabled widget to the next one in the window.
            self.setFocus(Qt.FocusReason.OtherFocusReason)
        self.choices.set_paused(paused=paused)
        self._hint.setVisible(paused and bool(self.choices.buttons))
        if had_focus and not paused and self.hasFocus():
            self.choices.focus_first()
        self.field.setReadOnly(paused)
        self.field.setPlaceholderText(_("Press Resume first") if paused else "")
        self.button.setEnabled(not paused)

    def place(self) -> None:
        """Move the card to the lower part of the window, centred, but higher if it would cover Stop."""
        window = self.parentWidget()
        layout = self.layout()
        if window is None or layout is None:
            return
        self.field.setMinimumHeight(self.button.sizeHint().height())
        preferred_width = WIDTH_WITH_CHOICES if self.choices.buttons else WIDTH
        width = min(window.width() - 2 * MARGIN, round(self._theme.scaled(preferred_width)))
        left = (window.width() - width) // 2
        top, lowest = self._free_range(window, left, width)
        needed = max(layout.totalHeightForWidth(width), layout.minimumSize().height())
        bottom = min(lowest, max(round(window.height() * BOTTOM_SHARE), top + needed))
        height = min(needed, bottom - top)
        self.setGeometry(left, bottom - height, width, height)

    def _free_range(self, window: QWidget, left: int, width: int) -> tuple[int, int]:
        # Vertical range between the Stop buttons above and below the card.
        middle, top, bottom = window.height() // 2, MARGIN, window.height() - MARGIN
        for button in stop_buttons_in(window):
            stop = QRect(button.mapTo(window, QPoint()), button.size())
            if stop.right() < left or stop.left() > left + width:
                continue
            if stop.center().y() < middle:
                top = max(top, stop.bottom() + MARGIN)
            else:
                bottom = min(bottom, stop.top() - MARGIN)
        return top, bottom

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if self.choices.handle_key(event):
            return
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and not self.choices.buttons:
            self._submit()
        elif event.key() == Qt.Key.Key_Escape:
            self._send("")
        else:
            super().keyPressEvent(event)

    def _submit(self) -> None:
        self._send(self.field.text())

    def _send(self, text: str) -> None:
        question = self._question
        if question is not None and not self._is_paused:
            self._on_answer(question, text)
