"""Problems panel: errors and warnings of the behaviour, updated during editing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QResizeEvent
from PySide6.QtWidgets import (
    QGridLayout,
    QSizePolicy,
    QWidget,
)

from app.blocks.model.program import Problem
from app.core.projects.problems import Fix, ProblemLine, problem_lines
from app.core.reports import not_installed
from app.robots.virtual_models import virtual_models
from app.ui.intents import ShowBlock
from app.ui.panels.base import Density, Panel, PanelContext, PanelWidget
from app.ui.panels.home import RowHome
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Chip, ContentScrollArea, ElidedLabel, label, paint
from app.ui.widgets.cards import Tile
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.indicators import StatusIcon
from app.ui.widgets.keyboard import is_activation_key
from app.ui.widgets.labels import PartlyBoldLabel
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.blocks.model.program import Program
    from app.core.alerts.alerts import ActiveAlert
    from app.core.projects.open_project import OpenProject
    from app.robots.description.description import Robot

STATUS_BY_SEVERITY = {"error": "error", "warning": "warn", "info": "info"}
SEVERITY_NAMES = {"error": lazy("error"), "warning": lazy("warning"), "info": lazy("info")}
MAX_ROWS = 60
MIN_SENTENCE_SHARE = 0.45  # share of a row's width; with less, the buttons are below the sentence
MIN_STATUS_WIDTH = 60
SPACING, LEFT_MARGIN, RIGHT_MARGIN, BOTTOM_MARGIN = 10, 14, 8, 6
NO_PROBLEMS_TEXT = lazy("No problems.\nIf something needs fixing, it appears here.")


class ProblemRow(QWidget):
    """Row of a problem: icon, sentence with its subject in bold, and a button for each fix.

    In a narrow row the buttons are below the sentence.

    Args:
        line: Problem with its fixes.
        is_large: True for large text.

    Signals:
        pressed: Id of the block with the problem.
        fix_requested: Intent of the fix to apply.
        step_requested: Number of rows by which to move the focus.
    """

    pressed = Signal(str)
    fix_requested = Signal(object)
    step_requested = Signal(int)

    def __init__(self, theme: Theme, line: ProblemLine, *, is_large: bool) -> None:
        super().__init__()
        problem = line.problem
        self._theme, self.line, self.problem, self._is_large = theme, line, problem, is_large
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        severity = _(SEVERITY_NAMES[problem.severity])
        text = _("{severity}: {sentence}").format(severity=severity, sentence=problem.message)
        self.setAccessibleName(text)
        self.setProperty("focusRadius", theme.radius("small"))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        if problem.block_id:
            self.setCursor(Qt.CursorShape.PointingHandCursor)
            self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(LEFT_MARGIN, 0, RIGHT_MARGIN, 0)
        grid.setHorizontalSpacing(SPACING)
        grid.setVerticalSpacing(0)
        grid.setColumnStretch(2, 1)
        status = STATUS_BY_SEVERITY[problem.severity]
        self._icons: list[QWidget] = [StatusIcon(theme, status, colour="text" if status == "info" else "")]
        category = problem.category or "values"
        icon = problem.icon or theme.block_icon(category)
        if problem.category:
            self._icons.append(Tile(theme, icon, category, 22))
        for column, each in enumerate(self._icons):
            grid.addWidget(each, 0, column)
        kind = "bodyLarge" if is_large else "body"
        self.sentence = PartlyBoldLabel(theme, problem.message, problem.subject, kind)
        grid.addWidget(self.sentence, 0, 2)
        self.buttons = [self._make_fix_button(fix) for fix in line.fixes]
        self._button_row = QWidget()
        self._button_row.setMinimumWidth(1)
        flow = Flow(self._button_row, gap=SPACING, row_gap=4)
        for button in self.buttons:
            flow.addWidget(button)
        grid.addWidget(self._button_row, 0, 3)
        self._button_row.setVisible(bool(self.buttons))
        self._is_stacked = False
        self._arrange()
        theme.changed.connect(self._arrange)

    def _make_fix_button(self, fix: Fix) -> Button:
        button = Button(self._theme, fix.label, size="small")
        button.clicked.connect(lambda: self.fix_requested.emit(fix.action))
        return button

    def _arrange(self) -> None:
        self._grid.setRowMinimumHeight(0, self._line_height())
        others_width = sum(each.sizeHint().width() + SPACING for each in (*self._icons, self._button_row))
        sentence_width = self.width() - LEFT_MARGIN - RIGHT_MARGIN - others_width
        min_width = min(self.width() * MIN_SENTENCE_SHARE, self.sentence.full_width())
        is_stacked = bool(self.buttons) and sentence_width < min_width
        if is_stacked != self._is_stacked:
            self._is_stacked = is_stacked
            self._grid.setContentsMargins(LEFT_MARGIN, 0, RIGHT_MARGIN, BOTTOM_MARGIN if is_stacked else 0)
            self._grid.addWidget(self._button_row, *((1, 2) if is_stacked else (0, 3)))

    def contains_focus(self) -> bool:
        """Return True if the row or one of its buttons has the focus."""
        return self.hasFocus() or any(button.hasFocus() for button in self.buttons)

    def sizeHint(self) -> QSize:
        return QSize(300, max(self._line_height(), self._grid.sizeHint().height()))

    def _line_height(self) -> int:
        size = "comfortable" if self._is_large else "compact"
        return max(round(self._theme.scaled(self._theme.size("row", size))), 30)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and self.rect().contains(event.position().toPoint()):
            self._press()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        steps = {Qt.Key.Key_Up: -1, Qt.Key.Key_Down: 1}
        if is_activation_key(event.key()):
            self._press()
        elif event.key() in steps:
            self.step_requested.emit(steps[Qt.Key(event.key())])
        else:
            super().keyPressEvent(event)

    def _press(self) -> None:
        if self.problem.block_id:
            self.pressed.emit(self.problem.block_id)


class ProblemsPanel(PanelWidget):
    """Panel with the problems of the active behaviour."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Problems"))
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self._program: Program | None = None
        self._editor_alert: ActiveAlert | None = None
        self._problem_lines: tuple[ProblemLine, ...] | None = None
        self.rows: list[ProblemRow] = []
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.status_label = ElidedLabel("body", "textSecondary", min_elided_width=MIN_STATUS_WIDTH)
        self.status_label.setText(_("Checked as you build"))
        self.header = [self.status_label]
        self._scroll = ScrollColumn(_("Problems"), margins=(0, 4, 0, 4))
        self._column = self._scroll.column
        self.overflow_label = label("", "body", role="textSecondary")
        self.overflow_label.setContentsMargins(14, 6, 8, 6)
        self.overflow_label.hide()
        self._column.insertWidget(0, self.overflow_label)
        self.empty_label = label(_(NO_PROBLEMS_TEXT), "bodyLarge", role="textSecondary", wrap=True)
        self.empty_label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.pages = self.make_page_stack(ContentScrollArea(self.empty_label), self._scroll)

    def refresh(self) -> None:
        project = self.session.document
        program = project.newest_program()
        if program is None:
            self.status_label.setText(_("Checking"))
            return
        editor_alert = self.session.alerts.get(not_installed.ALERT_ID)
        if program is self._program and editor_alert == self._editor_alert:
            return
        self._program, self._editor_alert = program, editor_alert
        self.status_label.setText(_("Checked as you build"))
        lines = problem_lines(
            program.problems,
            project.project.pages if program.absent else (),  # parsed only if robots are missing
            self._missing_robots(project),
            [link.robot for link in self.session.fleet.connected],
            virtual_models(),
            program.absent,
        )
        if editor_alert is not None:
            message = f"{editor_alert.title} {editor_alert.detail}"
            lines = (ProblemLine(Problem("error", None, None, editor_alert.title, message), ()), *lines)
        if lines != self._problem_lines:
            self._problem_lines = lines
            self._show(lines)

    def _missing_robots(self, project: OpenProject) -> list[Robot]:
        # As described in the behaviour, else as last reported on the network.
        robots = {link.name: link.robot for link in self.session.fleet.links if not link.is_connected}
        return list({**robots, **{robot.name: robot for robot in project.absent_robots}}.values())

    def _show(self, lines: tuple[ProblemLine, ...]) -> None:
        # Existing rows are reused, so that they don't lose the focus.
        rows_by_line = {row.line: row for row in self.rows}
        had_focus = False
        for line, row in rows_by_line.items():
            if line not in lines[:MAX_ROWS]:
                had_focus = had_focus or row.contains_focus()
                self._column.removeWidget(row)
                row.hide()
                row.deleteLater()
        self.rows = [
            rows_by_line.get(line) or self._create_row(line) for line in list(dict.fromkeys(lines))[:MAX_ROWS]
        ]
        for index, row in enumerate(self.rows):
            self._column.insertWidget(index, row)
        hidden_count = max(0, len(lines) - MAX_ROWS)
        text = ngettext(
            "{count} more, shown once these are fixed",
            "{count} more, shown once these are fixed",
            hidden_count,
        )
        self.overflow_label.setText(text.format(count=hidden_count))
        paint.show_when(self.overflow_label, hidden_count > 0)
        self.pages.setCurrentIndex(1 if lines else 0)
        if had_focus:  # the focus stays in the panel when the focused problem is fixed
            (self.rows[0] if self.rows else self).setFocus(Qt.FocusReason.OtherFocusReason)
        self._show_counts(lines)

    def _create_row(self, line: ProblemLine) -> ProblemRow:
        row = ProblemRow(self.theme, line, is_large=self.density == "comfortable")
        row.pressed.connect(lambda block: self.context.request(ShowBlock(block)))
        row.fix_requested.connect(self.context.request)
        row.step_requested.connect(lambda step: self._step_focus(row, step))
        return row

    def _step_focus(self, row: ProblemRow, step: int) -> None:
        index = self.rows.index(row) + step
        if 0 <= index < len(self.rows):
            self.rows[index].setFocus(Qt.FocusReason.TabFocusReason)
            self._scroll.ensureWidgetVisible(self.rows[index])

    def badge(self) -> tuple[str, str] | None:
        self.refresh()  # hidden panels are not refreshed otherwise
        return (self.chip.text, self.chip.status) if self._problem_lines else None

    def _show_counts(self, lines: tuple[ProblemLine, ...]) -> None:
        if not lines:
            self.chip.set(_("No problems"), "ok")
            return
        kinds = [each.severity for each in lines]
        worst = next((kind for kind in ("error", "warning") if kind in kinds), "info")
        self.chip.set(str(len(lines)), STATUS_BY_SEVERITY[worst])
        texts = [_count_text(kind, kinds.count(kind)) for kind in SEVERITY_NAMES if kind in kinds]
        self.chip.setAccessibleName(", ".join(texts))
        self.chip.setToolTip(plain.tip(", ".join(texts)))

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        if self._problem_lines is not None:
            for row in self.rows:
                self._column.removeWidget(row)
                row.deleteLater()
            self.rows = []
            self._show(self._problem_lines)


def _count_text(severity: str, count: int) -> str:
    if severity == "error":
        return ngettext("{count} error", "{count} errors", count).format(count=count)
    if severity == "warning":
        return ngettext("{count} warning", "{count} warnings", count).format(count=count)
    return ngettext("{count} hint", "{count} hints", count).format(count=count)


PANEL = Panel(
    "problems", lazy("Problems"), "triangle-alert", (), ProblemsPanel, home=(RowHome("behaviour", 0, 1, 124),)
)
