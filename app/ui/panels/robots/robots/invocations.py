"""Manual invocations of an action: texts for their states, and the list of the latest ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize, Signal
from PySide6.QtGui import QPainter
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from app.robots.description.description import Action, DataField
from app.ui.panels.robots.robots.input_text import input_summary, is_unit
from app.ui.text import plain
from app.ui.text.numbers import seconds_text
from app.ui.text.sensor_values import quantity_text, yes_no_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton
from nep.i18n import _, format_list

if TYPE_CHECKING:
    from app.core.robots.robot_link import Invocation

REMAINING_FIELD = "to_go"
RATIO_FIELDS = ("progress", "ratio", "share")
PERCENT_FIELDS = ("percent", "percentage")
ROW_HEIGHT = 28
MAX_TRIES = 5


def fields_text(fields: Sequence[DataField], values: Mapping[str, object]) -> str:
    """Format the values of fields, such as "0.3 m to go, moved 0.5 m".

    Missing values are omitted, and ratios such as ``progress``, which are shown by the progress bar.

    Args:
        fields: Descriptions of the fields.
        values: Values by field name.
    """
    parts = []
    for field in fields:
        value = values.get(field.name)
        if value is None or field.name in RATIO_FIELDS:
            continue
        if isinstance(value, bool):
            parts.append(f"{field.title} {yes_no_text(value)}")
        elif isinstance(value, (int, float)):
            text = quantity_text(float(round(value, 2)), field.unit)
            if field.name == REMAINING_FIELD:
                parts.append(f"{text} {field.title}")
            else:
                omit_title = is_unit(field.title, field.unit)
                parts.append(text if omit_title else f"{field.title} {text}")
        else:
            parts.append(f"“{value}”")
    return ", ".join(parts)


def feedback_text(action: Action, feedback: Mapping[str, object]) -> str:
    """Format the feedback of a running action, such as "0.3 m to go"."""
    return fields_text(action.feedback, feedback)


def output_text(action: Action, output: Mapping[str, object]) -> str:
    """Format the output of an action, without its duration."""
    fields = [field for field in action.output if not is_unit(field.title, field.unit)]
    return fields_text(fields, output)


def progress_of(action: Action, values: Mapping[str, object], feedback: Mapping[str, object]) -> float | None:
    """Return the progress of an action from 0 to 1, or None if it is unknown.

    The progress is reported by the robot, or derived from a requested and a remaining amount.

    Args:
        action: Action with its parameters and feedback.
        values: Input by parameter name.
        feedback: Latest feedback by field name.
    """
    for name in RATIO_FIELDS:
        reported_ratio = _float_or_none(feedback.get(name))
        if reported_ratio is not None:
            return _clamp_ratio(reported_ratio)
    for field in action.feedback:
        value = _float_or_none(feedback.get(field.name))
        if value is None:
            continue
        if field.unit == "%" or field.name in PERCENT_FIELDS:
            return _clamp_ratio(value / 100)
        target = next(
            (
                _float_or_none(values.get(parameter.name))
                for parameter in action.parameters
                if field.unit and parameter.unit == field.unit
            ),
            None,
        )
        if target:
            ratio = abs(value / target)
            return _clamp_ratio(1.0 - ratio if field.name == REMAINING_FIELD else ratio)
    return None


def state_text(action: Action, invocation: Invocation, title_of: Callable[[str], str]) -> str:
    """Format the current state of a running try, such as "sent" or its feedback.

    Args:
        action: Action of the try.
        invocation: Running try.
        title_of: Returns the title of another action by its name.
    """
    if invocation.state == "sent":
        return _("sent")
    if invocation.state == "accepted":
        if invocation.waits_for:
            return _("waits for {actions}").format(
                actions=format_list([title_of(name) for name in invocation.waits_for])
            )
        if invocation.replaces:
            return _("replaces {actions}").format(
                actions=format_list([title_of(name) for name in invocation.replaces])
            )
        return _("sent")
    elapsed = _("for {duration}").format(duration=seconds_text(invocation.elapsed_s))
    return feedback_text(action, invocation.feedback) or elapsed


def remaining_text(invocation: Invocation) -> str:
    """Format the time until a running try reaches its time limit; "" without a time limit."""
    left_s = invocation.remaining_s
    if left_s is None or not invocation.is_running:
        return ""
    return _("{seconds} s left").format(seconds=max(0, int(left_s + 0.999)))


def result_texts(invocation: Invocation, *, may_move: bool = False) -> tuple[str, str, str]:
    """Format the result of a try that has ended.

    Args:
        invocation: Try that has ended.
        may_move: True if the robot may still be moving; the text then doesn't say "stopped".

    Returns:
        Text and status of the chip, and a sentence with the reason or "".
    """
    elapsed = seconds_text(invocation.elapsed_s)
    if invocation.state == "succeeded":
        return _("done in {duration}").format(duration=elapsed), "ok", ""
    if invocation.state == "canceled":
        reason = invocation.error if invocation.error and invocation.error != "stopped" else ""
        template = _("ended after {duration}") if may_move else _("stopped after {duration}")
        return template.format(duration=elapsed), "off", _as_sentence(reason)
    return _("failed"), "error", _as_sentence(invocation.error or _("The robot reported no reason"))


def _as_sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') or not text else '.'}"


def _float_or_none(value: object) -> float | None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number else None  # type: ignore[arg-type]


def _clamp_ratio(ratio: float) -> float:
    return min(1.0, max(0.0, ratio))


class TryRow(PaintedButton):
    """Row of a try that has ended."""

    def __init__(self, theme: Theme, action: Action, invocation: Invocation) -> None:
        super().__init__(theme)
        self.invocation = invocation
        text, status, reason = result_texts(invocation)
        self.time_text = time.strftime("%H:%M:%S", time.localtime(invocation.sent_at_s))
        self.input_text = input_summary(action, invocation.input)
        output = output_text(action, invocation.output) if invocation.state == "succeeded" else ""
        self.result = f"{text}, {output}" if output else reason.rstrip(".") or text
        self.status = status
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        text = _("{when}, {values}, {result}; use these values again")
        self.setAccessibleName(text.format(when=self.time_text, values=self.input_text, result=self.result))
        self.setToolTip(plain.tip(_("{result}. Click to use these values again").format(result=self.result)))

    def sizeHint(self) -> QSize:
        return QSize(200, round(self._theme.scaled(ROW_HEIGHT)))

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        if self.is_highlighted:
            paint.box(painter, rect, theme.radius("small"), theme.colour("hover"))
        font = theme.font("body")
        result_colour = theme.colour("textSecondary")
        left = rect.left() + 6
        time_width = paint.width_of(font, "00:00:00") + 14
        paint.text_line(
            painter,
            QRectF(left, rect.top(), time_width, rect.height()),
            self.time_text,
            font,
            theme.colour("textTertiary"),
        )
        left += time_width
        result_width = min(paint.width_of(font, self.result) + 2, (rect.right() - left) * 0.6)
        right = QRectF(rect.right() - 6 - result_width, rect.top(), result_width, rect.height())
        status = theme.status(self.status)
        mark = QRectF(right.left() - 20, rect.center().y() - 7, 14, 14)
        paint_icon(painter, mark, status.icon, theme.colour(status.colour))
        paint.text_line(painter, right, self.result, font, result_colour)
        middle = QRectF(left, rect.top(), mark.left() - left - 8, rect.height())
        paint.text_line(painter, middle, self.input_text, font, theme.colour("text"))


class TryList(QWidget):
    """List of the latest tries of one action, newest first."""

    selected = Signal(dict)

    def __init__(self, theme: Theme, action: Action) -> None:
        super().__init__()
        self._theme, self._action = theme, action
        self._shown_ids: tuple[str, ...] = ()
        self.rows: list[TryRow] = []
        self.setAccessibleName(_("Recent results of {action}").format(action=action.title))
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 2, 0, 0)
        self._column.setSpacing(0)

    def show_tries(self, tries: Sequence[Invocation]) -> None:
        """Show the latest ended tries of the action.

        Args:
            tries: Tries of all actions, oldest first; running ones are ignored.
        """
        ended = [
            invocation
            for invocation in tries
            if invocation.action == self._action.name and not invocation.is_running
        ][-MAX_TRIES:]
        ids = tuple(invocation.id for invocation in ended)
        if ids == self._shown_ids:
            return
        self._shown_ids = ids
        for row in self.rows:
            self._column.removeWidget(row)
            row.deleteLater()
        self.rows = []
        for invocation in reversed(ended):
            row = TryRow(self._theme, self._action, invocation)
            row.clicked.connect(
                lambda _on=False, invocation=invocation: self.selected.emit(dict(invocation.input))
            )
            self._column.addWidget(row)
            self.rows.append(row)
