"""Buttons. Qt paints them with the application's style sheet, except Stop and the buttons of some panels.

Run, Pause, Step and Stop keep their positions and widths in every state.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QKeyEvent, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QPushButton,
    QSizePolicy,
    QStyleOptionButton,
    QStyleOptionToolButton,
    QToolButton,
    QWidget,
)

from app.ui.text import plain
from app.ui.text.numbers import tip_with_key
from app.ui.theme.icons import paint_icon
from app.ui.theme.style_sheet import BUTTON_COLOURS
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.keyboard import has_no_modifiers
from nep.i18n import _

Kind = Literal["plain", "primary", "ghost", "run", "stop", "link", "segment", "recording", "replay"]
Size = Literal["small", "normal", "form", "large", "link", "smallSegment", "segment", "formSegment"]
CHEVRON, CHEVRON_GAP = 14, 6
QT_ICON_GAP = 2  # px that Qt adds between the icon and the text of a QPushButton
BarName = Literal["runBar", "toolBar", "appBar"]
RUN_WIDTH = 112
ICON_ONLY_WIDTH = 56
DROP_TARGET_WIDTH = 2.0
STOP_RING_WIDTH = 4  # px around Stop, for the ring that shows pending replies


class _ButtonMetrics(NamedTuple):
    height: int
    font: str
    icon: int
    gap: int
    padding: int
    radius: str


_METRICS: dict[str, _ButtonMetrics] = {
    "small": _ButtonMetrics(26, "body", 14, 6, 9, "small"),
    "normal": _ButtonMetrics(32, "body", 16, 8, 12, "control"),
    "form": _ButtonMetrics(36, "label", 16, 8, 14, "control"),
    "large": _ButtonMetrics(44, "button", 20, 10, 18, "large"),
    "link": _ButtonMetrics(24, "title", 16, 6, 0, "small"),
    "smallSegment": _ButtonMetrics(24, "body", 16, 8, 10, "small"),
    "segment": _ButtonMetrics(28, "body", 16, 8, 14, "small"),
    "formSegment": _ButtonMetrics(32, "label", 16, 8, 14, "small"),
}
_MIN_PADDING = 5  # px beside the contents of a button that is narrower than its size hint


def assign_command(widget: QWidget, command: str) -> None:
    """Associate a button with a command, whose tooltip and current shortcut the button then shows."""
    widget.setProperty("command", command)


def set_up_button(button: QAbstractButton, theme: Theme, radius: str) -> None:
    """Set the policies for focus and size, and the radius of the focus ring.

    Args:
        button: Button.
        theme: Theme.
        radius: Name of the corner radius in the theme.
    """
    button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
    button.setProperty("focusRadius", theme.radius(radius))
    theme.changed.connect(button.updateGeometry)


def click_on_enter(button: QAbstractButton, event: QKeyEvent) -> bool:
    """Click a button on Enter, ignoring auto-repeat; return True if the key was handled.

    Qt does so only for a QPushButton with `autoDefault`, which also repeats the click while Enter is held.
    """
    if event.key() not in {Qt.Key.Key_Return, Qt.Key.Key_Enter} or not has_no_modifiers(event):
        return False
    if not event.isAutoRepeat():
        button.click()
    return True


class PaintedButton(QAbstractButton):
    """Base class of painted buttons. Subclasses implement `paint_button`.

    The buttons are repainted on hover and press, and scale with the text size of the theme. The accessible
    name is the text, unless another one is set.
    """

    elides_text = False
    """True if a long text is elided; the full text is then shown as tooltip."""

    def __init__(
        self,
        theme: Theme,
        text: str = "",
        *,
        radius: str = "small",
        checkable: bool = False,
        parent: QWidget | None = None,
    ) -> None:
        # `radius` is the name of the corner radius in the theme.
        super().__init__(parent)
        self._theme = theme
        self.set_text(text)
        self.setCheckable(checkable)
        set_up_button(self, theme, radius)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self._is_drop_target = False

    @property
    def is_drop_target(self) -> bool:
        """True if the button is the drop target of a drag."""
        return self._is_drop_target

    def set_drop_target(self, is_drop_target: bool) -> None:
        """Set whether the button is the drop target of a drag; a drop target has a ring."""
        if is_drop_target != self._is_drop_target:
            self._is_drop_target = is_drop_target
            self.update()

    def set_text(self, text: str, name: str = "") -> None:
        """Set the text and the accessible name.

        Args:
            text: Text.
            name: Accessible name, or "" to use the text.
        """
        self.setText(text)
        self.setAccessibleName(name or text)

    @property
    def is_hovered(self) -> bool:
        """True while the mouse pointer is over the button, if the button is enabled."""
        return self.underMouse() and self.isEnabled()

    @property
    def is_highlighted(self) -> bool:
        """True while the button is hovered or held down."""
        return self.is_hovered or self.isDown()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self.elides_text:
            paint.set_elision_tooltip(self, self.text())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not click_on_enter(self, event):
            super().keyPressEvent(event)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect, radius, role = QRectF(self.rect()), self._theme.radius("small"), self._theme.colour
        if self._is_drop_target:
            paint.box(painter, rect, radius, role("accentTint"))
        self.paint_button(painter, rect)
        # above the button's own painting, because the tab that opens under dragged blocks is filled
        if self._is_drop_target:
            paint.box(painter, rect, radius, None, role("accent"), DROP_TARGET_WIDTH)
        painter.end()

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        """Paint the button in its current state. Subclasses implement this.

        Args:
            painter: Painter.
            rect: Rectangle of the whole widget.
        """


class Button(QPushButton):
    """Button with a text and an optional icon. A text that doesn't fit is elided and shown as tooltip.

    The accessible name is the text, unless another one is set.
    """

    def __init__(
        self,
        theme: Theme,
        text: str,
        icon: str | None = None,
        *,
        kind: Kind = "plain",
        size: Size = "normal",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._theme = theme
        self.metrics = _METRICS[size]
        self.kind: Kind = kind
        self.icon_name = icon
        self.has_filled_icon = False
        self.icon_role = ""
        """Colour role of the icon; "" for the colour of the text."""
        self._min_width: int | None = None
        self.set_text(text)
        if kind != "plain":
            self.setProperty("kind", kind)
        if size not in {"normal", "segment"}:
            self.setProperty("metrics", size)
        set_up_button(self, theme, self.metrics.radius)

    def set_text(self, text: str, name: str = "") -> None:
        """Set the text and the accessible name.

        Args:
            text: Text.
            name: Accessible name, or "" to use the text.
        """
        self.setText(text)
        self.setAccessibleName(name or text)

    def set_label(self, text: str, icon: str | None = None, *, name: str = "") -> None:
        """Set the text and the icon.

        Args:
            text: Text.
            icon: Name of the icon; None keeps the current one.
            name: Accessible name, or "" to use the text.
        """
        is_unchanged = text == self.text() and (name or text) == self.accessibleName()
        if is_unchanged and icon in {None, self.icon_name}:
            return
        self.set_text(text, name)
        self.icon_name = icon if icon is not None else self.icon_name
        self.updateGeometry()
        self.update()

    def set_size(self, size: Size) -> None:
        """Set the size, which determines height, font and padding."""
        if self.metrics != _METRICS[size]:
            self.metrics = _METRICS[size]
            self.setProperty("focusRadius", self._theme.radius(self.metrics.radius))
            paint.set_style_property(self, "metrics", size)
            self.updateGeometry()

    def set_kind(self, kind: Kind) -> None:
        """Set the kind, which determines the colours, such as "primary" or "ghost"."""
        self.kind = kind
        paint.set_style_property(self, "kind", kind)

    def width_with(self, text: str) -> int:
        """Return the width in px that the button needs for a text."""
        width = paint.width_of(self._theme.font(self.metrics.font), text) + 2 * self.metrics.padding
        return round(width) + 1 + self._icon_width(text) + self._indicator_width()

    def _icon_width(self, text: str) -> int:
        # Width in px of the icon and the gap between it and a text.
        if self.displayed_icon() is None:
            return 0
        return self.icon_side() + (self.metrics.gap if text else 0)

    def _indicator_width(self) -> int:
        return 0

    def sizeHint(self) -> QSize:
        text_height = round(paint.height_of(self._theme.font(self.metrics.font))) + 8
        return QSize(self.width_with(self.text()), max(self.metrics.height, text_height))

    def minimumSizeHint(self) -> QSize:
        hint = self.sizeHint()
        return hint if self._min_width is None else QSize(min(self._min_width, hint.width()), hint.height())

    def allow_shrinking(self, min_width: int = 72) -> None:
        """Allow layouts to make the button narrower than its text, which is then elided.

        Args:
            min_width: Minimum width in px.
        """
        self._min_width = min_width
        self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)

    def icon_side(self) -> int:
        """Return the size of the icon in px, which scales with the text size."""
        return round(self._theme.scaled(self.metrics.icon))

    def displayed_text(self) -> str:
        """Return the text to show, which differs from `text` if only the icon is shown."""
        return self.text()

    def displayed_icon(self) -> str | None:
        """Return the name of the icon to show, which differs from `icon_name` if it depends on the state."""
        return self.icon_name

    def icon_colour_role(self) -> str:
        """Return the colour role of the icon while the button is enabled."""
        return self.icon_role or BUTTON_COLOURS[self.kind].text

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not click_on_enter(self, event):
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        paint.set_elision_tooltip(self, self.text())

    def initStyleOption(self, option: QStyleOptionButton) -> None:
        super().initStyleOption(option)
        if not self.isVisible():  # Qt only needs the margins
            return
        text = self.displayed_text()
        icon_width, padding = self._icon_width(text), min(_MIN_PADDING, self.metrics.padding)
        space = self.width() - 2 * padding - icon_width - self._indicator_width()
        elided = QFontMetricsF(self.font()).elidedText(text, Qt.TextElideMode.ElideRight, space + 1)
        option.text = elided.replace("&", "&&")
        icon = self.displayed_icon()
        if icon is not None:
            role, is_filled = self.icon_colour_role(), self.has_filled_icon and self.isEnabled()
            option.icon = self._theme.icon(
                icon,
                role,
                active_role=role,
                is_filled=is_filled,
                is_right=self.isRightToLeft() != (self.kind == "link"),
            )
            option.iconSize = QSize(icon_width - (QT_ICON_GAP if text else 0), self.icon_side())


class MenuButton(Button):
    """Button with a chevron that opens a menu."""

    def _indicator_width(self) -> int:
        return round(self._theme.scaled(CHEVRON)) + CHEVRON_GAP

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter, side = QPainter(self), self._theme.scaled(CHEVRON)
        icon_rect = QRectF(0, (self.height() - side) / 2, side, side)
        if self.isRightToLeft():
            icon_rect.moveLeft(CHEVRON_GAP)
        else:
            icon_rect.moveRight(self.width() - CHEVRON_GAP)
        role = BUTTON_COLOURS[self.kind].text if self.isEnabled() else "textDisabled"
        paint_icon(painter, icon_rect, "chevron-down", self._theme.colour(role))
        painter.end()


class ToggleButton(Button):
    """Checkable button, in the colours of a selection while it is checked."""

    def __init__(self, theme: Theme, text: str, icon: str) -> None:
        super().__init__(theme, text, icon, size="small")
        self.setCheckable(True)

    def icon_colour_role(self) -> str:
        return "selectedText" if self.isChecked() else super().icon_colour_role()


class LinkButton(Button):
    """Button that looks like a link, with an optional icon after the text."""

    def __init__(self, theme: Theme, text: str, icon: str | None = None) -> None:
        super().__init__(theme, text, icon, kind="link", size="link")
        self._min_width = 80
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def set_label(self, text: str, icon: str | None = None, *, name: str = "") -> None:
        """Set the text and the icon after it.

        Args:
            text: Text.
            icon: Name of the icon; None removes the icon.
            name: Accessible name, or "" to use the text.
        """
        self.icon_name = icon
        super().set_label(text, icon, name=name)

    def initStyleOption(self, option: QStyleOptionButton) -> None:
        super().initStyleOption(option)
        directions = Qt.LayoutDirection
        option.direction = directions.LeftToRight if self.isRightToLeft() else directions.RightToLeft


class IconButton(QToolButton):
    """Button with only an icon. The name is shown as tooltip, with the shortcut."""

    def __init__(
        self,
        theme: Theme,
        icon: str,
        name: str,
        shortcut: str = "",
        *,
        checkable: bool = False,
        size: int = 28,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._theme, self._icon, self._side = theme, icon, size
        self.setCheckable(checkable)
        set_up_button(self, theme, "small")
        self.set_name(name, shortcut)

    def set_name(self, name: str, shortcut: str = "") -> None:
        """Set the name and the shortcut for the tooltip; the name is also the accessible name."""
        self.setAccessibleName(name)
        self.setToolTip(plain.tip(tip_with_key(name, shortcut)))

    def _icon_side(self) -> int:
        name = "normal" if self._side < 40 else "large"
        return round(self._theme.scaled(self._theme.size("icon", name)))

    def set_icon(self, icon: str) -> None:
        """Set the icon by name."""
        self._icon = icon
        self.update()

    @property
    def is_drop_target(self) -> bool:
        """True if the button is the drop target of a drag."""
        return self.property("dropTarget") is True

    def set_drop_target(self, is_drop_target: bool) -> None:
        """Set whether the button is the drop target of a drag; a drop target has a ring."""
        paint.set_style_property(self, "dropTarget", is_drop_target)

    def sizeHint(self) -> QSize:
        side = max(self._side, self._icon_side() + 10)
        return QSize(side, side)

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not click_on_enter(self, event):
            super().keyPressEvent(event)

    def initStyleOption(self, option: QStyleOptionToolButton) -> None:
        super().initStyleOption(option)
        is_active = self.isDown() or self.underMouse()
        role = "accentText" if self.isChecked() else "text" if is_active else "textSecondary"
        option.icon = self._theme.icon(self._icon, role, active_role=role)
        option.iconSize = QSize(self._icon_side(), self._icon_side())


class RunButton(Button):
    """Button of the run bar, 112 x 44 px or larger for large text."""

    def __init__(
        self, theme: Theme, text: str, icon: str, *, longest_text: str = "", parent: QWidget | None = None
    ) -> None:
        # `longest_text` is the longest text that the button will show, so that its width never changes.
        super().__init__(theme, text, icon, size="large", parent=parent)
        self._longest_text = longest_text or text
        self._is_icon_only = False
        self.has_filled_icon = False

    def set_filled(self, is_filled: bool) -> None:
        """Fill the button green if `is_filled`, else paint only its outline."""
        self.has_filled_icon = is_filled
        self.set_kind("run" if is_filled else "plain")

    def set_icon_only(self, is_icon_only: bool) -> None:
        """Show only the icon if `is_icon_only`, else icon and text. The accessible name doesn't change."""
        if is_icon_only != self._is_icon_only:
            self._is_icon_only = is_icon_only
            self.updateGeometry()
            self.update()

    def icon_side(self) -> int:
        return self.metrics.icon  # the text needs the space

    def displayed_text(self) -> str:
        return "" if self._is_icon_only else self.text()

    def sizeHint(self) -> QSize:
        font = self._theme.font("button")
        if self._is_icon_only:
            return QSize(
                max(ICON_ONLY_WIDTH, self.icon_side() + 28),
                max(self.metrics.height, round(paint.height_of(font)) + 12),
            )
        height = max(self.metrics.height, round(paint.height_of(font)) + 12)
        return QSize(self.full_width(), height)

    def full_width(self) -> int:
        """Return the width in px with the longest text that the button can show."""
        text_width = paint.width_of(self._theme.font("button"), self._longest_text)
        return max(RUN_WIDTH, round(self.icon_side() + self.metrics.gap + text_width) + 28)


class StopButton(PaintedButton):
    """Stop button, which is always enabled.

    A ring around the button shows that replies of robots are pending; the button has a margin of 4 px
    for it.
    """

    def __init__(self, theme: Theme, bar: BarName = "runBar", parent: QWidget | None = None) -> None:
        self._radius_name = "large" if bar == "runBar" else "control"
        super().__init__(theme, _("Stop"), radius=self._radius_name, parent=parent)
        self._bar: BarName = bar
        self._has_ring = False
        self.is_filled = True
        # A click doesn't take the focus, so sheets stay open and typing continues.
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        assign_command(self, "run.stop")
        self.setProperty("focusInset", STOP_RING_WIDTH)

    def show_state(self, caption: str, *, has_ring: bool = False, is_filled: bool = True) -> None:
        """Set the state of the button.

        Args:
            caption: "Stop", "Stopping" or "Stop again", translated.
            has_ring: True while replies of robots are pending.
            is_filled: False to paint only the outline, because nothing can move.
        """
        if (caption, has_ring, is_filled) == (self.text(), self._has_ring, self.is_filled):
            return
        self.set_text(caption)
        self._has_ring = has_ring
        self.is_filled = is_filled
        self.update()

    def sizeHint(self) -> QSize:
        size = self._theme.size_pair("stop", self._bar)
        font, key = self._fonts()
        captions = (_("Stop"), _("Stopping"), _("Stop again"))  # the same size in every state
        min_width = self._icon_side() + 26 + max(paint.width_of(font, each) for each in captions)
        if self._bar != "runBar":
            min_width += paint.width_of(key, "F12") + 8
        height = max(size.height(), round(paint.height_of(font)) + 10)
        return QSize(max(size.width(), round(min_width)) + 2 * STOP_RING_WIDTH, height + 2 * STOP_RING_WIDTH)

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def _fonts(self) -> tuple[QFont, QFont]:
        is_large = self._bar == "runBar"
        font = self._theme.font("heading" if is_large else "title")
        font.setWeight(font.Weight.Bold)
        if is_large:
            font.setPixelSize(round(self._theme.scaled(17)))
        return font, self._theme.font("small" if is_large else "caption")

    def _icon_side(self) -> int:
        return 16 if self._bar == "runBar" else 12

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme, radius = self._theme, self._theme.radius(self._radius_name)
        frame = rect.adjusted(STOP_RING_WIDTH, STOP_RING_WIDTH, -STOP_RING_WIDTH, -STOP_RING_WIDTH)
        if self._has_ring:
            paint.box(painter, rect, radius + STOP_RING_WIDTH, None, theme.colour("stop"), 2)
        if self.is_filled:
            paint.box(painter, frame, radius, theme.colour("stopHover" if self.is_highlighted else "stop"))
            colour = theme.colour("onStop")
        else:
            fill = theme.colour("errorTint" if self.is_highlighted else "panel")
            paint.box(painter, frame, radius, fill, theme.colour("stop"))
            colour = theme.colour("error")
        self._paint_text(painter, frame, colour)

    def _paint_text(self, painter: QPainter, frame: QRectF, colour: QColor) -> None:
        font, key_font = self._fonts()
        key = "F12" if self.text() == _("Stop") or self._bar != "runBar" else ""
        side = self._icon_side()
        gap = 10 if self._bar == "runBar" else 8
        key_gap = gap + 3 if self._bar == "runBar" else gap - 1
        word_width = paint.width_of(font, self.text())
        key_width = paint.width_of(key_font, key) + key_gap if key else 0
        left = frame.center().x() - (side + gap + word_width + key_width) / 2
        icon_rect = QRectF(left, frame.center().y() - side / 2, side, side)
        paint.box(painter, icon_rect, side / 6, colour)
        area = QRectF(QPointF(icon_rect.right() + gap, frame.top()), frame.bottomRight())
        paint.text_line(painter, area, self.text(), font, colour)
        if key:
            area.setLeft(area.left() + word_width + key_gap)
            paint.text_line(painter, area, key, key_font, colour)
