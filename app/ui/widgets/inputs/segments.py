"""Segmented control for up to four options."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QHBoxLayout, QLayout, QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button, Size
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _

DOT_OVERLAP = -4  # px
MIN_WIDTH = 40  # px; a narrower segment has no space for three letters
_SIZES: dict[str, Size] = {"small": "smallSegment", "normal": "segment", "form": "formSegment"}


class _Segment(Button):
    def __init__(self, theme: Theme, label: str, icon: str | None, size: str, check: bool) -> None:
        self._has_check_mark = check
        self._is_icon_only = self._is_dot_visible = self.reserves_dot = False
        super().__init__(theme, label, icon, kind="segment", size=_SIZES[size])
        self._min_width = MIN_WIDTH
        self.setCheckable(True)
        self.setAutoExclusive(True)

    def set_icon_only(self, is_icon_only: bool) -> None:
        # The text becomes the tooltip.
        self._is_icon_only = is_icon_only and self.icon_name is not None
        self.updateGeometry()
        self.update()

    def set_dot(self, visible: bool) -> None:
        """Show or hide the dot after the text, which marks an option that is in use."""
        if visible != self._is_dot_visible:
            self._is_dot_visible = visible
            template = _("{choice}, on") if visible else "{choice}"
            self.setAccessibleName(template.format(choice=self.text()))
            self.update()

    def displayed_text(self) -> str:
        return "" if self._is_icon_only else self.text()

    def displayed_icon(self) -> str | None:
        return "check" if self._has_check_mark and self.isChecked() else self.icon_name

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._is_icon_only:
            self.setProperty("shortened", True)
            self.setToolTip(plain.tip(self.text()))

    def _indicator_width(self) -> int:
        # space for a check mark that isn't shown, and for the dot
        width = self.icon_side() + self.metrics.gap
        has_hidden_mark = self._has_check_mark and self.displayed_icon() is None
        return width * has_hidden_mark + width // 2 * self.reserves_dot

    def width_with(self, text: str) -> int:
        return super().width_with("" if self._is_icon_only else text)

    def icon_colour_role(self) -> str:
        return "text" if self.isChecked() else super().icon_colour_role()

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self._is_dot_visible:
            painter, side = QPainter(self), self.icon_side() * 0.75
            text_width = paint.width_of(self.font(), self.text())
            icon_width = self._icon_width(self.text()) if self.displayed_icon() else 0
            left = (self.width() + icon_width + text_width) / 2 - DOT_OVERLAP
            dot_rect = QRectF(left, (self.height() - side) / 2, side, side)
            paint_icon(painter, dot_rect, "dot", self._theme.colour("ok"))
            painter.end()


class Segments(QWidget):
    """Segmented control for up to four options; `changed` is emitted with the value that the user selects."""

    changed = Signal(str)

    def __init__(
        self,
        theme: Theme,
        options: Sequence[tuple[str, str, str | None]],
        value: str | None = None,
        *,
        check: bool = False,
        size: Literal["small", "normal", "form"] = "normal",
        name: str = "",
        wraps: bool = False,
        has_dots: bool = False,
    ) -> None:
        # `options` are (value, label, icon or None); `check` shows a check mark at the selected one; `wraps`
        # uses several rows if narrow.
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setAccessibleName(name)
        row: QLayout
        if wraps:
            self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
            row = Flow(self, gap=1, row_gap=1)
        else:
            self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
            row = QHBoxLayout(self)
            row.setSpacing(1)
        row.setContentsMargins(2, 2, 2, 2)
        self._segments: dict[str, _Segment] = {}
        for key, text, icon in options:
            segment = _Segment(theme, text, icon, size, check)
            segment.reserves_dot = has_dots
            row.addWidget(segment)
            self._segments[key] = segment
            segment.clicked.connect(lambda _on=False, key=key: self.changed.emit(key))
        self.set_value(value if value is not None else next(iter(self._segments), ""))

    def set_icon_only(self, is_icon_only: bool) -> None:
        """Show only icons if `is_icon_only`, else icons and texts. Options without an icon keep the text."""
        for segment in self._segments.values():
            segment.set_icon_only(is_icon_only)

    def set_dot(self, value: str, visible: bool) -> None:
        """Show or hide a dot after the text of an option, which marks the option as in use.

        Args:
            value: Value of the option.
            visible: True to show the dot.
        """
        self._segments[value].set_dot(visible)

    @property
    def value(self) -> str:
        """Value of the selected option, or "" if none is selected."""
        return next((key for key, segment in self._segments.items() if segment.isChecked()), "")

    def selected_button(self) -> QAbstractButton | None:
        """Return the button of the selected option, or None."""
        return self._segments.get(self.value)

    def set_value(self, value: str) -> None:
        """Select an option by its value, without emitting `changed`; an unknown value is ignored."""
        if value in self._segments:
            self._segments[value].setChecked(True)

    def clear_selection(self) -> None:
        """Deselect all options until the user selects one."""
        for segment in self._segments.values():
            segment.setAutoExclusive(False)
            segment.setChecked(False)
            segment.setAutoExclusive(True)
