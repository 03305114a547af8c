"""Card of a robot's action: form, Try button, progress and result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.errors import InputProblem
from app.robots.description.description import Action
from app.ui.panels.robots.robots.controls.chooser import ImageSource
from app.ui.panels.robots.robots.form import ActionForm
from app.ui.panels.robots.robots.invocations import (
    TryList,
    output_text,
    progress_of,
    remaining_text,
    result_texts,
    state_text,
)
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Card, Chip, ElidedLabel, IconButton, ValueBar, label, set_role
from app.ui.widgets.cards import Tile
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.robots.robot_link import Invocation

MOVES_TEXT = lazy("moves the robot")
RISK_TEXTS = {"moves": MOVES_TEXT, "locomotes": MOVES_TEXT}


class ActionCard(Card):
    """Card of an action.

    Args:
        action: Action of the robot.
        options: Returns the values that a property of the robot currently offers.
        is_collapsed: True if the form is collapsed at first.
        pictures: Source of images for image parameters.
        title_of: Returns the title of another action by its name.

    Signals:
        try_requested: Input with which to start the action.
        cancel_requested: The action should be cancelled.
    """

    try_requested = Signal(dict)
    cancel_requested = Signal()

    def __init__(
        self,
        theme: Theme,
        action: Action,
        options: Callable[[str], Sequence[str]],
        *,
        is_collapsed: bool = False,
        pictures: ImageSource | None = None,
        title_of: Callable[[str], str] = str,
    ) -> None:
        super().__init__()
        self._theme = theme
        self.action = action
        self._title_of = title_of
        self._is_running = False
        self._submitted_input: Mapping[str, object] = {}
        self._is_collapsed = False
        self.form = ActionForm(theme, action, options, pictures)
        self.form.changed.connect(self._update_summary)
        self.title = label(action.title[:1].upper() + action.title[1:], "card", wrap=True)
        self.summary = ElidedLabel("bodyLarge", "textSecondary")
        self.risk = Chip(theme, _(RISK_TEXTS.get(action.risk or "", "")), "warn")
        self.text_label = ElidedLabel("body", "textSecondary", 60)
        self.remaining_label = label("", "body", role="textTertiary")
        self.result = Chip(theme)
        self.try_button = Button(theme, _("Try"), "play")
        self.try_button.setAccessibleName(_("Try {action}").format(action=action.title))
        self.try_button.clicked.connect(self._start_or_cancel)
        tries = _("Recent results of {action}").format(action=action.title)
        self.history_button = IconButton(theme, "history", tries, size=30)
        self.history_button.setCheckable(True)
        self.history_button.toggled.connect(self._set_tries_visible)
        self.history_button.hide()
        self.collapse_button = IconButton(theme, "chevron-down", _("Show values"), size=30)
        self.collapse_button.clicked.connect(lambda: self.set_collapsed(not self._is_collapsed))
        self.collapse_button.setVisible(is_collapsed and bool(action.parameters))
        self.error = label("", "small", role="error", wrap=True)
        self.progress = ValueBar(theme)
        self.tries = TryList(theme, action)
        self.tries.selected.connect(self._reuse_input)
        self.tries.hide()
        self._lay_out(theme)
        self.set_collapsed(is_collapsed)
        self.show_invocation(None)

    def _lay_out(self, theme: Theme) -> None:
        header = Flow()
        before: tuple[QWidget, ...] = (Tile(theme, self.action.icon), self.title, self.risk)
        after: tuple[QWidget, ...] = (
            self.remaining_label,
            self.result,
            self.history_button,
            self.try_button,
            self.collapse_button,
        )
        below: tuple[QWidget, ...] = (self.form, self.error, self.progress, self.tries)
        for widget in before:
            header.addWidget(widget)
        header.add_elastic(self.summary)
        header.push()
        header.add_elastic(self.text_label)
        for widget in after:
            header.addWidget(widget)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 13, 16, 13)
        column.setSpacing(8)
        column.addLayout(header)
        for widget in below:
            column.addWidget(widget)

    def set_collapsed(self, is_collapsed: bool) -> None:
        """Collapse the form if `is_collapsed` is True, else expand it."""
        self._is_collapsed = is_collapsed
        self.form.setVisible(not is_collapsed and bool(self.action.parameters))
        self.collapse_button.set_icon("chevron-down" if is_collapsed else "chevron-up")
        self.collapse_button.set_name(_("Show values") if is_collapsed else _("Hide values"))
        self._update_summary()

    def _update_summary(self) -> None:
        self.summary.setText(self.form.summary() if self._is_collapsed else "")
        self.summary.setVisible(self._is_collapsed)

    def set_highlighted(self, is_highlighted: bool) -> None:
        """Highlight the card with an accent border and a filled Try button, or remove the highlight.

        Args:
            is_highlighted: True for the highlighted card.
        """
        self.set_accented(is_highlighted)
        self.try_button.set_kind("primary" if is_highlighted and not self._is_running else "plain")
        self.try_button.has_filled_icon = is_highlighted

    def _start_or_cancel(self) -> None:
        if self._is_running:
            self.cancel_requested.emit()
        else:
            self._submitted_input = self.form.input()
            self.try_requested.emit(dict(self._submitted_input))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        has_ctrl = event.modifiers() & (
            Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.MetaModifier
        )
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and has_ctrl and not self._is_running:
            self._start_or_cancel()
        else:
            super().keyPressEvent(event)

    def _set_tries_visible(self, is_visible: bool) -> None:
        self.tries.setVisible(is_visible)

    def _reuse_input(self, input_values: Mapping[str, object]) -> None:
        # Puts the input of an earlier try into the form.
        self.set_collapsed(False)
        self.form.set_input(input_values)
        self.form.show_problems(())

    def show_problems(self, problems: Sequence[InputProblem]) -> None:
        """Show the errors for which the input was rejected; empty removes them."""
        if problems and self._is_collapsed:
            self.set_collapsed(False)
        self.form.show_problems(problems)

    def show_tries(self, tries: Sequence[Invocation]) -> None:
        """Update the list of the latest tries of this action."""
        self.tries.show_tries(tries)
        self.history_button.setVisible(bool(self.tries.rows))

    def show_invocation(self, invocation: Invocation | None, *, may_move: bool = False) -> None:
        """Show the state of the latest try.

        Args:
            invocation: Latest try, or None.
            may_move: True if the robot may still be moving after the end of the try.
        """
        self._is_running = invocation is not None and invocation.is_running
        can_cancel = self._is_running and (
            self.action.cancellable or (invocation is not None and invocation.state in ("sent", "accepted"))
        )
        if can_cancel:
            self.try_button.set_label(_("Cancel"), "x")
        else:
            self.try_button.set_label(_("Try"), "play")
        template = _("Cancel {action}") if can_cancel else _("Try {action}")
        self.try_button.setAccessibleName(template.format(action=self.action.title))
        self.try_button.setEnabled(can_cancel or not self._is_running)
        self.set_highlighted(self.is_accented)
        fraction, text, remaining = None, "", ""
        if invocation is not None and self._is_running:
            fraction = progress_of(
                self.action, self._submitted_input or invocation.input, invocation.feedback
            )
            text = state_text(self.action, invocation, self._title_of)
            remaining = remaining_text(invocation)
        self.progress.setVisible(fraction is not None)
        self.progress.set_fraction(fraction)
        self.text_label.setText(text)
        self.remaining_label.setText(remaining)
        self.remaining_label.setVisible(bool(remaining))
        self._show_result(None if self._is_running else invocation, may_move)

    def _show_result(self, invocation: Invocation | None, may_move: bool) -> None:
        chip_text, status, message = ("", "ok", "")
        if invocation is not None:
            chip_text, status, message = result_texts(invocation, may_move=may_move)
        self.result.set(chip_text, status)
        if invocation is not None and invocation.state == "succeeded":
            self.text_label.setText(output_text(self.action, invocation.output))
        set_role(self.error, "textSecondary" if status == "off" else "error")
        self.error.setText(message)
        self.error.setVisible(bool(message))
