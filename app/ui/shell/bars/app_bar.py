"""App bar: logo, menus, layout switch, palette field, robots, and Stop on the start page."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QPainter, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QSizePolicy, QWidget

from app.core.robots.robot_link import CONNECTING, RobotLink
from app.core.run.view import connected_text
from app.core.session import Session
from app.ui.shell.actions.actions import Actions
from app.ui.shell.bars.logo import Logo
from app.ui.shell.bars.menu_bar import MenuBar
from app.ui.shell.docking.layouts import Layout
from app.ui.text.numbers import shortcut_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Chip, IconButton, Segments, StopButton, paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.labels import LinedWidget
from nep.i18n import _, lazy, ngettext

FIELD_WIDTH, FIELD_HEIGHT, LEFT_PADDING, ICON_SIZE, GAP = 248, 28, 10, 14, 9
EDGE_MARGIN = 12
DIRECT_CHILDREN = Qt.FindChildOption.FindDirectChildrenOnly
MIN_TEXT_WIDTH = 44  # minimum text width of the palette field in px; below it only icon and key are shown
CHIP_TEXTS = {
    "ready": lazy("{robot} ready"),
    "busy": lazy("{robot} moving"),
    "away": lazy("{robot} not running"),
    "connecting": lazy("connecting {robot}"),
    "paused": lazy("{robot} is paused"),
    "running": lazy("{robot} running"),
}
"""Templates for the text of the robot chip if one robot is connected, by state."""


class AppBar(LinedWidget):
    """Bar with the menus at the left, the layout switch in the middle and the robots at the right."""

    layout_selected = Signal(str)

    def __init__(
        self,
        theme: Theme,
        layouts: Sequence[Layout],
        platform: str = sys.platform,
        *,
        parent: QWidget | None = None,
    ) -> None:
        # `platform` is a value of `sys.platform`.
        super().__init__(theme, parent=parent)
        self.setMinimumHeight(theme.size("appBar"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(_("Menus and layouts"))
        self.menus = MenuBar()
        self.is_menu_bar_native = platform == "darwin"  # macOS shows the menus at the top of the screen
        self.menus.setNativeMenuBar(self.is_menu_bar_native)
        self.menus.setSizePolicy(QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Preferred)
        self.switch = Segments(
            theme, [(layout.name, _(layout.title), layout.icon) for layout in layouts], name=_("Layout")
        )
        self.switch.changed.connect(self.layout_selected)
        self.home = IconButton(theme, "house", _("Start page"))
        self.back = IconButton(theme, "arrow-left", _("Back to your work"), "Esc")
        self.search = PaletteField(theme)
        self.chip = Chip(theme, "", "off", large=True)
        self.stop = StopButton(theme, "appBar")
        self._build()
        theme.changed.connect(self._restyle)
        self._restyle()

    def _build(self) -> None:
        left, right = QWidget(), QWidget()
        self._halves = (left, right)
        menus = QHBoxLayout(left)
        menus.setContentsMargins(0, 0, 0, 0)
        menus.setSpacing(10)
        menus.addWidget(Logo(self._theme))
        menus.addWidget(self.home)
        menus.addWidget(self.back)
        menus.addWidget(self.menus, 0, Qt.AlignmentFlag.AlignVCenter)
        menus.addStretch(1)
        robots = QHBoxLayout(right)
        robots.setContentsMargins(0, 0, 0, 0)
        robots.setSpacing(6)
        robots.addStretch(1)
        robots.addWidget(self.search)
        robots.addSpacing(6)
        robots.addWidget(self.chip)
        robots.addWidget(self.stop)
        grid = QGridLayout(self)
        grid.setContentsMargins(11, 0, 12, 1)
        grid.setHorizontalSpacing(12)
        grid.addWidget(left, 0, 0)
        grid.addWidget(self.switch, 0, 1)
        grid.addWidget(right, 0, 2)
        grid.setColumnStretch(0, 1)
        self._grid = grid

    def _restyle(self) -> None:
        font = self._theme.font("body")
        font.setWeight(font.Weight.Medium)
        self.menus.setFont(font)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        # Shrinks in this order if the menus lack room: texts of the switch, the chip, the key of the field.
        for level in range(4):
            self.switch.set_icon_only(level > 0)
            self.chip.set_icon_only(level > 1)
            self.search.set_icon_only(level > 2)
            if self._needed_width() <= self.width():
                break
        switch_width = 0 if self.switch.isHidden() else self.switch.sizeHint().width() + EDGE_MARGIN
        half_width = (self.width() - 2 * EDGE_MARGIN - switch_width - EDGE_MARGIN) / 2
        self._grid.setColumnStretch(2, int(self._halves[1].sizeHint().width() <= half_width))

    def _needed_width(self) -> int:
        parts = [
            part for half in self._halves for part in half.findChildren(QWidget, options=DIRECT_CHILDREN)
        ]
        content_width = sum(
            self._min_width(part) + GAP for part in (self.switch, *parts) if not part.isHidden()
        )
        return content_width + 2 * EDGE_MARGIN

    def _min_width(self, part: QWidget) -> int:
        if part is self.menus:
            return 0 if self.is_menu_bar_native else part.sizeHint().width()
        if part is self.switch:
            return part.sizeHint().width()
        return max(part.minimumSizeHint().width(), part.minimumWidth())

    def set_actions(self, actions: Actions) -> None:
        """Connect the buttons to the actions of their commands."""
        actions.bind(self.home, "file.start_page")
        self.back.clicked.connect(actions["start_page.leave"].trigger)
        actions.bind(self.search, "palette.open")
        actions.bind(self.stop, "run.stop")

    def show_layout(self, name: str | None, *, back: bool = False) -> None:
        """Select the current layout in the layout switch, or show Stop in its place on the start page.

        Args:
            name: Name of the layout, or None for the start page.
            back: True to show a button on the start page that returns to the previous layout.
        """
        self.home.setVisible(name is not None)
        self.back.setVisible(name is None and back)
        if name is not None:
            self.switch.set_value(name)
        self.switch.setVisible(name is not None)
        self.stop.setVisible(name is None)
        self._fit()

    def show_robots(self, text: str, status: str) -> None:
        """Set text and status of the robot chip."""
        if text != self.chip.text:
            self.chip.set(text, status)
            self._fit()
        else:
            self.chip.set(text, status)


class PaletteField(PaintedButton):
    """Button that opens the command palette, painted as a search field with the shortcut on the right.

    If there is little space, the text is first shortened and then hidden.
    """

    def __init__(self, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(theme, _("Find a command or panel"), radius="control", parent=parent)
        self._key = ""
        self._is_icon_only = False
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)

    def set_icon_only(self, is_icon_only: bool) -> None:
        """Hide the shortcut if `is_icon_only`, so that the button can be narrower; else show it.

        The text isn't hidden, but shortened as far as necessary.
        """
        if is_icon_only != self._is_icon_only:
            self._is_icon_only = is_icon_only
            self.updateGeometry()
            self.update()

    def show_key(self, key: str) -> None:
        """Set the displayed shortcut; "" for none."""
        self._key = shortcut_text(key)
        self.updateGeometry()
        self.update()

    def _icon_side(self) -> float:
        return self._theme.scaled(ICON_SIZE)

    def _key_cap_width(self) -> float:
        return paint.key_width(self._theme, self._key) + 7 if self._key and not self._is_icon_only else 0.0

    def sizeHint(self) -> QSize:
        font = self._theme.font("body")
        text_width = paint.width_of(font, self.text())
        width = LEFT_PADDING + self._icon_side() + GAP + text_width + 16 + self._key_cap_width()
        height = max(FIELD_HEIGHT, round(paint.height_of(font)) + 8)
        return QSize(max(FIELD_WIDTH, round(width)), height)

    def minimumSizeHint(self) -> QSize:
        min_width = LEFT_PADDING + self._icon_side() + GAP + (self._key_cap_width() or LEFT_PADDING)
        return QSize(round(min_width), self.sizeHint().height())

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme, middle = self._theme, rect.height() / 2
        fill = theme.colour("hover" if self.is_highlighted else "panel")
        paint.box(painter, rect, theme.radius("control"), fill, theme.colour("borderStrong"))
        side = self._icon_side()
        icon_area = QRectF(LEFT_PADDING, middle - side / 2, side, side)
        paint_icon(painter, icon_area, "search", theme.colour("textSecondary"))
        font = theme.font("body")
        left = LEFT_PADDING + side + GAP
        room = rect.width() - left - self._key_cap_width() - 4
        if room >= self._theme.scaled(MIN_TEXT_WIDTH):
            area = QRectF(left, 0, room, rect.height())
            is_full_text = paint.width_of(font, self.text()) <= room
            paint.text_line(
                painter, area, self.text() if is_full_text else _("Find"), font, theme.colour("textSecondary")
            )
        if self._key and not self._is_icon_only:
            paint.key_cap(painter, theme, rect.right() - 6, middle, self._key)


def robots_chip(session: Session) -> tuple[str, str]:
    """Return the text of the robot chip, such as "Pepper ready" or "2 robots", and its status."""
    links = [link for link in session.fleet.links if link.state != "away"]
    if not links:
        starting_robots = session.starting_robots
        return (connected_text((), starting_robots), "running") if starting_robots else (_("No robot"), "off")
    unstopped_links = [link for link in links if link.state == "not stopped"]
    if unstopped_links:
        first, others = unstopped_links[0], len(unstopped_links) - 1
        text = _("{robot}: {state}")
        if others:
            text = ngettext("{robot} and {count} more: {state}", "{robot} and {count} more: {state}", others)
        return text.format(robot=first.name, count=others, state=first.state_label), "error"
    stopping_links = [link for link in links if link.state == "stopping"]
    if stopping_links:
        if len(stopping_links) == 1:
            return _("{robot} stopping").format(robot=stopping_links[0].name), "running"
        text = ngettext("{count} robot stopping", "{count} robots stopping", len(stopping_links))
        return text.format(count=len(stopping_links)), "running"
    silent_links = [link for link in links if link.state == "silent"]
    if silent_links:
        text = silent_links[0].silence_reason or _("not responding")
        if len(silent_links) > 1:
            text = ngettext(
                "{count} robot not responding", "{count} robots not responding", len(silent_links)
            )
            return text.format(count=len(silent_links)), "error"
        if len(links) > 1:
            return _("{robot}: {state}").format(robot=silent_links[0].name, state=text), "error"
        return text[:1].upper() + text[1:], "error"
    status = "off" if any(link.state == CONNECTING for link in links) else "ok"
    if len(links) > 1:
        return ngettext("{count} robot", "{count} robots", len(links)).format(count=len(links)), status
    return _robot_text(session, links[0]), status


def _robot_text(session: Session, link: RobotLink) -> str:
    state: str = link.state
    if session.runs.active:
        state = "paused" if session.runs.view().state == "paused" else "running"
    return _(CHIP_TEXTS[state]).format(robot=link.name)
