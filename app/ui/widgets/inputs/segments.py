"""Segmented control for up to four options."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from PySide6.QtCore import QRectF, QSize, Signal
from PySide6.QtGui import QFont, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QHBoxLayout, QLayout, QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _

_HEIGHTS: dict[str, tuple[int, int, str]] = {
    "small": (24, 10, "body"),
    "normal": (28, 14, "body"),
    "form": (32, 14, "label"),
}
GAP = 8


class _Segment(PaintedButton):
    elides_text = True

    def __init__(self, theme: Theme, label: str, icon: str | None, size: str, check: bool) -> None:
        self._icon, self._has_check_mark = icon, check
        self._is_icon_only = self._is_dot_visible = self.reserves_dot = False
        self._height, self._padding, self._kind = _HEIGHTS[size]
        super().__init__(theme, label, checkable=True)
        self.setAutoExclusive(True)

    def set_icon_only(self, is_icon_only: bool) -> None:
        # The text becomes the tooltip.
        self._is_icon_only = is_icon_only and self._icon is not None
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

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._is_icon_only:
            self.setProperty("shortened", True)
            self.setToolTip(plain.tip(self.text()))

    def _font(self) -> QFont:
        font = self._theme.font(self._kind)
        font.setWeight(font.Weight.Medium)
        return font

    def _icon_side(self) -> int:
        return round(self._theme.scaled(16))

    def _icons_width(self) -> int:
        icon_count = int(self._icon is not None) + int(self._has_check_mark) + int(self.reserves_dot) / 2
        return round((self._icon_side() + GAP) * icon_count) - (GAP if self._is_icon_only else 0)

    def sizeHint(self) -> QSize:
        width = paint.width_of(self._font(), self.displayed_text()) + 2 * self._padding + self._icons_width()
        return QSize(round(width) + 1, max(self._height, round(paint.height_of(self._font())) + 6))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        is_checked = self.isChecked()
        if is_checked:
            fill = theme.colour("pressed" if theme.is_dark else "panel")
            paint.box(painter, rect, theme.radius("small"), fill, theme.colour("border"))
        elif self.is_hovered:
            paint.box(painter, rect, theme.radius("small"), theme.colour("pressed"))
        colour = theme.colour(
            "text" if is_checked else "textSecondary" if self.isEnabled() else "textDisabled"
        )
        check_icon = "check" if self._has_check_mark and is_checked else None
        icons = [name for name in (check_icon, self._icon) if name]
        text_width = paint.width_of(self._font(), self.displayed_text()) - (GAP if self._is_icon_only else 0)
        side = self._icon_side()
        dot = (side + GAP) / 2 if self._is_dot_visible else 0.0
        left = max(6.0, rect.center().x() - (text_width + len(icons) * (side + GAP) + dot) / 2)
        for name in icons:
            paint_icon(painter, QRectF(left, rect.center().y() - side / 2, side, side), name, colour)
            left += side + GAP
        paint.text_line(
            painter, rect.adjusted(left, 0, 2 - dot, 0), self.displayed_text(), self._font(), colour
        )
        if self._is_dot_visible:
            dot_rect = QRectF(left + text_width + GAP - 2, rect.center().y() - dot / 2, dot, dot)
            paint_icon(painter, dot_rect, "dot", theme.colour("ok"))


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
        self._theme = theme
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

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        theme = self._theme
        rect = QRectF(self.rect())
        edge = theme.colour("border") if theme.is_dark or theme.is_high_contrast else None
        paint.box(painter, rect, theme.radius("panel"), theme.colour("sunken"), edge)
        painter.end()
