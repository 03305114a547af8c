"""A field of patterns of topics: each is a token, what is left out has "not" before it."""

from __future__ import annotations

from collections.abc import Sequence

from app.core.recording.choice import NOT, read_patterns
from app.ui.widgets.inputs.token_field import Token, TokenField
from nep.i18n import _

HIGH, PAD, GAP, CROSS, MIN = 22, 7, 5, 10, 40
MAX_PATTERN_LENGTH = 400


class PatternToken(PaintedButton):
    """Token of one pattern; a click, or Delete, removes it."""

    def __init__(self, theme: Theme, pattern: str, *, is_left_out: bool) -> None:
        super().__init__(theme)
        self.pattern, self.is_left_out = pattern, is_left_out
        words = _("Remove “not {pattern}”") if is_left_out else _("Remove “{pattern}”")
        self.say(pattern, words.format(pattern=pattern))

    def sizeHint(self) -> QSize:
        theme = self._theme
        wide = 2 * PAD + paint.width_of(theme.font("code"), self.pattern) + GAP + theme.scaled(CROSS)
        if self.is_left_out:
            wide += paint.width_of(theme.font("small"), _(NOT)) + GAP
        return QSize(round(wide) + 1, round(theme.scaled(HIGH)))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Delete, Qt.Key.Key_Backspace} and is_plain(event):
            self.click()
        else:
            super().keyPressEvent(event)

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        whole = QRectF(self.rect())
        fill = "hover" if self.is_highlighted else "sunken" if self.is_left_out else "accentTint"
        paint.box(painter, whole, theme.radius("small"), theme.colour(fill))
        role = "textDisabled" if not self.isEnabled() else "text" if self.is_left_out else "accentText"
        ink = theme.colour(role)
        rest = whole.adjusted(PAD, 0, -PAD, 0)
        if self.is_left_out:
            font = theme.font("small")
            paint.words(painter, rest, _(NOT), font, theme.colour("textSecondary"))
            rest.setLeft(rest.left() + paint.width_of(font, _(NOT)) + GAP)
        side = theme.scaled(CROSS)
        square = QRectF(rest.right() - side, rest.center().y() - side / 2, side, side)
        paint_icon(painter, square, "x", ink)
        rest.setRight(square.left() - GAP + 1)
        paint.words(painter, rest, self.pattern, theme.font("code"), ink)
        painter.end()


class _Typed(QLineEdit):
    """Text being typed; Enter converts it to a token, Backspace at its start removes one."""

    ended = Signal()
    back = Signal()
    focused = Signal()

    def sizeHint(self) -> QSize:
        # As wide as its text, so that it stays behind the last token while there is space.
        words = self.text() or self.placeholderText()
        wide = self.fontMetrics().horizontalAdvance(words) + 2 * PAD
        return QSize(max(MIN, wide), super().sizeHint().height())

    def minimumSizeHint(self) -> QSize:
        return QSize(MIN, super().minimumSizeHint().height())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        plain = is_plain(event)
        if plain and event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and self.text().strip():
            self.ended.emit()
        elif plain and event.key() == Qt.Key.Key_Backspace and not self.text():
            self.back.emit()
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.focused.emit()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if event.reason() != Qt.FocusReason.PopupFocusReason:
            self.ended.emit()
        self.focused.emit()


class PatternField(QWidget):
    """Field of patterns.

    Emits `changed` at each change, including typing, and `settled` when all are complete.
    """

    changed = Signal()
    settled = Signal()

    def __init__(self, theme: Theme, name: str, example: str) -> None:
        super().__init__()
        self._theme, self._example, self._is_wrong = theme, example, False
        self._tokens: list[PatternToken] = []
        self.edit = _Typed(self)
        self.edit.setAccessibleName(name)
        self.edit.setPlaceholderText(example)
        self.edit.setMaxLength(MAX_PATTERN_LENGTH)
        self.edit.setProperty("bare", "true")
        self.edit.setProperty("ownFocus", True)
        EditMenu(theme, self.edit)
        self.edit.textEdited.connect(self._edited)
        self.edit.textChanged.connect(self.edit.updateGeometry)
        self.edit.ended.connect(self._end_typing)
        self.edit.back.connect(self._remove_last)
        self.edit.focused.connect(self.update)
        self.setFocusProxy(self.edit)
        self._flow = Flow(self, gap=GAP, row_gap=4)
        self._flow.setContentsMargins(PAD, 5, PAD, 5)
        self._flow.add_elastic(self.edit, greedy=True)

    @property
    def tokens(self) -> Sequence[PatternToken]:
        """Completed patterns in order."""
        return tuple(self._tokens)

    def patterns(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """(wanted, left out)."""
        wanted = [each.entry for each in self._tokens if not each.is_left_out]
        unwanted = [each.entry for each in self._tokens if each.is_left_out]
        more, less = read_patterns(self.edit.text())
        return tuple(dict.fromkeys((*wanted, *more))), tuple(dict.fromkeys((*unwanted, *less)))

    def show_patterns(self, wanted: Sequence[str], unwanted: Sequence[str]) -> None:
        """Show these, unless they are there already."""
        if (tuple(wanted), tuple(unwanted)) == self.patterns():
            return
        for each in list(self._tokens):
            self._drop(each)
        self.edit.clear()
        self._add(wanted, unwanted)

    def _edited(self, text: str) -> None:
        """What has a blank behind it is finished; a "not" waits for what follows."""
        plain = text.replace(",", " ")
        finished, blank, rest = plain.rpartition(" ")
        words = finished.split()
        if words and words[-1].casefold() in {NOT, _(NOT).casefold()}:
            rest = f"{words.pop()} {rest}"
        if blank and words:
            self._add(*read_patterns(" ".join(words)))
            self.edit.setText(rest)
        self.changed.emit()
        if not self.edit.text().strip():
            self.settled.emit()

    def _end_typing(self) -> None:
        text = self.edit.text()
        if not text.strip():
            return
        wanted, unwanted = read_patterns(text)
        self.edit.clear()
        self._add(wanted, unwanted)
        self.changed.emit()
        self.settled.emit()

    def _add(self, wanted: Sequence[str], unwanted: Sequence[str]) -> None:
        there = {(each.entry, each.is_left_out) for each in self._tokens}
        for is_left_out, patterns in ((False, wanted), (True, unwanted)):
            for pattern in patterns:
                if (pattern, is_left_out) not in there:
                    self._add_token(Token(self._theme, pattern, is_left_out=is_left_out))
        self._arrange()
