"""Strip with the switch that arms sending, and the confirmation for topics that move robots."""

from __future__ import annotations

import math

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.core.run.acting.acting import SessionActing
from app.core.run.acting.arming import Target
from app.ui.panels.base import PanelContext
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Separator, Switch, label, paint, set_role
from app.ui.widgets.buttons import LinkButton
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.menus import Menu
from nep.i18n import _, ngettext

ARMED_MINUTES = (1, 5, 15, 60)


def remaining_text(seconds: float) -> str:
    """Format a remaining time in minutes and seconds, such as "3:48"."""
    whole_seconds = math.ceil(seconds)
    return f"{whole_seconds // 60}:{whole_seconds % 60:02d}"


class ArmedStrip(QWidget):
    """Strip at the top of a panel that sends messages: switch for arming, and the armed targets."""

    is_for_replay = False
    """True if sending can be armed while a recording is open; overridden in subclasses."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._context, self._theme = context, context.theme
        self._is_on = False
        self._last_state: tuple[object, ...] = ()
        self.switch = Switch(self._theme, _("Armed"))
        self.switch.clicked.connect(self._toggle_armed)
        self.text_label = label("", "small", role="textSecondary")
        self._targets_label = label(_("sends to"), "small", role="textSecondary")
        self.tokens: list[LinkButton] = []
        self._flow_widget = QWidget()
        self._flow = Flow(self._flow_widget, gap=8, row_gap=4)
        self.summary_label = label("", "small", role="textSecondary")
        for widget in (self.switch, self.text_label, self._targets_label, self.summary_label):
            self._flow.addWidget(widget)
        self.question_label = label("", "small", role="warn", wrap=True)
        self.question_label.setMinimumWidth(0)
        self.allow_button = Button(self._theme, _("Arm sending"), size="small")
        self.cancel_button = Button(self._theme, _("Cancel"), size="small")
        self.allow_button.clicked.connect(lambda: self.acting.answer(is_allowed=True))
        self.cancel_button.clicked.connect(lambda: self.acting.answer(is_allowed=False))
        self._question_row = QWidget()
        row = QHBoxLayout(self._question_row)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addWidget(self.question_label, 1)
        for button in (self.allow_button, self.cancel_button):
            row.addWidget(button, 0, Qt.AlignmentFlag.AlignTop)
        content = QVBoxLayout()
        content.setContentsMargins(12, 7, 12, 7)
        content.setSpacing(6)
        content.addWidget(self._flow_widget)
        content.addWidget(self._question_row)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(content)
        column.addWidget(Separator(self._theme))
        self._question_row.hide()
        self.summary_label.hide()
        self.refresh()

    @property
    def acting(self) -> SessionActing:
        """Manual publishing and service calls of the session."""
        return self._context.session.acting

    def refresh(self) -> None:
        """Update the switch, the targets and the summary."""
        acting = self.acting
        arming, question = acting.arming, acting.question
        remaining, is_live = remaining_text(arming.remaining_s), self._context.session.shown.is_live
        targets = arming.targets if arming.is_on else ()
        summary = self.summary_text()
        state = (arming.is_on, remaining, targets, question, is_live, summary)
        if state == self._last_state:
            return
        self._last_state = state
        self._is_on = arming.is_on
        paint.set_style_property(self, "armed", arming.is_on)
        self.switch.setChecked(arming.is_on)
        can_arm = self.is_for_replay or is_live
        self.switch.setEnabled(can_arm or arming.is_on)
        disarmed_text = self.disarmed_text() if can_arm else _("Sending is off while a recording is open")
        self.text_label.setText(_("{time} left").format(time=remaining) if arming.is_on else disarmed_text)
        set_role(self.text_label, "warn" if arming.is_on else "textSecondary")
        self._targets_label.setVisible(bool(targets))
        self.summary_label.setVisible(bool(summary))
        self.summary_label.setText(summary)
        self._show_tokens(targets)
        message = question.message if question is not None else ""
        self._question_row.setVisible(question is not None)
        if message != self.question_label.text():
            self.question_label.setText(message)
            paint.announce(self, message)
        self.update()

    def disarmed_text(self) -> str:
        """Return the text shown while sending is disarmed."""
        return _("Sending is off")

    def arm(self) -> str:
        """Arm sending. Return the reason if that is not possible, or "" on success."""
        return self.acting.arm()

    def summary_text(self) -> str:
        """Return a summary of the sent messages, or "" for none; overridden in subclasses."""
        return ""

    def token_text(self, target: Target) -> str:
        """Return the text of the token that represents a target."""
        return target.name

    def _show_tokens(self, targets: tuple[Target, ...]) -> None:
        if [token.property("target") for token in self.tokens] == [each.name for each in targets]:
            return
        for token in self.tokens:
            self._flow.removeWidget(token)
            token.hide()
            token.deleteLater()
        self.tokens = []
        for target in targets:
            token = LinkButton(self._theme, self.token_text(target), "x")
            token.setProperty("target", target.name)
            token.setAccessibleName(_("Stop sending to {name}").format(name=target.name))
            token.setToolTip(plain.tip(token.accessibleName()))
            token.clicked.connect(lambda _on=False, target=target: self.acting.deny(target))
            self._flow.addWidget(token)
            self.tokens.append(token)
        self._flow.removeWidget(self.summary_label)
        self._flow.addWidget(self.summary_label)  # keeps it last

    def _toggle_armed(self) -> None:
        if self.acting.arming.is_on:
            self.acting.disarm()
        else:
            error = self.arm()
            if error:
                self._context.show_toast(error)
        self._last_state = ()
        self.refresh()


class ArmDurationMenu(Menu):
    """Menu for choosing the time after which sending is disarmed automatically."""

    def __init__(self, theme: Theme, parent: QWidget, acting: SessionActing) -> None:
        super().__init__(theme, parent, _("Stays armed for"))
        self._acting = acting
        self.setIcon(theme.icon("clock"))
        self._choices: dict[int, QAction] = {}
        group = QActionGroup(self)
        for count in ARMED_MINUTES:
            text = ngettext("{count} minute", "{count} minutes", count).format(count=count)
            action = self._choices[count] = self.addAction(text)
            action.setCheckable(True)
            action.triggered.connect(lambda _on=False, count=count: self._set_minutes(count))
            group.addAction(action)

    def _set_minutes(self, minutes: int) -> None:
        self._acting.armed_s = minutes * 60.0

    def entry(self) -> QAction:
        """Return the action that opens this menu, with the current choice checked."""
        for count, action in self._choices.items():
            action.setChecked(round(self._acting.armed_s / 60) == count)
        return self.menuAction()
