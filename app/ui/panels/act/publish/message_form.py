"""Form for editing a message: name, topic, type, placeholders, JSON with error checking, and send buttons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from PySide6.QtCore import QStringListModel, Qt, Signal
from PySide6.QtWidgets import (
    QCompleter,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QSizePolicy,
    QStyledItemDelegate,
    QVBoxLayout,
    QWidget,
)

from app.core.run.acting.json_text import MAX_LENGTH, format_json, parse_json_text
from app.core.run.acting.sending import MAX_HZ, MIN_HZ
from app.core.run.acting.shelf import MAX_NAME_LENGTH, SavedMessage
from app.core.run.acting.templates import is_plain_text
from app.ui.panels.act.publish.value_fields import ValueFields
from app.ui.text import plain
from app.ui.text.numbers import tip_with_key
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ElidedLabel, NumberEdit, Separator, label
from app.ui.widgets.indicators import StatusIcon
from app.ui.widgets.inputs.json_edit import JsonEdit
from app.ui.widgets.menus import FieldContextMenu
from nep.errors import NepError
from nep.i18n import _
from nep.messages.json_fault import JsonFault

LABEL_WIDTH_PX = 80
RATE_WIDTH_PX = 84
MAX_COMPLETIONS = 500


class TopicEdit(QLineEdit):
    """Text field for the name of a topic, with completion."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.setAccessibleName(_("Topic"))
        self.setPlaceholderText("/topic")
        self.setProperty("focusRadius", theme.radius("control"))
        FieldContextMenu(theme, self)
        self._completion_model = QStringListModel(self)
        completer = QCompleter(self._completion_model, self)
        completer.setFilterMode(Qt.MatchFlag.MatchContains)
        completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        completer.setMaxVisibleItems(10)
        popup = completer.popup()
        if popup is not None:
            popup.setProperty("offers", "true")
            popup.setItemDelegate(QStyledItemDelegate(popup))  # lets the style sheet set the padding of items
        self.setCompleter(completer)

    def set_completions(self, names: Sequence[str]) -> None:
        """Set the names offered as completions."""
        completions = list(names[:MAX_COMPLETIONS])
        if completions != self._completion_model.stringList():
            self._completion_model.setStringList(completions)


class MessageForm(QWidget):
    """Form for editing and sending one message.

    `changed` carries the edited message; the other signals request an action.

    Args:
        type_of: Returns the message type of an existing topic, or "".
    """

    changed = Signal(object)  # SavedMessage
    send_requested = Signal()
    repeat_requested = Signal()
    template_requested = Signal()

    def __init__(self, theme: Theme, type_of: Callable[[str], str]) -> None:
        super().__init__()
        self._theme, self._type_of = theme, type_of
        self.message: SavedMessage | None = None
        self.parsed = parse_json_text("{}")
        self._is_showing = False
        self._make_fields()
        self._make_text()
        self._make_buttons()
        self._arrange()

    # -- construction -------------------------------------------------------------------------------------

    def _make_fields(self) -> None:
        theme = self._theme
        self.name_field = QLineEdit()
        self.name_field.setAccessibleName(_("Message name"))
        self.name_field.setMaxLength(MAX_NAME_LENGTH)
        FieldContextMenu(theme, self.name_field)
        self.topic_field = TopicEdit(theme)
        self.type_field = QLineEdit()
        self.type_field.setAccessibleName(_("Message type"))
        self.type_field.setPlaceholderText("json")
        FieldContextMenu(theme, self.type_field)
        for field in (self.name_field, self.type_field):
            field.setProperty("focusRadius", theme.radius("control"))
        self.value_fields = ValueFields(theme)
        self.name_field.textEdited.connect(lambda text: self._update_message(name=text))
        self.topic_field.textChanged.connect(self._topic_typed)
        self.type_field.textEdited.connect(lambda text: self._update_message(msg_type=text.strip() or "json"))
        self.value_fields.typed.connect(self._value_typed)

    def _make_text(self) -> None:
        theme = self._theme
        self.template_button = Button(theme, _("Use the last message"), "history", kind="ghost", size="small")
        self.template_button.setToolTip(
            plain.tip(_("Copies the topic's last message, or the fields of its type"))
        )
        self.format_button = Button(theme, _("Format"), "wand-sparkles", kind="ghost", size="small")
        self.format_button.setToolTip(plain.tip(_("Puts each field on its own line")))
        for button in (self.template_button, self.format_button):
            button.allow_shrinking()
        self.edit = JsonEdit(theme, _("Message"))
        self.fault_icon = StatusIcon(theme, "error", height=20)
        self.problem_label = label("", "small", role="error", wrap=True)
        self.problem_label.setMinimumWidth(0)
        self.fix_button = Button(theme, _("Fix it"), "wrench", size="small")
        self.template_button.clicked.connect(self.template_requested)
        self.format_button.clicked.connect(self.format_json)
        self.fix_button.clicked.connect(self.apply_fix)
        self.edit.changed.connect(self._text_typed)
        self.edit.submitted.connect(self.send_requested)

    def _make_buttons(self) -> None:
        theme = self._theme
        self.send_button = Button(theme, _("Send"), "send", kind="primary")
        self.send_button.setToolTip(plain.tip(tip_with_key(_("Sends the message once"), "Ctrl+Enter")))
        self.last_result_label = ElidedLabel("small", "textSecondary")
        self.repeat_button = Button(theme, _("Start sending"), "repeat")
        self.rate_field = NumberEdit(theme, MIN_HZ, MAX_HZ, _("/s"), 1)
        self.rate_field.setAccessibleName(_("Messages per second"))
        self.rate_field.setFixedWidth(round(theme.scaled(RATE_WIDTH_PX)))
        self.rate_field.number_entered.connect(lambda value: self._update_message(rate_hz=value))
        self.count_label = ElidedLabel("small", "textSecondary")
        self.rate_hint = label("", "small", role="textTertiary", wrap=True)
        self.rate_hint.setMinimumWidth(0)
        self.rate_field.problem_changed.connect(self._update_rate_hint)
        self._update_rate_hint("")
        self.send_button.clicked.connect(self.send_requested)
        self.repeat_button.clicked.connect(self.repeat_requested)

    def _update_rate_hint(self, problem: str) -> None:
        hint = _("0.1 to 50 per second; stops when disarmed")
        self.rate_hint.setText(problem or hint)

    def _arrange(self) -> None:
        fields = QGridLayout()
        fields.setHorizontalSpacing(10)
        fields.setVerticalSpacing(8)
        fields.setColumnMinimumWidth(0, round(self._theme.scaled(LABEL_WIDTH_PX)))
        fields.setColumnStretch(1, 1)
        self._values_label = _make_name_label(_("Values"))
        rows = (
            (_make_name_label(_("Name")), self.name_field),
            (_make_name_label(_("Topic")), self.topic_field),
            (_make_name_label(_("Type")), self.type_field),
        )
        for index, (name_label, field) in enumerate((*rows, (self._values_label, self.value_fields))):
            if isinstance(field, QLineEdit):
                name_label.setBuddy(field)
            fields.addWidget(name_label, index, 0, Qt.AlignmentFlag.AlignTop)
            fields.addWidget(field, index, 1)
        header = QHBoxLayout()
        header.setSpacing(4)
        header.addWidget(label(_("Message"), "small", role="textSecondary"))
        header.addStretch(1)
        header.addWidget(self.template_button)
        header.addWidget(self.format_button)
        fault = QHBoxLayout()
        fault.setSpacing(6)
        fault.addWidget(self.fault_icon, 0, Qt.AlignmentFlag.AlignTop)
        fault.addWidget(self.problem_label, 1)
        fault.addWidget(self.fix_button, 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 10, 12, 10)
        column.setSpacing(8)
        column.addLayout(fields)
        column.addLayout(header)
        column.addWidget(self.edit, 1)
        column.addLayout(fault)
        column.addWidget(Separator(self._theme))
        column.addLayout(self._sending_rows())

    def _sending_rows(self) -> QVBoxLayout:
        send_row, repeat_row = QHBoxLayout(), QHBoxLayout()
        for row, parts in (
            (send_row, (self.send_button, self.last_result_label)),
            (repeat_row, (self.repeat_button, self.rate_field, self.count_label)),
        ):
            row.setSpacing(10)
            for part in parts:
                row.addWidget(part, 1 if isinstance(part, ElidedLabel) else 0)
        for status_label in (self.last_result_label, self.count_label):
            status_label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        rows = QVBoxLayout()
        rows.setSpacing(8)
        rows.addLayout(send_row)
        rows.addLayout(repeat_row)
        rows.addWidget(self.rate_hint)
        return rows

    # -- display ------------------------------------------------------------------------------------------

    def show_message(self, message: SavedMessage) -> None:
        """Show a message. Fields with an equivalent value are not changed, so as not to disturb typing."""
        is_other_message = self.message is None or self.message.id != message.id
        if message == self.message:
            return
        self._is_showing = True
        self.message = message
        for field, text in (
            (self.name_field, message.name),
            (self.topic_field, message.topic),
            (self.type_field, message.msg_type),
        ):
            if is_other_message or (field.text().strip() or "json") != (text or "json"):
                field.setText(text)
        self.edit.set_text(message.text)
        if is_other_message or not self.rate_field.hasFocus():
            self.rate_field.show_number(message.rate_hz)
        self._is_showing = False
        self._validate()

    def _validate(self) -> None:
        # Validates the text and shows fields for its placeholders.
        message = self.message
        if message is None:
            return
        is_json = not is_plain_text(message.msg_type)
        self.parsed = parse_json_text(message.text) if is_json else parse_json_text("{}")
        self.edit.set_highlighting(is_json)
        fault = self.parsed.fault
        self.edit.mark_line(fault.line if fault is not None else 0)
        self.format_button.setEnabled(is_json and fault is None and not self.parsed.placeholders)
        self.value_fields.show_fields(self.parsed.manual_placeholders, dict(message.values))
        for widget in (self._values_label, self.value_fields):
            widget.setVisible(bool(self.parsed.manual_placeholders))

    def show_problem(self, problem: str) -> None:
        """Show the reason why the message can't be sent; "" hides the reason."""
        fault = self.parsed.fault
        message = _("{problem} The message can't be sent yet.").format(problem=problem) if problem else ""
        if message != self.problem_label.text():
            self.problem_label.setText(message)
        self.fault_icon.setVisible(bool(problem))
        self.problem_label.setVisible(bool(problem))
        self.fix_button.setVisible(fault is not None and fault.fix is not None)

    # -- user actions -------------------------------------------------------------------------------------

    def _update_message(self, **changes: object) -> None:
        if self.message is None or self._is_showing:
            return
        self.message = replace(self.message, **changes)  # type: ignore[arg-type]
        self._validate()
        self.changed.emit(self.message)

    def _topic_typed(self, text: str) -> None:
        if self._is_showing:
            return
        topic = text.strip()
        msg_type = self._type_of(topic)
        if msg_type and msg_type != self.type_field.text():
            self.type_field.setText(msg_type)
            self._update_message(topic=topic, msg_type=msg_type)
        else:
            self._update_message(topic=topic)

    def _value_typed(self, name: str, text: str) -> None:
        if self.message is not None:
            self.message = self.message.with_value(name, text)
            self._validate()
            self.changed.emit(self.message)

    def _text_typed(self) -> None:
        text = self.edit.text()
        if self.message is not None and text != self.message.text:
            self._update_message(text=text[: MAX_LENGTH + 1])

    def set_type(self, msg_type: str) -> None:
        """Set the message type."""
        self.type_field.setText(msg_type)
        self._update_message(msg_type=msg_type)

    def replace_text(self, text: str) -> None:
        """Replace the whole JSON text as one edit that can be undone."""
        self.edit.replace(0, len(self.edit.text()), text)

    def format_json(self) -> None:
        """Format the JSON text, or show why this fails: an error, or a placeholder without a value."""
        try:
            self.replace_text(format_json(self.parsed.fill({})))
        except NepError as error:
            self.show_problem(str(error))

    def apply_fix(self) -> None:
        """Apply the suggested fix for the first error in the JSON text, if there is one."""
        fault: JsonFault | None = self.parsed.fault
        if fault is not None and fault.fix is not None:
            self.edit.replace(fault.fix.start, fault.fix.end, fault.fix.text)
            self.edit.setFocus(Qt.FocusReason.OtherFocusReason)


def _make_name_label(text: str) -> QLabel:
    widget = label(text, "body", role="textSecondary")
    widget.setMinimumHeight(26)
    return widget
