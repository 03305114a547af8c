"""A card for one action of a robot: its form, Try, what it does now, how it ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, Signal
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.robots.description import Action
from app.ui.forms import ActionForm
from app.ui.icons import paint_icon
from app.ui.sensor_words import number_words
from app.ui.theme import Theme
from app.ui.widgets import Bar, Button, Card, Chip, IconButton, label, paint
from app.ui.words import seconds_words

if TYPE_CHECKING:
    from app.core.robot_link import Invocation

TILE = 28
TO_GO = "to_go"
RISKS = {"moves": "moves the robot", "locomotes": "moves the robot"}


class Tile(QWidget):
    """A white icon on the colour of a block category."""

    def __init__(self, theme: Theme, icon: str, category: str = "robot", side: int = TILE) -> None:
        super().__init__()
        self._theme, self._icon, self._category = theme, icon, category
        self.setFixedSize(side, side)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = QRectF(self.rect())
        paint.box(painter, rect, self._theme.radius("small"), self._theme.block_colour(self._category))
        inset = rect.width() * 0.22
        ink = self._theme.block_text(self._category)
        paint_icon(painter, rect.adjusted(inset, inset, -inset, -inset), self._icon, ink)
        painter.end()


def feedback_words(action: Action, feedback: Mapping[str, object]) -> str:
    """What the robot says meanwhile: "0.3 m to go"; the fields that its description names."""
    parts = []
    for field in action.feedback:
        value = feedback.get(field.name)
        if value is None or field.name == "progress":
            continue
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            words = number_words(float(round(value, 2)), field.unit)
            parts.append(f"{words} {field.title}" if field.name == TO_GO else f"{field.title} {words}")
        else:
            parts.append(f"“{value}”")
    return ", ".join(parts)


def progress_of(action: Action, given: Mapping[str, object], feedback: Mapping[str, object]) -> float | None:
    """How much is done, 0 to 1: what the robot calls progress, or what is left to go of what was asked."""
    share = _number(feedback.get("progress"))
    if share is not None:
        return share
    left = _number(feedback.get(TO_GO))
    unit = next((field.unit for field in action.feedback if field.name == TO_GO), None)
    asked = next(
        (_number(given.get(one.name)) for one in action.parameters if unit and one.unit == unit), None
    )
    return 1.0 - abs(left / asked) if left is not None and asked else None


def _number(value: object) -> float | None:
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if good else None  # type: ignore[arg-type]


class ActionCard(Card):
    """`tried` with the form's input, `cancelled` when a person ends it early."""

    tried = Signal(dict)
    cancelled = Signal()

    def __init__(
        self, theme: Theme, action: Action, options: Callable[[str], Sequence[str]], *, folded: bool = False
    ) -> None:
        super().__init__(theme)
        self.action = action
        self._running = False
        self._given: Mapping[str, object] = {}
        self._folded = False
        self.form = ActionForm(theme, action, options)
        self.form.changed.connect(self._say_summary)
        self.title = label(action.title[:1].upper() + action.title[1:], "card")
        self.summary = label("", "bodyLarge", role="textSecondary")
        self.risk = Chip(theme, RISKS.get(action.risk or "", ""), "warn")
        self.words = label("", "body", role="textSecondary")
        self.result = Chip(theme)
        self.try_button = Button(theme, "Try", "play")
        self.try_button.setAccessibleName(f"Try {action.title}")
        self.try_button.clicked.connect(self._press)
        self.fold = IconButton(theme, "chevron-down", "Show its values", size=30)
        self.fold.clicked.connect(lambda: self.set_folded(not self._folded))
        self.fold.setVisible(folded and bool(action.parameters))
        self.error = label("", "small", role="error", wrap=True)
        self.progress = Bar(theme)
        self._lay_out(theme)
        self.set_folded(folded)
        self.show_invocation(None)

    def _lay_out(self, theme: Theme) -> None:
        head = QHBoxLayout()
        head.setSpacing(10)
        before: tuple[QWidget, ...] = (Tile(theme, self.action.icon), self.title, self.risk, self.summary)
        after: tuple[QWidget, ...] = (self.words, self.result, self.try_button, self.fold)
        below: tuple[QWidget, ...] = (self.form, self.error, self.progress)
        for widget in before:
            head.addWidget(widget)
        head.addStretch(1)
        for widget in after:
            head.addWidget(widget)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 13, 16, 13)
        column.setSpacing(8)
        column.addLayout(head)
        for widget in below:
            column.addWidget(widget)

    def set_folded(self, folded: bool) -> None:
        """Hide or show the form."""
        self._folded = folded
        self.form.setVisible(not folded and bool(self.action.parameters))
        self.fold.set_icon("chevron-down" if folded else "chevron-up")
        self.fold.set_name("Show its values" if folded else "Hide its values")
        self._say_summary()

    def _say_summary(self) -> None:
        self.summary.setText(self.form.summary() if self._folded else "")

    def set_first(self, first: bool) -> None:
        """Whether this card has the focus: its border, and its Try is the filled one."""
        border = "accent" if first else "border"
        if border != self.border:
            self.border = border
            self.update()
        self.try_button.set_kind("primary" if first and not self._running else "plain")
        self.try_button.fill_icon = first

    def _press(self) -> None:
        if self._running:
            self.cancelled.emit()
        else:
            self._given = self.form.input()
            self.tried.emit(dict(self._given))

    def show_problems(self, sentences: Sequence[str]) -> None:
        """The input was refused."""
        if sentences and self._folded:
            self.set_folded(False)
        self.form.show_problems(sentences)

    def show_invocation(self, invocation: Invocation | None) -> None:
        """What became of the newest try."""
        self._running = invocation is not None and invocation.running
        can_cancel = self._running and self.action.cancellable
        self.try_button.set_word("Cancel" if can_cancel else "Try", "x" if can_cancel else "play")
        self.try_button.setAccessibleName(f"{self.try_button.text()} {self.action.title}")
        self.try_button.setEnabled(can_cancel or not self._running)
        self.set_first(self.border == "accent")
        share = None
        if invocation is not None and self._running:
            share = progress_of(self.action, self._given, invocation.feedback)
        self.progress.setVisible(share is not None)
        self.progress.set_fraction(share)
        words = ""
        if invocation is not None and self._running:
            told = feedback_words(self.action, invocation.feedback)
            words = told or f"for {seconds_words(invocation.elapsed_s)}"
        self.words.setText(words)
        self._say_end(None if self._running else invocation)

    def _say_end(self, invocation: Invocation | None) -> None:
        error = ""
        if invocation is None:
            self.result.set("")
        elif invocation.state == "succeeded":
            self.result.set(f"done in {seconds_words(invocation.elapsed_s)}", "ok")
        elif invocation.state == "canceled":
            self.result.set(f"stopped after {seconds_words(invocation.elapsed_s)}", "off")
        else:
            self.result.set("not done", "error")
            error = invocation.error or "The robot did not say why"
        self.error.setText(f"{error[:1].upper()}{error[1:]}{'' if error.endswith('.') or not error else '.'}")
        self.error.setVisible(bool(error))
