"""Title bar of a dock: name or tabs, subtitle, chips, buttons of the panel, and the menu."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QEvent, QObject, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QContextMenuEvent, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.panels.base import Density, PanelWidget
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Chip, ElidedLabel, IconButton, paint, set_role
from app.ui.widgets.buttons import PaintedButton
from nep.i18n import _

ICON_SIZE, GAP = 16, 7
BADGE_SIZE = 18
MIN_WIDTH = 80  # px
MIN_NAME_WIDTH = 56  # px at 100 %; if there is less room, the front panel is shown as an icon too


class TitleTab(PaintedButton):
    """Tab of a panel that shares its place with others; a click brings the panel to the front.

    In a narrow title bar only the icon is shown. A badge can show a count with a status.
    """

    elides_text = True

    def __init__(self, theme: Theme, text: str, icon: str, is_checked: bool) -> None:
        super().__init__(theme, text, checkable=True)
        self._icon = icon
        self._is_icon_only = False
        self.badge: tuple[str, str] | None = None
        self.setChecked(is_checked)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)

    def set_icon_only(self, is_icon_only: bool) -> None:
        """Show only the icon if `is_icon_only`, else the icon and the name."""
        if is_icon_only != self._is_icon_only:
            self._is_icon_only = is_icon_only
            self.updateGeometry()
            self.update()

    def show_badge(self, badge: tuple[str, str] | None) -> None:
        """Set the badge as (text, status); None hides it."""
        if badge != self.badge:
            self.badge = badge
            self.setAccessibleDescription(badge[0] if badge else "")
            self.updateGeometry()
            self.update()

    def full_width(self) -> int:
        """Return the width in px with icon and name."""
        return round(paint.width_of(self._theme.font("title"), self.text()) + 21 + self._badge_room())

    def _badge_room(self) -> float:
        return self._badge_width() + GAP if self.badge else 0.0

    def _badge_width(self) -> float:
        text = self.badge[0] if self.badge else ""
        return max(self._theme.scaled(BADGE_SIZE), paint.width_of(self._theme.font("caption"), text) + 10)

    def icon_only_width(self) -> int:
        """Return the width in px with the icon only."""
        return round(self._theme.scaled(ICON_SIZE) + 16 + self._badge_room())

    def sizeHint(self) -> QSize:
        height = max(26, round(paint.height_of(self._theme.font("title"))) + 6)
        return QSize(self.icon_only_width() if self._is_icon_only else self.full_width(), height)

    def minimumSizeHint(self) -> QSize:
        return QSize(min(self.icon_only_width(), self.full_width()), self.sizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._is_icon_only:
            self.setProperty("shortened", True)
            self.setToolTip(plain.tip(self.text()))

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        if self.isChecked() or self.is_hovered:
            paint.box(painter, rect, theme.radius("small"), theme.colour("hover"))
        colour = theme.colour("text" if self.isChecked() else "textSecondary")
        room = rect.adjusted(0, 0, -self._badge_room(), 0)
        if self._is_icon_only:
            side = theme.scaled(ICON_SIZE)
            icon_area = QRectF(0, 0, side, side)
            icon_area.moveCenter(room.center())
            if room.width() >= side or not self.badge:  # a badge is preferred over a clipped icon
                paint_icon(painter, icon_area, self._icon, colour)
        else:
            paint.text_line(painter, room, self.text(), theme.font("title"), colour, paint.CENTRE)
        if self.badge:
            self._paint_badge(painter, rect, *self.badge)

    def _paint_badge(self, painter: QPainter, rect: QRectF, text: str, status: str) -> None:
        theme, height, width = self._theme, self._theme.scaled(BADGE_SIZE), self._badge_width()
        left = max(rect.left() + 1, rect.right() - width - 8)  # the badge is never clipped
        badge_rect = QRectF(left, rect.center().y() - height / 2, min(width, rect.width() - 2), height)
        style = theme.status(status)
        paint.box(
            painter, badge_rect, height / 2, theme.colour(style.tint or "sunken"), theme.colour(style.colour)
        )
        paint.text_line(
            painter, badge_rect, text, theme.font("caption"), theme.colour(style.colour), paint.CENTRE
        )


class DockTitle(QWidget):
    """Title bar of a dock, which also paints the upper part of the panel's frame."""

    menu_requested = Signal(object)

    def __init__(
        self, theme: Theme, panel: PanelWidget, density: Density, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._theme, self._panel, self._density = theme, panel, density
        self._min_height = theme.size("panelTitle", density)
        self._title_widget = panel.title_widget()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.name = ElidedLabel("titleLarge" if density == "comfortable" else "title", "textSecondary", 120)
        self._subtitle = ElidedLabel("code", "textTertiary")
        self._tabs: list[TitleTab] = []
        self.more = IconButton(theme, "ellipsis", _("Options of {panel}").format(panel=panel.title()))
        self.more.clicked.connect(lambda: self.menu_requested.emit(self.more))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        self._shared = QWidget()  # row for panel tabs above the title of a panel that has tabs itself
        self._shared.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Minimum)
        self._shared_row = QHBoxLayout(self._shared)
        self._shared_row.setContentsMargins(5, 1, 6, 1)
        self._shared_row.setSpacing(8)
        self._shared_row.addStretch(1)
        self._shared.hide()
        column.addWidget(self._shared)
        row_widget = QWidget()  # a widget, because the size of a nested layout is updated late
        row_widget.installEventFilter(self)
        # The size hints of this widget are those of its layout. Docks read them hundreds of times per
        # layout pass, which took a quarter of the time when they were computed in Python.
        row_widget.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Minimum)
        row_widget.setMinimumSize(MIN_WIDTH, self._min_height)
        self._row = QHBoxLayout(row_widget)
        column.addWidget(row_widget, 1)
        self._fill()
        panel.title_changed.connect(self.show_title)
        self.show_title()

    def _fill(self) -> None:
        is_comfortable = self._density == "comfortable"
        self._row.setContentsMargins(13 if is_comfortable else 11, 1, 8 if is_comfortable else 6, 1)
        self._row.setSpacing(8)
        if self._title_widget is not None:
            self._row.setContentsMargins(6, 1, 6, 1)
            self._row.addWidget(self._title_widget, 1)
            self.more.hide()
            return
        self._row.addWidget(self.name)
        self._row.addWidget(self._subtitle)
        widgets = self._panel.header_widgets()
        for widget in widgets:
            if widget.property("place") == "start":
                self._row.addWidget(widget)
        self._row.addStretch(1)
        for widget in widgets:
            if widget.property("place") != "start":
                self._row.addWidget(widget)
        self._row.addWidget(self.more)

    def _shared_height(self) -> int:
        if self._title_widget is None or not self._tabs:
            return 0
        return max(self._min_height, self._shared_row.sizeHint().height())

    def show_title(self) -> None:
        """Update the name and the subtitle to those of the panel."""
        self.name.setText(self._panel.title())
        self._subtitle.setText(self._panel.subtitle())
        paint.show_when(self._subtitle, bool(self._panel.subtitle()) and self._title_widget is None)
        for tab in self._tabs:
            if tab.isChecked():
                tab.setText(self._panel.title())

    def set_active(self, is_active: bool) -> None:
        """Set whether the panel has the focus; its name is then painted in the primary text colour."""
        set_role(self.name, "text" if is_active else "textSecondary")

    def set_tabs(self, tabs: Sequence[tuple[str, str, bool, Callable[[], object]]]) -> None:
        """Replace the tabs of the panels that share this place.

        Args:
            tabs: Name, icon, True for this panel, and callback that shows the panel, for each tab.
        """
        row = self._tab_row
        for old in self._tabs:
            row.removeWidget(old)
            old.deleteLater()
        self._tabs = []
        paint.show_when(self.name, not tabs and self._title_widget is None)
        for index, (text, icon, is_current, bring_to_front) in enumerate(tabs):
            tab = TitleTab(self._theme, text, icon, is_current)
            tab.clicked.connect(lambda _on=False, bring_to_front=bring_to_front: bring_to_front())
            row.insertWidget(index, tab)
            self._tabs.append(tab)
        if self._title_widget is not None:
            self._shared.setFixedHeight(self._shared_height())
            paint.show_when(self._shared, bool(tabs))
            self.updateGeometry()
        else:
            right = self._row.contentsMargins().right()
            self._row.setContentsMargins(5 if tabs else self._left_margin(), 1, right, 1)
        self.fit_tabs()

    @property
    def _tab_row(self) -> QHBoxLayout:
        # Panel tabs are never in one row with the tabs of a panel itself.
        return self._row if self._title_widget is None else self._shared_row

    def fit_tabs(self) -> None:
        """Shorten chips and tabs until the title bar fits into its width.

        Chips are reduced to icons if this makes room for all full titles. Otherwise the tabs of hidden
        panels are reduced, and the chips only if that isn't enough; the tab of the front panel is
        reduced after that. Chips with the status "off" are reduced last, because their icon is generic.
        Without tabs, all chips show their text.
        """
        all_chips = [each for each in self._other_widgets() if isinstance(each, Chip)]
        chips = [chip for chip in all_chips if chip.status != "off"]
        off_chips = [chip for chip in all_chips if chip.status == "off"]
        if not self._tabs:
            for chip in all_chips:
                chip.set_icon_only(False)
            return
        room = self._room_for_tabs()
        chip_texts_width = sum(chip.full_width() - chip.icon_only_width() for chip in chips)
        full_width = sum(tab.full_width() for tab in self._tabs)
        background_width = sum(tab.icon_only_width() for tab in self._tabs if not tab.isChecked())
        front_width = background_width + sum(tab.full_width() for tab in self._tabs if tab.isChecked())
        shrinks_chips = full_width > room and (full_width <= room + chip_texts_width or front_width > room)
        room += chip_texts_width if shrinks_chips else 0
        is_icon_only = full_width > room
        for chip in chips:
            chip.set_icon_only(shrinks_chips)
        shrinks_off_chips = sum(tab.icon_only_width() for tab in self._tabs) > room
        for chip in off_chips:
            chip.set_icon_only(shrinks_off_chips)
            room += chip.full_width() - chip.icon_only_width() if shrinks_off_chips else 0
        is_narrow = room - background_width < self._theme.scaled(MIN_NAME_WIDTH)
        for tab in self._tabs:
            tab.set_icon_only(is_icon_only and (not tab.isChecked() or is_narrow))

    def _other_widgets(self) -> list[QWidget]:
        row = self._tab_row
        items = (row.itemAt(index) for index in range(row.count()))
        widgets = (item.widget() for item in items if item is not None)
        return [each for each in widgets if each and not each.isHidden() and each not in self._tabs]

    def _room_for_tabs(self) -> int:
        # Width in px with the full text of all chips.
        row, others = self._tab_row, self._other_widgets()
        margins, used_width = row.contentsMargins(), 0
        for widget in others:
            if isinstance(widget, Chip):
                used_width += widget.full_width()
            else:
                hint = widget.minimumSizeHint() if widget is self._subtitle else widget.sizeHint()
                used_width += hint.width()
        gaps = row.spacing() * (len(others) + len(self._tabs) - 1)
        return self.width() - margins.left() - margins.right() - used_width - gaps

    def show_badges(self, badges: Sequence[tuple[str, str] | None]) -> None:
        """Set the badges of the tabs, in the order of the tabs; None for no badge."""
        for tab, badge in zip(self._tabs, badges, strict=False):
            if badge != tab.badge:
                tab.show_badge(badge)
                self.fit_tabs()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.fit_tabs()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Call `fit_tabs` when a chip or button changes its size."""
        if event.type() is QEvent.Type.LayoutRequest and watched is not self:
            self.fit_tabs()
        return super().eventFilter(watched, event)

    def _left_margin(self) -> int:
        if self._title_widget is not None:
            return 6
        return 13 if self._density == "comfortable" else 11

    @property
    def tabs(self) -> tuple[str, ...]:
        """Names of the tabs; empty if no other panel shares this place."""
        return tuple(tab.text() for tab in self._tabs)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self.menu_requested.emit(None)
        event.accept()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        radius = theme.radius("panel")
        painter.setClipRect(rect)
        tall = rect.adjusted(0, 0, 0, 2 * radius)
        paint.box(painter, tall, radius, theme.colour("panel"), theme.colour("border"))
        paint.hairline(painter, rect, Qt.Edge.BottomEdge, theme.colour("border"))
        if self._shared_height():
            above = QRectF(self._shared.geometry())
            paint.hairline(painter, above, Qt.Edge.BottomEdge, theme.colour("border"))
        painter.end()
