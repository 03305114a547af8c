"""Check box with a label. The style sheet paints it."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QCheckBox, QStyle, QStyleOptionButton

from app.ui.theme.style_sheet import CHECK_BOX_SIDE
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import click_on_enter, set_up_button


class CheckBox(QCheckBox):
    """Check box with a label. A text that doesn't fit is elided and shown as tooltip."""

    text_kind, gap, min_height, padding = "body", 8, 26, 6

    def __init__(self, theme: Theme, text: str, is_checked: bool = False) -> None:
        super().__init__()
        self._theme = theme
        self.set_text(text)
        self.setChecked(is_checked)
        set_up_button(self, theme, "small")

    def set_text(self, text: str) -> None:
        """Set the text, which is also the accessible name."""
        self.setText(text)
        self.setAccessibleName(text)

    def box_width(self) -> float:
        """Return the width in px of the box with its margin."""
        return self._theme.scaled(CHECK_BOX_SIDE) + 1

    def sizeHint(self) -> QSize:
        font = self._theme.font(self.text_kind)
        text_width = self.gap + paint.width_of(font, self.text()) if self.text() else 0
        height = max(self.min_height, round(paint.height_of(font)) + self.padding)
        return QSize(round(self.box_width() + text_width) + 2, height)

    def minimumSizeHint(self) -> QSize:
        preferred = self.sizeHint()
        return QSize(min(round(self._theme.scaled(72)), preferred.width()), preferred.height())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not click_on_enter(self, event):
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        paint.set_elision_tooltip(self, self.text())

    def initStyleOption(self, option: QStyleOptionButton) -> None:
        super().initStyleOption(option)
        contents = self.style().subElementRect(QStyle.SubElement.SE_CheckBoxContents, option, self)
        elided = self.fontMetrics().elidedText(self.text(), Qt.TextElideMode.ElideRight, contents.width() + 1)
        option.text = elided.replace("&", "&&")
