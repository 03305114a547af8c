"""Text field that shows completed entries as removable tokens before the text being typed."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from app.core.recording.topic_choice import EXCLUDE_KEYWORD
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.frame import FieldFrame
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

TOKEN_HEIGHT, PADDING, GAP, CROSS_SIZE, MIN_EDIT_WIDTH = 22, 7, 5, 10, 40
MAX_TEXT_LENGTH = 400


class Token(PaintedButton):
    """Button for a completed entry, which removes the entry on a click or Delete.

    Attributes:
        entry: Text of the entry.
        is_excluded: True for an excluded entry, which is shown with "not".
    """

    def __init__(self, theme: Theme, entry: str, *, is_excluded: bool = False) -> None:
        super().__init__(theme)
        self.entry, self.is_excluded = entry, is_excluded
        template = _("Remove “not {pattern}”") if is_excluded else _("Remove “{pattern}”")
        self.set_text(entry, template.format(pattern=entry))

    def sizeHint(self) -> QSize:
        theme = self._theme
        width = 2 * PADDING + paint.width_of(theme.font("code"), self.entry) + GAP + theme.scaled(CROSS_SIZE)
        if self.is_excluded:
            width += paint.width_of(theme.font("small"), _(EXCLUDE_KEYWORD)) + GAP
        return QSize(round(width) + 1, round(theme.scaled(TOKEN_HEIGHT)))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Delete, Qt.Key.Key_Backspace} and has_no_modifiers(event):
            self.click()
        else:
            super().keyPressEvent(event)

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        bounds = QRectF(self.rect())
        fill = "hover" if self.is_highlighted else "sunken" if self.is_excluded else "accentTint"
        paint.box(painter, bounds, theme.radius("small"), theme.colour(fill))
        role = "textDisabled" if not self.isEnabled() else "text" if self.is_excluded else "accentText"
        colour = theme.colour(role)
        contents_rect = bounds.adjusted(PADDING, 0, -PADDING, 0)
        if self.is_excluded:
            font = theme.font("small")
            paint.text_line(painter, contents_rect, _(EXCLUDE_KEYWORD), font, theme.colour("textSecondary"))
            contents_rect.setLeft(contents_rect.left() + paint.width_of(font, _(EXCLUDE_KEYWORD)) + GAP)
        side = theme.scaled(CROSS_SIZE)
        icon_rect = QRectF(contents_rect.right() - side, contents_rect.center().y() - side / 2, side, side)
        paint_icon(painter, icon_rect, "x", colour)
        contents_rect.setRight(icon_rect.left() - GAP + 1)
        paint.text_line(painter, contents_rect, self.entry, theme.font("code"), colour)
        painter.end()


class _TokenEdit(QLineEdit):
    """Line edit for the text being typed.

    Enter and the loss of focus complete the text; Backspace in the empty field removes the last token.
    """

    completed = Signal()
    backspace_pressed = Signal()
    focus_changed = Signal()

    def sizeHint(self) -> QSize:
        text = self.text() or self.placeholderText()
        width = self.fontMetrics().horizontalAdvance(text) + 2 * PADDING
        return QSize(max(MIN_EDIT_WIDTH, width), super().sizeHint().height())

    def minimumSizeHint(self) -> QSize:
        return QSize(MIN_EDIT_WIDTH, super().minimumSizeHint().height())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        is_unmodified = has_no_modifiers(event)
        if is_unmodified and event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and self.text().strip():
            self.completed.emit()
        elif is_unmodified and event.key() == Qt.Key.Key_Backspace and not self.text():
            self.backspace_pressed.emit()
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.focus_changed.emit()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if event.reason() != Qt.FocusReason.PopupFocusReason:
            self.completed.emit()
        self.focus_changed.emit()


class TokenField(FieldFrame):
    """Base class of token fields. Subclasses decide when typed text becomes a token.

    `changed` is emitted when the tokens or the typed text change, and `editing_finished` when the tokens have
    changed and no text is being typed.

    Args:
        theme: Theme.
        name: Accessible name.
        example: Placeholder of the empty field.
        add_placeholder: Placeholder after the tokens.
    """

    changed = Signal()
    editing_finished = Signal()

    def __init__(self, theme: Theme, name: str, example: str, add_placeholder: str = "") -> None:
        super().__init__()
        self._add_placeholder = add_placeholder
        self._theme, self._example = theme, example
        self._tokens: list[Token] = []
        self.edit = _TokenEdit(self)
        self.edit.setAccessibleName(name)
        self.edit.setPlaceholderText(example)
        self.edit.setMaxLength(MAX_TEXT_LENGTH)
        self.edit.setProperty("bare", "true")
        self.edit.setProperty("ownFocus", True)
        FieldContextMenu(theme, self.edit)
        self.edit.textEdited.connect(self._on_edited)
        self.edit.textChanged.connect(self.edit.updateGeometry)
        self.edit.completed.connect(self._end_typing)
        self.edit.backspace_pressed.connect(self._remove_last)
        self.edit.focus_changed.connect(self.update_focus)
        self.setFocusProxy(self.edit)
        self._flow = Flow(self, gap=GAP, row_gap=4)
        self._flow.setContentsMargins(PADDING, 5, PADDING, 5)
        self._flow.add_elastic(self.edit, is_greedy=True)

    @property
    def tokens(self) -> Sequence[Token]:
        """Tokens in the order in which they are shown."""
        return tuple(self._tokens)

    # ---- input

    def _on_edited(self, text: str) -> None:
        """Handle a change of the typed text."""

    def _end_typing(self) -> None:
        """Complete the typed text, after Enter was pressed or the focus was lost."""

    def _remove_last(self) -> None:
        if self._tokens:
            self._remove(self._tokens[-1])

    def _remove(self, token: Token) -> None:
        self.edit.setFocus(Qt.FocusReason.OtherFocusReason)
        self._delete_token(token)
        self.changed.emit()
        self.editing_finished.emit()

    # ---- tokens

    def _add_token(self, token: Token) -> None:
        token.clicked.connect(lambda _on=False: self._remove(token))
        self._tokens.append(token)

    def _delete_token(self, token: Token) -> None:
        self._tokens.remove(token)
        token.hide()
        self._flow.removeWidget(token)
        token.deleteLater()
        self._arrange()

    def _arrange(self) -> None:
        self._flow.removeWidget(self.edit)
        before: QWidget | None = None
        for token in self._tokens:
            self._flow.removeWidget(token)
            self._flow.addWidget(token)
            token.show()
            if before is not None:
                QWidget.setTabOrder(before, token)
            before = token
        self._flow.add_elastic(self.edit, is_greedy=True)
        if before is not None:
            QWidget.setTabOrder(before, self.edit)
        self.edit.setPlaceholderText(self._add_placeholder if self._tokens else self._example)
        self.updateGeometry()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.edit.setFocus(Qt.FocusReason.MouseFocusReason)
        event.accept()
