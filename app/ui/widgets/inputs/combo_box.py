"""Combo box. The style sheet paints it."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QComboBox, QStyle, QStyledItemDelegate, QStyleOptionComboBox

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.menus import clip_corners, set_round_corners

MAX_VISIBLE_ITEMS = 12


class ComboBox(QComboBox):
    """Combo box whose entries have a value and a label. Ignores the mouse wheel without focus."""

    def __init__(self, theme: Theme, options: Sequence[tuple[str, str]] = (), *, name: str = "") -> None:
        # `options` are (value, label).
        super().__init__()
        self._theme = theme
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setProperty("focusRadius", theme.radius("control"))
        for value, text in options:
            self.addItem(text, value)
        self.setItemDelegate(QStyledItemDelegate(self))  # lets the style sheet set the padding of items
        self.setMaxVisibleItems(MAX_VISIBLE_ITEMS)
        set_round_corners(self.view().window())

    @property
    def value(self) -> str:
        """Value of the selected entry, or its label if it has no value; "" if no entry is selected."""
        data = self.currentData()
        return data if isinstance(data, str) else self.currentText()

    def set_value(self, value: str) -> None:
        """Select the entry with this value; an unknown value is ignored."""
        index = self.findData(value)
        if index >= 0:
            self.setCurrentIndex(index)

    def sizeHint(self) -> QSize:
        font = self.font()
        widest = max((paint.width_of(font, self.itemText(i)) for i in range(self.count())), default=60)
        height = max(self._theme.size("control", "normal"), round(paint.height_of(font)) + 10)
        return QSize(round(widest) + 46, height)

    def minimumSizeHint(self) -> QSize:
        return QSize(min(80, self.sizeHint().width()), self.sizeHint().height())

    def showPopup(self) -> None:
        super().showPopup()
        clip_corners(self.view().window(), self._theme.radius("panel"))

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()

    def initStyleOption(self, option: QStyleOptionComboBox) -> None:
        super().initStyleOption(option)
        field = self.style().subControlRect(
            QStyle.ComplexControl.CC_ComboBox, option, QStyle.SubControl.SC_ComboBoxEditField, self
        )
        text, mode = self.currentText(), Qt.TextElideMode.ElideRight
        option.currentText = self.fontMetrics().elidedText(text, mode, field.width() - 1)
