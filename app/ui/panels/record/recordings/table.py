"""Table of recordings: Enter or a double click opens a recording, F2 renames it, Delete deletes it."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QModelIndex, QRect, Qt, Signal
from PySide6.QtGui import QKeyEvent

from app.core.recording.folder import RecordingInfo
from app.ui.panels.record.recordings.columns import GAP, THUMBNAIL_SIZE
from app.ui.theme.theme import Theme
from app.ui.widgets.inputs.rename_field import RenameField
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.table.cells import EDGE
from app.ui.widgets.table.model import TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _


class RecordingTable(TableView[RecordingInfo]):
    """Table of recordings, in which a click selects a row without opening the recording.

    Signals:
        selected: Key of the row that was selected by mouse or keyboard, or "".
        rename_requested: Key of a recording to rename.
        delete_requested: Key of a recording to delete.
    """

    selected = Signal(str)
    rename_requested = Signal(str)
    delete_requested = Signal(str)

    def __init__(self, theme: Theme, model: TableModel[RecordingInfo]) -> None:
        super().__init__(theme, model, "when")
        self.order.is_descending = True
        self.field: RenameField | None = None
        self.doubleClicked.connect(self._open_row)
        self.selectionModel().currentRowChanged.connect(lambda _new, _old: self._emit_selected())

    def _open(self, index: QModelIndex) -> None:
        # A click doesn't open the recording, because that would replace the source of all panels.
        ...

    def _open_row(self, index: QModelIndex) -> None:
        super()._open(index)

    def _emit_selected(self) -> None:
        self.selected.emit(self.selected_key() or "")

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = self.selected_key()
        if key is None or not has_no_modifiers(event):
            super().keyPressEvent(event)
        elif event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._open_row(self.currentIndex())
        elif event.key() == Qt.Key.Key_F2:
            self.rename_requested.emit(key)
        elif event.key() == Qt.Key.Key_Delete:
            self.delete_requested.emit(key)
        else:
            super().keyPressEvent(event)

    def rename(self, key: str, name: str, on_rename: Callable[[str], bool]) -> None:
        """Start editing the name of a recording in place.

        Args:
            key: Key of the recording.
            name: Current name.
            on_rename: Receives the new name and returns False if it is invalid.
        """
        self.select_key(key)
        index = self.currentIndex()
        self.scrollTo(index)
        row = self.visualRect(self.model().index(index.row(), 0))
        left = row.left() + EDGE + round(self.theme.scaled(THUMBNAIL_SIZE.width())) + GAP - 8
        height = min(row.height() - 8, round(self.theme.scaled(32)))
        rect = QRect(left, row.center().y() - height // 2, max(80, row.right() - left - 8), height)
        accessible_name = _("Recording name")
        self.field = RenameField(self.theme, self.viewport(), rect, name, on_rename, accessible_name)
        self.field.closed.connect(self._rename_finished)

    def _rename_finished(self) -> None:
        had_focus = self.field is not None and self.field.hasFocus()
        self.field = None
        if had_focus:
            self.setFocus(Qt.FocusReason.OtherFocusReason)
