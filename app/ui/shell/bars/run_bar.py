"""Run bar of the Behaviour layout and tool bar of the Developer layout.

Both contain Run, Pause, Step and Stop.
"""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QRect, QRectF, QSize, Qt
from PySide6.QtGui import QFont, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.core.run.view import RESTART, RunView
from app.robots.client.stop_report import StopStatus
from app.ui.shell.actions.actions import Actions
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, RunButton, Separator, StopButton, label, paint
from app.ui.widgets.labels import LinedWidget
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _

SPEED_COMMANDS = ("run.full_speed", "run.slow", "run.very_slow")
MIN_WIDTH_WITH_TEXTS_PX = 960  # width of the bar at 100 % text
STATE_WIDTH_PX, RESULT_WIDTH_PX = 190, 230  # at 100 % text: room for the state and for a result
MIN_RESULT_WIDTH_PX = 110  # minimum width of a successful result; it is elided to this
FIXED_ITEMS_WIDTH_PX = 150  # speed button, mark and the gaps between all items
MIN_TEXT_WIDTH_PX = 600  # below this even Run is an icon, so that the result of a stop isn't cut
MIN_STATE_TEXT_PX = 30  # px at 100 % text
MAX_STATE_WIDTH_PX = 300  # at 100 % text: width of the state next to an alert
STATE_WIDTH_SHARE = 0.2  # width of the state next to an alert as a share of the bar
MIN_BANNER_WIDTH_PX = 300  # at 100 % text; with less room an alert also covers the state of the tool bar
BANNER_EDGE, GAP = 3, 8
QWIDGETSIZE_MAX = 16777215  # Qt's constant for "no limit"
DOT_SIZE = 10
HALO_SIZE = 16
STATE_ICONS = {
    "ready": "ring",
    "proven": "ring",
    "running": "dot",
    "stopping": "dot",
    "paused": "pause",
    "unanswered": "circle-x",
}


class RunStateIcon(QWidget):
    """Icon of the run state: ring (idle), amber dot (running), pause sign, or cross (action required)."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._state = "ready"
        self.setFixedSize(20, 20)

    @property
    def state(self) -> str:
        """Run state as in `RunView.state`."""
        return self._state

    def show_state(self, state: str) -> None:
        """Show the icon of a run state."""
        if state != self._state:
            self._state = state
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        centre = QRectF(self.rect()).center()
        mark = STATE_ICONS.get(self._state, "ring")
        if mark == "ring":
            painter.setPen(QPen(theme.colour("textTertiary"), 2))
            painter.drawEllipse(centre, 4, 4)
        elif mark == "dot":
            painter.setPen(Qt.PenStyle.NoPen)
            halo = theme.colour("running")
            halo.setAlphaF(0.3)
            painter.setBrush(halo)
            if self._state == "running":
                painter.drawEllipse(centre, HALO_SIZE / 2, HALO_SIZE / 2)
            painter.setBrush(theme.colour("running"))
            painter.drawEllipse(centre, DOT_SIZE / 2, DOT_SIZE / 2)
        else:
            role = theme.status("error").colour if mark == "circle-x" else "textSecondary"
            side = 18 if mark == "circle-x" else 16
            icon_area = QRectF(centre.x() - side / 2, centre.y() - side / 2, side, side)
            paint_icon(painter, icon_area, mark, theme.colour(role))
        painter.end()


class RunStateLabel(QWidget):
    """Text that describes the run state, with a title and a detail."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._title, self._detail, self._is_alarm = "", "", False
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._max_text_width: float | None = None
        theme.changed.connect(self.updateGeometry)

    def limit_width(self, width: float | None) -> None:
        """Limit the painted text to a width in px; None removes the limit.

        A limit is set while an alert covers the rest of the widget.
        """
        if width != self._max_text_width:
            self._max_text_width = width
            self.update()

    @property
    def colour_role(self) -> str:
        """Colour role of the title: the error colour if the user has to act."""
        return self._theme.status("error").colour if self._is_alarm else "text"

    def show_text(self, title: str, detail: str, *, is_alarm: bool = False) -> None:
        """Set the title and the detail.

        Args:
            title: First line.
            detail: Second line, or "".
            is_alarm: True if the user has to act; the title is then red.
        """
        if (title, detail, is_alarm) != (self._title, self._detail, self._is_alarm):
            self._title, self._detail, self._is_alarm = title, detail, is_alarm
            parts = [each for each in (title, detail) if each]
            self.setAccessibleName(". ".join(parts))
            self.setToolTip(plain.tip("\n".join(parts)))
            self.update()

    def _title_font(self) -> QFont:
        font = self._theme.font("label")
        font.setWeight(font.Weight.DemiBold)
        return font

    def full_width(self) -> float:
        """Return the width in px of the longer line."""
        lines = self.lines(float(QWIDGETSIZE_MAX))
        return max(paint.width_of(font, text) for text, font, _role in lines)

    def sizeHint(self) -> QSize:
        height = paint.height_of(self._title_font()) + paint.height_of(self._theme.font("body"))
        return QSize(320, round(height))

    def minimumSizeHint(self) -> QSize:
        return QSize(0, self.sizeHint().height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        width = self.width() if self._max_text_width is None else min(self.width(), self._max_text_width)
        if width < self._theme.scaled(MIN_STATE_TEXT_PX):
            return  # too narrow to be readable; the tooltip and screen readers have the full text
        painter = QPainter(self)
        lines = self.lines(width)
        top = (self.height() - sum(paint.height_of(font) for _text, font, _role in lines)) / 2
        for text, font, role in lines:
            line_height = paint.height_of(font)
            paint.text_line(painter, QRectF(0, top, width, line_height), text, font, self._theme.colour(role))
            top += line_height
        painter.end()

    def lines(self, width: float) -> list[tuple[str, QFont, str]]:
        """Return the lines to paint, each as (text, font, colour role).

        The last line is elided if it is too long. If the bar is high enough, a long detail is split
        into two lines in a small font.
        """
        bold, body, small = self._title_font(), self._theme.font("body"), self._theme.font("small")
        title, detail_role = [(self._title, bold, self.colour_role)], "textSecondary"
        if not self._detail:
            return title
        three_lines_height = paint.height_of(bold) + 2 * paint.height_of(small)
        if paint.width_of(body, self._detail) <= width or three_lines_height > self.height():
            return [*title, (self._detail, body, detail_role)]
        return [*title, *((line, small, detail_role) for line in paint.two_lines(small, self._detail, width))]


class StopResultLabel(QWidget):
    """Result of the last Stop: confirmed, pending or unanswered.

    While a behaviour runs, a less prominent style shows the result of the previous Stop.
    """

    def __init__(self, theme: Theme, *, is_compact: bool = False) -> None:
        super().__init__()
        self._theme, self._is_compact = theme, is_compact
        self._appearance, self._text = "", ""
        self._status: StopStatus = "off"
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)
        self.hide()

    @property
    def text(self) -> str:
        """Current text, or "" if there is no result."""
        return self._text

    @property
    def appearance(self) -> str:
        """Style of the widget: "ok", "off", "error", "counting", "reminder", or "" if there is no result."""
        return self._appearance

    @property
    def status(self) -> StopStatus:
        """Status that determines icon and colour."""
        return self._status

    def show_view(self, view: RunView) -> None:
        """Show the result of the last Stop, or hide the widget if there is none."""
        appearance, text = "", ""
        if view.state == "unanswered":
            appearance, text = "error", (view.compact_text if self._is_compact else view.result or "")
        elif view.state == "stopping" and view.result:
            appearance, text = "counting", view.result
        elif view.result:
            appearance, text = view.result_status, view.result
        elif view.last_stop and not self._is_compact:
            appearance, text = "reminder", view.last_stop
        status = view.last_stop_status if appearance == "reminder" else view.result_status
        if (appearance, text, status) != (self._appearance, self._text, self._status):
            self._appearance, self._text, self._status = appearance, text, status
            self.setAccessibleName(text)
            self.setToolTip(plain.tip(text))
            if appearance in {"ok", "off", "error"}:
                paint.announce(self, text)
            paint.show_when(self, bool(text))
            self.updateGeometry()
            self.update()

    def _font(self) -> QFont:
        if self._is_compact or self._appearance == "reminder":
            font = self._theme.font("small" if self._is_compact else "body")
            font.setWeight(font.Weight.Medium)
            return font
        return self._theme.font("button")

    def _icon_size(self) -> int:
        return 14 if self._is_compact else 16 if self._appearance == "reminder" else 20

    def sizeHint(self) -> QSize:
        width = paint.width_of(self._font(), self._text)
        if self._appearance == "counting":
            return QSize(round(width) + 10, 44 if not self._is_compact else 28)
        width += self._icon_size() + (6 if self._is_compact or self._appearance == "reminder" else 10)
        if self._appearance != "reminder":
            width += 17 if self._is_compact else 28
        min_height = 28 if self._is_compact else 44
        return QSize(round(width) + 2, max(min_height, round(paint.height_of(self._font())) + 10))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        if self._appearance == "counting":
            area, colour = rect.adjusted(0, 0, -8, 0), theme.colour("textSecondary")
            paint.text_line(painter, area, self._text, self._font(), colour, paint.RIGHT)
        elif self._appearance == "reminder":
            self._paint_reminder(painter, rect)
        else:
            status = theme.status(self._status)
            radius = theme.radius("small" if self._is_compact else "large")
            paint.box(painter, rect, radius, theme.colour(status.tint or "panel"))
            self._paint_line(painter, rect.adjusted(8 if self._is_compact else 13, 0, 0, 0))
        painter.end()

    def _paint_reminder(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        line_height = paint.height_of(theme.font("body"))
        upper = QRectF(rect.left(), rect.center().y() - line_height - 1, rect.width(), line_height)
        paint.text_line(
            painter, upper, _("Last stop"), theme.font("body"), theme.colour("textSecondary"), paint.RIGHT
        )
        self._paint_line(painter, QRectF(rect.left(), rect.center().y() + 1, rect.width(), line_height))

    def _paint_line(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        status = theme.status(self._status)
        side = self._icon_size()
        icon_area = QRectF(rect.left(), rect.center().y() - side / 2, side, side)
        paint_icon(painter, icon_area, status.icon, theme.colour(status.colour))
        text_left = side + (6 if self._is_compact or self._appearance == "reminder" else 10)
        paint.text_line(
            painter, rect.adjusted(text_left, 0, 0, 0), self._text, self._font(), theme.colour(status.colour)
        )


class Bar(LinedWidget):
    """Base class of the bars below the app bar, with a separator line at the bottom."""

    def __init__(self, theme: Theme, height: int) -> None:
        super().__init__(theme)
        self.setMinimumHeight(height)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)


def free_area(bar: Bar, left: int, right_widgets: Iterable[QWidget]) -> QRect:
    """Return the free area of a bar, for an alert.

    Args:
        bar: Bar.
        left: Left edge of the area in px.
        right_widgets: Widgets that limit the area on the right.
    """
    right = min((each.x() for each in right_widgets), default=bar.width()) - GAP
    return QRect(left, BANNER_EDGE, max(0, right - left), bar.height() - 1 - 2 * BANNER_EDGE)


class RunBar(Bar):
    """Run bar with three large buttons, the run state, the result of the last Stop, and Stop; 60 px high."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, theme.size("runBar"))
        self.setAccessibleName(_("Run and stop"))
        self.run = RunButton(theme, _("Run"), "play", longest_text=max(_("Resume"), _("Restart"), key=len))
        self.pause = RunButton(theme, _("Pause"), "pause")
        self.step = RunButton(theme, _("Step"), "step-forward")
        self.pace = IconButton(theme, "gauge", _("Speed"), checkable=True, size=36)
        self._speed_menu = Menu(theme, self, _("Speed"))
        self.mark = RunStateIcon(theme)
        self.sentence = RunStateLabel(theme)
        self.result = StopResultLabel(theme)
        self.confirm = Button(theme, "", size="large")
        self.confirm.hide()
        self.confirm.allow_shrinking(96)
        self.restart = Button(theme, _("Restart"), "rotate-ccw", size="large")
        self.restart.hide()
        self.restart.allow_shrinking(96)
        self.stop = StopButton(theme)
        self._fitted_view: RunView | None = None
        self._build(theme)
        self.pace.clicked.connect(lambda: open_below(self._speed_menu, self.pace))
        theme.changed.connect(self._fit)

    def _build(self, theme: Theme) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 4, 8, 5)
        row.setSpacing(8)
        for button in (self.run, self.pause, self.step):
            row.addWidget(button)
        row.addSpacing(-4)
        row.addWidget(self.pace)
        row.addSpacing(-4)
        row.addWidget(Separator(theme, upright=True, length=28))
        row.addSpacing(8)
        row.addWidget(self.mark)
        row.addWidget(self.sentence, 1)
        row.addWidget(self.restart)
        row.addWidget(self.confirm)
        row.addWidget(self.result)
        row.addSpacing(-4)
        row.addWidget(self.stop)

    def set_actions(self, actions: Actions) -> None:
        """Connect the buttons to the actions and fill the menu of speeds."""
        bind_run_buttons(self, actions)
        self._speed_menu.addActions([actions[name] for name in SPEED_COMMANDS])

    def banner_area(self) -> QRect:
        """Return the area for an alert, to the right of the run state.

        The alert may cover the result of a previous Stop, but no buttons and no new result. If the user
        has to act, the text of the run state stays fully visible.
        """
        left = self.sentence.x() + self._state_text_px() + GAP
        right_widgets: list[QWidget] = [
            each for each in (self.restart, self.confirm, self.stop) if not each.isHidden()
        ]
        if not self.result.isHidden() and self.result.appearance != "reminder":
            right_widgets.append(self.result)
        return free_area(self, round(left), right_widgets)

    def reserve_banner_room(self, *, has_banner: bool) -> None:
        """Shorten the text of the run state if there is a banner, else restore its width."""
        self.sentence.limit_width(self._state_text_px() if has_banner else None)

    def _state_text_px(self) -> float:
        # Independent of the current text, so that the alert doesn't move.
        if self.mark.state == "unanswered":
            return self.sentence.full_width()
        scaled = self._theme.scaled
        return max(scaled(STATE_WIDTH_PX), min(scaled(MAX_STATE_WIDTH_PX), STATE_WIDTH_SHARE * self.width()))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        # Pause and Step become icons in every state, then Run. A successful result leaves room for the state,
        # which may be an error.
        scaled, buttons = self._theme.scaled, (self.run, self.pause, self.step)
        buttons_width = sum(each.full_width() for each in buttons)
        needed_width = (
            buttons_width
            + self.stop.sizeHint().width()
            + FIXED_ITEMS_WIDTH_PX
            + scaled(STATE_WIDTH_PX)
            + scaled(RESULT_WIDTH_PX)
        )
        is_icon_only = self.width() < max(scaled(MIN_WIDTH_WITH_TEXTS_PX), needed_width)
        self.run.set_icon_only(self.width() < self._theme.scaled(MIN_TEXT_WIDTH_PX))
        self.pause.set_icon_only(is_icon_only)
        self.step.set_icon_only(is_icon_only)
        visible_widgets = (
            *buttons,
            self.stop,
            *(each for each in (self.restart, self.confirm) if each.isVisibleTo(self)),
        )
        used_width = FIXED_ITEMS_WIDTH_PX + sum(each.sizeHint().width() for each in visible_widgets)
        state_width = min(self.sentence.full_width(), scaled(STATE_WIDTH_PX))
        result_width = max(scaled(MIN_RESULT_WIDTH_PX), self.width() - used_width - state_width)
        self.result.setMaximumWidth(
            round(result_width) if self.result.appearance in {"ok", "off"} else QWIDGETSIZE_MAX
        )

    def show_view(self, view: RunView) -> None:
        """Show a run state. While running, Run is replaced by Restart; while paused, by Resume."""
        can_only_restart = view.can_restart and not view.can_run
        self.run.set_label(_(view.run_label), "rotate-ccw" if view.run_label == RESTART else "play")
        self.run.set_filled(view.can_run or (can_only_restart and view.is_edited))
        self.run.setEnabled(view.can_run or can_only_restart)
        paint.show_when(self.restart, view.is_edited and not can_only_restart)
        self.pause.setEnabled(view.can_pause)
        self.step.setEnabled(view.can_step)
        self.pace.setChecked(view.is_slow)
        self.mark.show_state(view.state)
        self.sentence.show_text(view.title, view.detail, is_alarm=view.state == "unanswered")
        self.result.show_view(view)
        self.confirm.set_label(view.confirm_label or "")
        paint.show_when(self.confirm, view.confirm_label is not None)
        self.stop.show_state(_(view.stop_label), has_ring=view.state == "stopping")
        if view != self._fitted_view:  # because this method is called on every tick
            self._fitted_view = view
            self._fit()


class ToolBar(Bar):
    """Tool bar, 40 px high, with tools on the left and the run state on the right."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, theme.size("toolBar"))
        self.setAccessibleName(_("Tools, run and stop"))
        self.mark = RunStateIcon(theme)
        self.text_label = label("", "body", role="textSecondary")
        self.result = StopResultLabel(theme, is_compact=True)
        self.confirm = Button(theme, "", size="small")
        self.confirm.hide()
        self.confirm.allow_shrinking(96)
        self.run = Button(theme, _("Run"), "play", kind="run", size="small")
        self.run.has_filled_icon = True
        self.pause = IconButton(theme, "pause", _("Pause"))
        self.step = IconButton(theme, "step-forward", _("Step"))
        self.restart = IconButton(theme, "rotate-ccw", _("Restart"))
        self.stop = StopButton(theme, "toolBar")
        self.tools = QHBoxLayout()
        self._build()

    def _build(self) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 0, 6, 1)
        row.setSpacing(GAP)
        self.tools.setSpacing(6)
        row.addLayout(self.tools)
        row.addStretch(1)
        row.addWidget(self.mark)
        row.addSpacing(-4)
        row.addWidget(self.text_label)
        row.addWidget(self.result)
        for button in (self.restart, self.pause, self.step, self.confirm, self.run):
            row.addWidget(button)
        row.addSpacing(-4)
        row.addWidget(self.stop)

    def banner_area(self) -> QRect:
        """Return the area for an alert, between the tools and the run state.

        In a narrow bar, the area includes the run state.
        """
        left = max((each.geometry().right() + 1 for each in self._visible_tools()), default=0) + GAP
        buttons = (self.result, self.restart, self.pause, self.step, self.confirm, self.run, self.stop)
        right_widgets: list[QWidget] = [each for each in buttons if not each.isHidden()]
        states = [each for each in (self.mark, self.text_label) if not each.isHidden()]
        area = free_area(self, left, [*right_widgets, *states])
        return (
            area
            if area.width() >= self._theme.scaled(MIN_BANNER_WIDTH_PX)
            else free_area(self, left, right_widgets)
        )

    def needed_width(self) -> int:
        """Return the width in px at which no text in the bar is shortened."""
        run_state = (
            self.mark,
            self.text_label,
            self.result,
            self.restart,
            self.pause,
            self.step,
            self.confirm,
        )
        visible_widgets = [each for each in (*run_state, self.run, self.stop) if not each.isHidden()]
        parts: list[QWidget] = [*visible_widgets, *self._visible_tools()]
        widths = [each.sizeHint().expandedTo(each.minimumSize()).width() for each in parts]
        return sum(widths) + GAP * (len(widths) + 2)

    def _visible_tools(self) -> list[QWidget]:
        items = (self.tools.itemAt(index) for index in range(self.tools.count()))
        tools = [item.widget() for item in items if item is not None]
        return [tool for tool in tools if tool is not None and not tool.isHidden()]

    def set_actions(self, actions: Actions) -> None:
        """Connect the buttons to the actions of their commands."""
        bind_run_buttons(self, actions)

    def add_tool(self, tool: QWidget, index: int = -1) -> None:
        """Insert a tool on the left of the bar.

        Args:
            tool: Widget to insert.
            index: Position among the tools; -1 appends the tool.
        """
        self.tools.insertWidget(index, tool)

    def show_view(self, view: RunView) -> None:
        """Show a run state in short form."""
        self.result.show_view(view)
        is_result_shown = bool(self.result.text) and view.state in {"proven", "unanswered"}
        self.mark.show_state(view.state)
        self.mark.setVisible(not is_result_shown)
        self.text_label.setText(view.compact_text)
        self.text_label.setVisible(not is_result_shown)
        self.run.set_label(_(view.run_label))
        self.run.setVisible(view.can_run)
        self.restart.setVisible(view.can_restart)
        self.pause.setVisible(view.can_pause)
        self.step.setVisible(view.can_step and view.state in {"running", "paused"})
        self.confirm.set_label(view.confirm_label or "")
        paint.show_when(self.confirm, view.confirm_label is not None)
        self.stop.show_state(_(view.stop_label), has_ring=view.state == "stopping")


def bind_run_buttons(bar: RunBar | ToolBar, actions: Actions) -> None:
    """Connect the run buttons of a bar to the actions of their commands."""
    actions.bind(bar.run, "run.run")
    actions.bind(bar.restart, "run.restart")
    actions.bind(bar.pause, "run.pause")
    actions.bind(bar.step, "run.step")
    actions.bind(bar.stop, "run.stop")
    bar.confirm.clicked.connect(actions["run.confirm"].trigger)
