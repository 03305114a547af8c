"""Health panel: state of a robot, its most severe problem, and the suggested next step."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.core.robots.health_facts import HealthItem, health_items
from app.intents import ConnectRobot, OpenDoctor
from app.ui.panels.base import Density, Panel, PanelContext
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.no_robot import NoRobotController
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.text.numbers import age_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Chip, ContentScrollArea, EmptyAction, EmptyState, label, paint
from app.ui.widgets.indicators import StatusIcon
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink

TITLE_WIDTH = 96
ONE_LINE_MIN_WIDTH = 300
ROW_HEIGHTS = {"compact": 22, "comfortable": 28}
TEXT_FONTS = {"compact": "body", "comfortable": "bodyLarge"}


class HealthRow(QWidget):
    """Row with icon, title and text; the text is below the title in a narrow panel."""

    def __init__(self, theme: Theme, density: Density) -> None:
        super().__init__()
        self._theme = theme
        self.item: HealthItem | None = None
        self.title = label("", TEXT_FONTS[density])
        self.text_label = label("", TEXT_FONTS[density], role="textSecondary", wrap=True)
        line = paint.height_of(theme.font(TEXT_FONTS[density]))
        space = round(max(1.0, (theme.scaled(ROW_HEIGHTS[density]) - line) / 2))
        self._space = space
        self.icon = StatusIcon(theme, height=round(line) + 2 * space)
        self._text_layout = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._text_layout.setSpacing(10)
        self._text_layout.addWidget(self.title, 0, Qt.AlignmentFlag.AlignTop)
        self._text_layout.addWidget(self.text_label, 1)
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 0, 16, 0)
        row.setSpacing(10)
        row.addWidget(self.icon, 0, Qt.AlignmentFlag.AlignTop)
        row.addLayout(self._text_layout, 1)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        is_wide = self.width() >= self._theme.scaled(ONE_LINE_MIN_WIDTH)
        direction = QBoxLayout.Direction.LeftToRight if is_wide else QBoxLayout.Direction.TopToBottom
        self.title.setMinimumWidth(round(self._theme.scaled(TITLE_WIDTH)) if is_wide else 0)
        space = self._space
        self.title.setContentsMargins(0, space, 0, space if is_wide else 0)
        self.text_label.setContentsMargins(0, space if is_wide else 0, 0, space)
        self._text_layout.setDirection(direction)
        self._text_layout.setSpacing(10 if is_wide else 0)

    def show_item(self, item: HealthItem) -> None:
        """Show the icon, title and text of an item of a robot's health."""
        if item == self.item:
            return
        self.item = item
        self.icon.set(item.status)
        self.title.setText(_(item.title))
        self.text_label.setText(item.text)
        self.setAccessibleName(_(item.title))
        self.setAccessibleDescription(item.text)


class HealthPanel(OneRobotPanel):
    """Panel with the health of one robot."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Health"))
        self._items: tuple[HealthItem, ...] = ()
        self.rows: list[HealthRow] = []
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        title, text = _("No robot is connected"), _("Its status appears here once it is connected.")
        steps = [
            EmptyAction(_("Use the virtual robot"), lambda: context.run("robots.virtual"), "bot"),
            EmptyAction(_("Find the cause"), lambda: context.run("help.doctor"), "stethoscope"),
        ]
        self.empty = EmptyState(self.theme, "bot", title, text, steps)
        self._no_robot = NoRobotController(self.empty, title, text, steps)
        self._no_robot.set_starting(self.session.starting_robots)
        self.step_button = Button(self.theme, _("Restart the robot"), "rotate-ccw", size="small")
        self.step_button.clicked.connect(self._do_next_step)
        content = QWidget()
        self._column = QVBoxLayout(content)
        self._column.setContentsMargins(0, 6, 0, 6)
        self._column.setSpacing(0)
        self._button_row = QWidget()
        row = QHBoxLayout(self._button_row)
        row.setContentsMargins(16, 6, 16, 6)
        row.addWidget(self.step_button)
        row.addStretch(1)
        self._column.addWidget(self._button_row)
        self._column.addStretch(1)
        self._scroll = ContentScrollArea(content)
        self._scroll.setAccessibleName(_("Robot status"))
        self._scroll.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._scroll.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.pages = self.make_page_stack(self.empty, self._scroll)
        self.pages.setMinimumSize(1, 1)

    # -- display ------------------------------------------------------------------------------------------

    def fleet_changed(self) -> None:
        link = self.robot_to_show()
        self.pages.setCurrentIndex(0 if link is None else 1)
        if link is not None:
            self.set_title(_("Health"), link.name if len(self.session.fleet.links) > 1 else "")

    def refresh_robot(self, link: RobotLink | None) -> None:
        if link is None:
            self.chip.set("")
            self._no_robot.set_starting(self.session.starting_robots)
            return
        items = health_items(link, self.session.live.topics, time.monotonic(), _age_text)
        if items != self._items:
            self._items = items
            self._show(items, link)

    def _show(self, items: tuple[HealthItem, ...], link: RobotLink) -> None:
        self._make_rows(len(items))
        for row, item in zip(self.rows, items, strict=True):
            row.show_item(item)
        problems = [item for item in items if item.needs_attention]
        worst = "error" if any(item.status == "error" for item in problems) else "warn"
        summary = ngettext("{count} problem", "{count} problems", len(problems)).format(count=len(problems))
        self.chip.set(summary if problems else "", worst)
        self.step_button.setText(_("Restart the robot") if link.is_virtual else _("Find the cause"))
        self._button_row.setVisible(not link.is_connected or link.is_unresponsive)

    def _make_rows(self, count: int) -> None:
        # The button stays below the first row.
        while len(self.rows) > count:
            row = self.rows.pop()
            self._column.removeWidget(row)
            row.deleteLater()
        while len(self.rows) < count:
            row = HealthRow(self.theme, self.density)
            self._column.insertWidget(len(self.rows) + 1 if self.rows else 0, row)
            self.rows.append(row)

    def _do_next_step(self) -> None:
        link = self.session.fleet.link(self._robot)
        if link is not None:
            self.context.request(ConnectRobot(link.name) if link.is_virtual else OpenDoctor())

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self._make_rows(0)  # rebuilt by the next refresh
        self._items = ()

    def theme_changed(self) -> None:
        super().theme_changed()
        self._make_rows(0)
        self._items = ()


def _age_text(age_s: float) -> str:
    return f"{max(1, int(age_s))} s" if age_s < 60 else age_text(age_s)


PANEL = Panel(
    "health",
    lazy("Health"),
    "heart",
    (),
    HealthPanel,
    home=(
        RowHome("behaviour", 1, 3, 190, opens_with="robots", tab_of="sensors"),
        TabHome("developer", "console"),
    ),
)
"""Panel that shows if a robot responds, the state that it reports, and how it is stopped."""
