"""Toolbar above the graph (filter, grouping, hidden items, zoom) and the legend below it."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.core.graph.node_graph import GraphOptions
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, Segments, label, paint
from app.ui.widgets.buttons import ToggleButton
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.fields import FilterField
from nep.i18n import _, ngettext, number


class GraphTools(QWidget):
    """Toolbar of the graph; wraps in a narrow panel."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.filter = FilterField(theme, _("Filter the graph"))
        self.group = Segments(
            theme,
            [("computer", _("Computer"), None), ("robot", _("Robot"), None), ("nothing", _("None"), None)],
            size="small",
            name=_("Group by"),
        )
        self.quiet = ToggleButton(theme, _("Hide quiet nodes"), "eye-off")
        self.services = ToggleButton(theme, _("Services"), "spline")
        self.zoom_out = IconButton(theme, "zoom-out", _("Zoom out"), "-", size=26)
        self.zoom_in = IconButton(theme, "zoom-in", _("Zoom in"), "+", size=26)
        self.scale = label("100 %", "body", role="textSecondary")
        self.scale.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.scale.setMinimumWidth(round(theme.scaled(44)))
        self.show_all_button = Button(theme, _("Show all"), "scan", size="small")
        flow = Flow(self, gap=10, row_gap=6)
        flow.setContentsMargins(10, 8, 10, 8)
        flow.addWidget(self.filter)
        flow.addWidget(label(_("Group by"), "body", role="textSecondary"))
        for option in (self.group, self.quiet, self.services):
            flow.addWidget(option)
        flow.push()
        for widget in (self.zoom_out, self.scale, self.zoom_in, self.show_all_button):
            flow.addWidget(widget)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.show_options(GraphOptions())

    def filter_words(self) -> list[str]:
        """Return the words of the filter, in lower case."""
        return self.filter.text().casefold().split()

    def show_options(self, options: GraphOptions) -> None:
        """Update the buttons to show the current choices."""
        self.group.set_value(options.group_by)
        self.quiet.setChecked(options.hides_quiet)
        self.services.setChecked(options.shows_services)

    def show_quiet_count(self, hidden_count: int, hides_quiet: bool) -> None:
        """Show the number of hidden quiet nodes on the button.

        Args:
            hidden_count: Number of hidden nodes.
            hides_quiet: True if quiet nodes are hidden.
        """
        if hides_quiet and hidden_count:
            template = ngettext("{count} quiet node hidden", "{count} quiet nodes hidden", hidden_count)
            self.quiet.set_label(template.format(count=hidden_count))
        else:
            self.quiet.set_label(_("Hide quiet nodes"))

    def show_scale(self, scale: float) -> None:
        """Show the zoom level."""
        self.scale.setText(f"{number(scale * 100, '.0f')} %")


class GraphLegend(QWidget):
    """Legend of line styles and border styles, in one row."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        flow = Flow(self, gap=18, row_gap=2)
        flow.setContentsMargins(12, 4, 12, 8)
        for kind, text in (
            ("topic", _("topic (thicker lines carry more data)")),
            ("service", _("service")),
            ("chosen", _("selected topic")),
            ("gone", _("gone or quiet")),
        ):
            flow.addWidget(_LegendEntry(theme, kind, text))
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)


class _LegendEntry(QWidget):
    """Legend entry: a sample with its text."""

    SAMPLE_WIDTH = 36.0

    def __init__(self, theme: Theme, kind: str, text: str) -> None:
        super().__init__()
        self._theme, self._kind, self._text = theme, kind, text
        self.setAccessibleName(text)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)

    def sizeHint(self) -> QSize:
        font = self._theme.font("small")
        width = self.SAMPLE_WIDTH + 8 + paint.width_of(font, self._text)
        return QSize(round(width) + 1, round(max(18.0, paint.height_of(font))))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        middle = self.height() / 2
        colour = theme.colour("accent" if self._kind == "chosen" else "controlBorder")
        pen = QPen(colour, 2.25 if self._kind == "chosen" else 1.5)
        if self._kind in {"service", "gone"}:
            pen.setDashPattern([3, 2.5])
        painter.setPen(pen)
        if self._kind == "gone":
            painter.drawRoundedRect(QRectF(5, middle - 7, 26, 14), 4, 4)
        else:
            painter.drawLine(QPointF(0, middle), QPointF(self.SAMPLE_WIDTH - 8, middle))
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(colour)
            tip = self.SAMPLE_WIDTH
            painter.drawPolygon(
                [QPointF(tip, middle), QPointF(tip - 9, middle - 4), QPointF(tip - 9, middle + 4)]
            )
        area = QRectF(self.SAMPLE_WIDTH + 8, 0, self.width(), self.height())
        paint.text_line(painter, area, self._text, theme.font("small"), theme.colour("textSecondary"))
        painter.end()
