"""Live sensors panel: one row per sensor of a robot."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QStackedWidget, QVBoxLayout, QWidget

from app.robots.description.description import Sensor
from app.ui.panels.base import Density, Panel, PanelContext
from app.ui.panels.home import RowHome
from app.ui.panels.no_robot import NoRobotController
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.text import plain
from app.ui.text.numbers import age_text
from app.ui.text.sensor_values import ReadingText, reading_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import EmptyState, paint
from app.ui.widgets.indicators import BAR_HEIGHT, paint_bar
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink

ROW_HEIGHTS = {"compact": 26, "comfortable": 28}
PRIORITY_KEYWORDS = ("touch", "distance", "battery")  # listed first; other sensors keep their order
TITLE_WIDTH, VALUE_WIDTH = 100, 96
ICON_SIZE = 18
DETAILS_GAP = 6


class SensorRow(QWidget):
    """Row of a sensor: icon, title, bar or text, value."""

    def __init__(self, theme: Theme, sensor: Sensor) -> None:
        super().__init__()
        self._theme, self.sensor = theme, sensor
        self.title = sensor.title[:1].upper() + sensor.title[1:]
        self.reading = ReadingText()
        self.is_large = True
        self._last_true_s: float | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(self.title)

    def show_value(self, value: object, now: float) -> None:
        """Show the newest value of the sensor. The row is repainted only if its text changes.

        Args:
            value: Newest value.
            now: Monotonic time in s.
        """
        reading = reading_text(self.sensor, value)
        if value is True:
            self._last_true_s = now
        elif value is False and self._last_true_s is not None:
            reading = ReadingText(
                reading.value,
                _("{age} ago").format(age=age_text(max(1.0, float(int(now - self._last_true_s))))),
            )
        if reading != self.reading:
            self.reading = reading
            self.setAccessibleDescription(" ".join(part for part in (reading.value, reading.details) if part))
            self.update()

    def sizeHint(self) -> QSize:
        min_height = ROW_HEIGHTS["comfortable" if self.is_large else "compact"]
        return QSize(260, max(min_height, round(self._theme.scaled(min_height))))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect()).adjusted(16, 0, -16, 0)
        middle = rect.center().y()
        font = theme.font("bodyLarge" if self.is_large else "body")
        bold = theme.font("bodyLarge" if self.is_large else "body")
        bold.setWeight(bold.Weight.Bold)
        icon = QRectF(rect.left(), middle - ICON_SIZE / 2, ICON_SIZE, ICON_SIZE)
        paint_icon(painter, icon, self.sensor.icon, theme.colour("textSecondary"))
        text_width = paint.width_of(font, self.title) + 4
        title_width = max(theme.scaled(TITLE_WIDTH), text_width)
        title = QRectF(rect.left() + 26, rect.top(), title_width, rect.height())
        paint.text_line(painter, title, self.title, font, theme.colour("text"))
        value_width = max(paint.width_of(bold, self.reading.value), theme.scaled(54))
        value = QRectF(rect.right() - value_width, rect.top(), value_width, rect.height())
        paint.text_line(painter, value, self.reading.value, bold, theme.colour("text"), paint.RIGHT)
        details_rect = QRectF(title.right(), rect.top(), value.left() - title.right() - 10, rect.height())
        hidden_details = ""
        if self.reading.fraction is not None and details_rect.width() > 30:
            track = QRectF(
                details_rect.left(), details_rect.center().y() - 3, details_rect.width(), BAR_HEIGHT
            )
            paint_bar(painter, theme, track, self.reading.fraction)
        elif self.reading.details:
            details_width = paint.width_of(font, self.reading.details)
            if details_width > details_rect.width():
                details_rect.setLeft(title.left() + text_width + DETAILS_GAP)
            if details_width <= details_rect.width():
                colour = theme.colour("textSecondary")
                paint.text_line(painter, details_rect, self.reading.details, font, colour)
            else:
                hidden_details = self.reading.details
        painter.end()
        if plain.tip(hidden_details) != self.toolTip():
            self.setToolTip(plain.tip(hidden_details))


class SensorsPanel(OneRobotPanel):
    """Panel with the sensors of one robot."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Live sensors"))
        self.rows: list[SensorRow] = []
        self._scroll = ScrollColumn(_("Sensors"), margins=(0, 6, 0, 6))
        self._column = self._scroll.column
        title, text = _("No robot connected"), _("Connect a robot to see its sensors.")
        self.empty = EmptyState(self.theme, "eye", title, text)
        self._no_robot = NoRobotController(self.empty, title, text)
        self._no_robot.set_starting(self.session.starting_robots)
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self._scroll)
        self.pages.setMinimumSize(1, 1)
        self._frame = QVBoxLayout(self)
        self._frame.setContentsMargins(0, 0, 0, 0)
        self._frame.addWidget(self.pages)

    def rebuild_key(self, link: RobotLink) -> object:
        return (link.name, _listed_sensors(link))

    def refresh_robot(self, link: RobotLink | None) -> None:
        if link is not None:
            now = time.monotonic()
            is_connected = link.is_connected  # values of a disconnected robot are outdated
            for row in self.rows:
                row.show_value(link.values.get(row.sensor.name) if is_connected else None, now)
        else:
            self._no_robot.set_starting(self.session.starting_robots)

    def show_robot(self, link: RobotLink) -> None:
        for row in self.rows:
            self._column.removeWidget(row)
            row.deleteLater()
        self.rows = [SensorRow(self.theme, sensor) for sensor in _listed_sensors(link)]
        for index, row in enumerate(self.rows):
            row.is_large = self.density == "comfortable"
            self._column.insertWidget(index, row)
        self._fit_rows()
        self.pages.setCurrentIndex(1 if self.rows else 0)
        if not self.rows:
            title = _("{robot} has no sensors").format(robot=link.name)
            self.empty.set_texts(title, _("The robot's description has no sensors."))

    def _fit_rows(self) -> None:
        # Scrolls by rows, so that only whole rows are visible.
        if not self.rows:
            return
        available_height = self.height() - self._column.contentsMargins().top()
        height = self.rows[0].sizeHint().height()
        row_count = max(1, available_height // height)
        bottom_margin = available_height - row_count * height if row_count < len(self.rows) else 0
        self._frame.setContentsMargins(0, 0, 0, max(0, bottom_margin))
        self.pages.setMinimumHeight(height + self._column.contentsMargins().top())  # at least one whole row
        self._scroll.verticalScrollBar().setSingleStep(height)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_rows()

    def theme_changed(self) -> None:
        super().theme_changed()
        self._fit_rows()

    def set_density(self, density: Density) -> None:
        for row in self.rows:
            row.is_large = density == "comfortable"
            row.updateGeometry()
        super().set_density(density)


def _listed_sensors(link: RobotLink) -> list[Sensor]:
    # All sensors except images, with the most relevant first.

    def rank(sensor: Sensor) -> int:
        text = f"{sensor.name} {sensor.title}".casefold()
        return next(
            (index for index, keyword in enumerate(PRIORITY_KEYWORDS) if keyword in text),
            len(PRIORITY_KEYWORDS),
        )

    return sorted((sensor for sensor in link.robot.sensors if not sensor.is_image), key=rank)


PANEL = Panel(
    "sensors", lazy("Live sensors"), "eye", (), SensorsPanel, home=(RowHome("behaviour", 1, 2, 140),)
)
