"""Row of one alarm: switch, sentence, state chip, snooze button and menu."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from app.ui.panels.watch.alarms.phrases import SLOT_NAMES, PhrasePart, parts_of
from app.ui.panels.watch.alarms.slots import AlarmSlot
from app.ui.theme.theme import Theme
from app.ui.widgets import Chip, ElidedLabel, IconButton, Separator, Switch, label
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _
from nep.programs.alarms import AlarmRule
from nep.programs.alarms.sentences import condition_text


class AlarmRow(QWidget):
    """Row of one alarm.

    Signals:
        switched: True if the user enabled the alarm, False if the user disabled it.
        slot_pressed: `PhrasePart` of a slot that was clicked.
        action_removed: `PhrasePart` of an action to remove.
        snooze_pressed: The snooze button was clicked.
        more_pressed: The menu button was clicked.
    """

    switched = Signal(bool)
    slot_pressed = Signal(object)
    action_removed = Signal(object)
    snooze_pressed = Signal()
    more_pressed = Signal()

    def __init__(self, theme: Theme, rule_id: str) -> None:
        super().__init__()
        self._theme, self.rule_id = theme, rule_id
        self._shown_parts: list[PhrasePart] = []
        self.slots: dict[str, AlarmSlot] = {}
        self._labels: list[QLabel] = []
        self.switch = Switch(theme, "")
        self.switch.clicked.connect(lambda: self.switched.emit(self.switch.isChecked()))
        self.sentence = QWidget()
        self._flow = Flow(self.sentence, gap=5, row_gap=4)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.sentence.setSizePolicy(policy)
        self.chip = Chip(theme, "", "off", "")
        self.note = ElidedLabel("small", "textTertiary")
        self.snooze_button = IconButton(theme, "bell-off", _("Snooze"), size=26)
        self.more_button = IconButton(theme, "ellipsis", _("More"), size=26)
        self.snooze_button.clicked.connect(self.snooze_pressed)
        self.more_button.clicked.connect(self.more_pressed)
        self._arrange()

    def _arrange(self) -> None:
        status_row = QHBoxLayout()
        status_row.setContentsMargins(0, 0, 0, 0)
        status_row.setSpacing(10)
        status_row.addWidget(self.chip)
        status_row.addWidget(self.note, 1)
        text_column = QVBoxLayout()
        text_column.setContentsMargins(0, 0, 0, 0)
        text_column.setSpacing(5)
        text_column.addWidget(self.sentence)
        text_column.addLayout(status_row)
        row = QHBoxLayout()
        row.setContentsMargins(12, 8, 8, 7)
        row.setSpacing(8)
        row.addWidget(self.switch, 0, Qt.AlignmentFlag.AlignTop)
        row.addLayout(text_column, 1)
        row.addWidget(self.snooze_button, 0, Qt.AlignmentFlag.AlignTop)
        row.addWidget(self.more_button, 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(row)
        column.addWidget(Separator(self._theme))

    def show_rule(self, rule: AlarmRule, icon: str, *, is_snoozed: bool) -> None:
        """Show a rule. Widgets of unchanged slots are reused, so that they don't lose the focus.

        Args:
            rule: Rule to show.
            icon: Name of the icon for the message type of the rule's topic.
            is_snoozed: True while the alarm is snoozed.
        """
        text = condition_text(rule.condition)
        self.setAccessibleName(text)
        self.switch.setAccessibleName(_("Enable: {condition}").format(condition=text))
        self.switch.setChecked(rule.is_enabled)
        self.snooze_button.set_icon("bell" if is_snoozed else "bell-off")
        self.snooze_button.set_name(_("Stop snoozing") if is_snoozed else _("Snooze for 10 min"))
        parts = parts_of(rule, icon)
        if parts != self._shown_parts:
            self._shown_parts = parts
            self._rebuild(parts)

    def _rebuild(self, parts: list[PhrasePart]) -> None:
        while self._flow.takeAt(0) is not None:
            continue
        for word_label in self._labels:
            word_label.deleteLater()
        self._labels = []
        stale_slots = {
            key: slot for key, slot in self.slots.items() if key not in {part.key for part in parts}
        }
        for part in parts:
            if part.kind == "word":
                self._add_word(part.text)
                continue
            slot = self.slots.get(part.key)
            if slot is None:
                slot = self.slots[part.key] = self._new_slot(part)
            slot.show_part(part)
            self._flow.addWidget(slot)
            slot.show()
        for key, slot in stale_slots.items():
            if slot.hasFocus():
                self.slots["add"].setFocus(Qt.FocusReason.OtherFocusReason)
            del self.slots[key]
            slot.hide()
            slot.deleteLater()
        previous: QWidget = self.switch
        for part in parts:
            if part.kind != "word":
                QWidget.setTabOrder(previous, self.slots[part.key])
                previous = self.slots[part.key]
        QWidget.setTabOrder(previous, self.snooze_button)
        QWidget.setTabOrder(self.snooze_button, self.more_button)
        self.sentence.updateGeometry()

    def _add_word(self, text: str) -> None:
        word_label = label(text, "body", role="textSecondary")
        self._labels.append(word_label)
        add = self._flow.add_attached if text == "," else self._flow.addWidget
        add(word_label)
        word_label.show()

    def _new_slot(self, part: PhrasePart) -> AlarmSlot:
        slot = AlarmSlot(self._theme, part, _(SLOT_NAMES[part.role]))
        slot.clicked.connect(lambda: self.slot_pressed.emit(slot.part))
        slot.removed.connect(lambda: self.action_removed.emit(slot.part))
        return slot

    def show_state(self, text: str, status: str, icon: str | None, note: str) -> None:
        """Update the state chip and the note next to it.

        Args:
            text: Text of the chip.
            status: Status of the chip, such as "ok", "warn" or "error".
            icon: Name of the chip's icon; None for the default icon of the status.
            note: Text of the note.
        """
        self.chip.set(text, status, icon)
        if self.note.text() != note:
            self.note.setText(note)
