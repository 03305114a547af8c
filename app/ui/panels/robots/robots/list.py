"""List of robots at the left of the Robots panel, with help for finding a missing robot."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QContextMenuEvent, QPainter
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.core.robots.robot_link import STATE_LABELS
from app.ui.text import dates, plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Card, label, paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.indicators import STATUS_BY_ROBOT_STATE, Chip
from app.ui.widgets.menus import Menu
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.robots.fleet import Fleet
    from app.core.robots.known_robots import KnownRobot
    from app.core.robots.robot_link import RobotLink

TURTLE_MODEL = "diffdrive"
LIST_WIDTH = 300


def seen_text(seen_s: float, now: dt.datetime | None = None) -> str:
    """Format when a robot was last seen, such as "seen today, 8:12" or "seen 17 November, 16:20"."""
    now = now or dt.datetime.now().astimezone()
    return dates.last_seen_text(dt.datetime.fromtimestamp(seen_s, tz=now.tzinfo), now)


class RobotItem(PaintedButton):
    """Row of a robot.

    Signals:
        menu_requested: Screen position for a context menu.
    """

    menu_requested = Signal(QPoint)

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__(theme, radius="panel", checkable=True)
        self.name = name
        self.location = ""
        self._is_disconnected = self.can_be_discarded = False
        self.setAutoExclusive(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.chip = Chip(theme)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 0, 12, 0)
        row.addStretch(1)
        row.addWidget(self.chip)

    def show_link(self, link: RobotLink, last_seen: str = "") -> None:
        """Show the state of a robot of this session.

        Args:
            link: Link to the robot.
            last_seen: Text with the time when the robot was last seen, shown while it is disconnected.
        """
        location = _("virtual, this computer") if link.is_virtual else link.robot.title
        is_disconnected = not link.is_connected
        self._show(
            link.state,
            last_seen if is_disconnected and last_seen else location,
            is_disconnected=is_disconnected,
        )
        self.can_be_discarded = self._is_disconnected and not link.is_virtual

    def show_disconnected(self, last_seen: str) -> None:
        """Show a robot of an earlier session that is not connected. A click opens its context menu.

        Args:
            last_seen: Text with the time when the robot was last seen.
        """
        self.setAutoExclusive(False)
        self.setCheckable(False)
        self._show("away", last_seen, is_disconnected=True)
        self.can_be_discarded = True

    def _show(self, state: str, location: str, *, is_disconnected: bool) -> None:
        state_label = _(STATE_LABELS[state])
        self.chip.set(state_label, STATUS_BY_ROBOT_STATE[state])
        self.location, self._is_disconnected = location, is_disconnected
        self.setAccessibleName(f"{self.name}, {location}, {state_label}")
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(LIST_WIDTH - 16, round(self._theme.scaled(56)))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        by_mouse = event.reason() == QContextMenuEvent.Reason.Mouse
        self.menu_requested.emit(event.globalPos() if by_mouse else self.mapToGlobal(self.rect().center()))
        event.accept()

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        if self.isChecked() or self.is_hovered:
            fill = "selected" if self.isChecked() else "hover"
            paint.box(painter, rect, theme.radius("panel"), theme.colour(fill))
        is_faint = self._is_disconnected and not self.isChecked()
        tile = QRectF(12, rect.center().y() - 18, 36, 36)
        paint.box(painter, tile, theme.radius("panel"), theme.colour("sunken"))
        icon = theme.colour("textTertiary" if is_faint else "textSecondary")
        paint_icon(painter, tile.adjusted(9, 9, -9, -9), "bot", icon)
        bold = theme.font("bodyLarge")
        bold.setWeight(bold.Weight.DemiBold)
        colour = theme.colour("selectedText" if self.isChecked() else "textTertiary" if is_faint else "text")
        height = max(19.0, paint.height_of(bold) - 2)
        text_rect = QRectF(60, rect.center().y() - height, rect.width() - 66 - self.chip.width() - 12, height)
        paint.text_line(painter, text_rect, self.name, bold, colour)
        location_colour = theme.colour("textTertiary" if is_faint else "textSecondary")
        paint.text_line(
            painter, text_rect.translated(0, height), self.location, theme.font("small"), location_colour
        )


class RobotList(QWidget):
    """List of the robots of this session and of earlier sessions.

    Args:
        run: Runs a command of the window by its id.

    Signals:
        selected: Name of the selected robot.
        discard_requested: Name of a robot to remove from the list.
    """

    selected = Signal(str)
    discard_requested = Signal(str)

    def __init__(self, theme: Theme, run: Callable[[str], object]) -> None:
        super().__init__()
        self._theme = theme
        self._run = run
        self._known_robots: dict[str, KnownRobot] = {}
        self.items: dict[str, RobotItem] = {}
        self.disconnected_items: dict[str, RobotItem] = {}
        self.setFixedWidth(LIST_WIDTH)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(8, 8, 8, 8)
        self._column.setSpacing(2)
        self._column.addStretch(1)
        self._column.addWidget(self._make_help_card(run))

    def _make_help_card(self, run: Callable[[str], object]) -> QWidget:
        card = Card(is_sunken=True)
        column = QVBoxLayout(card)
        column.setContentsMargins(14, 12, 14, 12)
        column.setSpacing(6)
        column.addWidget(label(_("Is your robot missing?"), "label"))
        text = _("Check that it is switched on and that its driver is running.")
        column.addWidget(label(text, "body", role="textSecondary", wrap=True))
        self.doctor_button = Button(self._theme, _("Find the cause"), "stethoscope", size="small")
        self.doctor_button.clicked.connect(lambda: run("help.doctor"))
        self.turtle = Button(self._theme, _("Use a virtual Turtle"), "bot", kind="ghost", size="small")
        self.turtle.setAccessibleName(_("Use the virtual Turtle"))
        self.turtle.clicked.connect(lambda: run("robots.turtle"))
        for button in (self.doctor_button, self.turtle):  # in a column, because large text needs the width
            column.addWidget(button, 0, Qt.AlignmentFlag.AlignLeft)
        return card

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.items) + len(self.disconnected_items)

    def show_fleet(self, fleet: Fleet) -> list[str]:
        """Show the robots of this session, then the robots of earlier sessions.

        Disconnected robots that are neither virtual nor known, such as removed ones, are omitted.

        Returns:
            The names of the listed robots of this session.
        """
        self._known_robots = {robot.name: robot for robot in fleet.known_robots.robots}
        links = [
            link
            for link in fleet.links
            if link.is_connected or link.is_virtual or link.name in self._known_robots
        ]
        names = [link.name for link in links]
        self._show(links, [robot for name, robot in self._known_robots.items() if name not in names])
        return names

    def last_seen_text(self, name: str) -> str:
        """Return the text with the time when a robot was last seen; "" for unknown and virtual robots."""
        return seen_text(self._known_robots[name].last_connected_s) if name in self._known_robots else ""

    def _show(self, links: Sequence[RobotLink], away_robots: Sequence[KnownRobot]) -> None:
        away_by_name = {robot.name: robot for robot in away_robots}
        for name in [name for name in self.items if name not in {link.name for link in links}]:
            self._remove_item(self.items.pop(name))
        for name in [name for name in self.disconnected_items if name not in away_by_name]:
            self._remove_item(self.disconnected_items.pop(name))
        for link in links:
            if link.name not in self.items:
                item = self._make_item(link.name, len(self.items))
                item.clicked.connect(lambda _on=False, name=link.name: self.selected.emit(name))
                self.items[link.name] = item
        for robot in away_robots:
            if robot.name not in self.disconnected_items:
                item = self._make_item(robot.name, len(self.items) + len(self.disconnected_items))
                item.clicked.connect(partial(self._open_menu_below, item))
                self.disconnected_items[robot.name] = item
            self.disconnected_items[robot.name].show_disconnected(seen_text(robot.last_connected_s))
        self.turtle.setVisible(
            not any(link.robot.model == TURTLE_MODEL and link.is_connected for link in links)
        )

    def _make_item(self, name: str, index: int) -> RobotItem:
        item = RobotItem(self._theme, name)
        item.menu_requested.connect(lambda position: self._open_menu(item, position))
        self._column.insertWidget(index, item)
        return item

    def _remove_item(self, item: RobotItem) -> None:
        self._column.removeWidget(item)
        item.hide()
        item.deleteLater()

    # -- context menu of disconnected robots --------------------------------------------------------------

    def _open_menu_below(self, item: RobotItem) -> None:
        self._open_menu(item, item.mapToGlobal(item.rect().bottomLeft()))

    def _open_menu(self, item: RobotItem, position: QPoint) -> None:
        menu = self.menu_of(item)
        if menu is not None:
            menu.popup(position)

    def menu_of(self, item: RobotItem) -> Menu | None:
        """Return the context menu of a disconnected robot; None for connected and virtual robots."""
        if not item.can_be_discarded:
            return None
        menu = Menu(self._theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction(_("Find the cause")).triggered.connect(lambda: self._run("help.doctor"))
        discard = menu.addAction(
            plain.escape_menu_text(_("Remove {robot} from the list").format(robot=item.name))
        )
        discard.triggered.connect(lambda: self.discard_requested.emit(item.name))
        return menu
