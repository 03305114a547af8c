"""List of saved messages with their topics and states, such as sending, invalid or not armed."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QModelIndex, Qt, Signal
from PySide6.QtGui import QKeyEvent

from app.core.run.acting.acting import SessionActing
from app.core.run.acting.arming import Target
from app.core.run.acting.json_text import parse_json_text
from app.core.run.acting.shelf import SavedMessage
from app.core.run.acting.templates import is_plain_text
from app.ui.text.numbers import rate_text
from app.ui.theme.theme import Theme
from app.ui.widgets.keyboard import has_no_modifiers as is_plain_key
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.two_lines import ROW_PX, TwoLines
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy


def state_cell(message: SavedMessage, acting: SessionActing) -> Cell:
    """Return the cell with the state of a message as text and icon."""
    if acting.outbox.is_sending(message.id):
        return Cell(_("{rate}/s").format(rate=rate_text(message.rate_hz)), "dot", "warn")
    fault = None if is_plain_text(message.msg_type) else parse_json_text(message.text).fault
    if fault is not None:
        return Cell(_("error, line {line}").format(line=fault.line), "circle-x", "error")
    if acting.problem_of(message):
        return Cell(_("not ready"), "circle-x", "error")
    if not acting.arming.allows(Target("topic", message.topic)):
        return Cell(_("not armed"), "lock", "textTertiary")
    return Cell("", "send", "textSecondary", accessible_text=_("can be sent"))


class SavedMessageList(TableView[SavedMessage]):
    """List of saved messages; a click selects a message.

    Args:
        state: Returns the cell with the state of a message.

    Signals:
        selected: Id of the message that was selected by mouse or keyboard.
        send_requested: Id of a message to send.
        copy_requested: Id of a message to duplicate.
        delete_requested: Id of a message to delete.
    """

    selected = Signal(str)
    send_requested = Signal(str)
    copy_requested = Signal(str)
    delete_requested = Signal(str)

    def __init__(self, theme: Theme, state: Callable[[SavedMessage], Cell]) -> None:
        columns: tuple[Column[SavedMessage], ...] = (
            Column(
                "message",
                lazy("Message"),
                90,
                lambda each: Cell(
                    mark=TwoLines(each.name, each.topic or _("no topic yet")),
                    accessible_text=f"{each.name}, {each.topic}",
                ),
                stretch=True,
                tip=lambda each: f"{each.name}\n{each.topic}",
            ),
            Column("state", lazy("State"), 112, state, is_numeric=True),
        )
        super().__init__(theme, TableModel(columns, lambda each: each.id))
        self.horizontalHeader().hide()
        self.setAccessibleName(_("Saved messages"))
        self.selectionModel().currentRowChanged.connect(lambda _new, _old: self._emit_selected())
        theme.changed.connect(self.fit_rows)
        self.fit_rows()

    def fit_rows(self) -> None:
        """Adjust the row height to the text size."""
        self.set_row_height(round(self.theme.scaled(ROW_PX)), large=False)

    def _open(self, index: QModelIndex) -> None:
        # A click only selects.
        ...

    def _emit_selected(self) -> None:
        self.selected.emit(self.selected_key() or "")

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, pressed_key = self.selected_key(), event.key()
        has_ctrl = event.modifiers() == Qt.KeyboardModifier.ControlModifier
        if key is not None and has_ctrl and pressed_key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.send_requested.emit(key)
        elif key is not None and has_ctrl and pressed_key == Qt.Key.Key_D:
            self.copy_requested.emit(key)
        elif key is not None and is_plain_key(event) and pressed_key == Qt.Key.Key_Delete:
            self.delete_requested.emit(key)
        else:
            super().keyPressEvent(event)
