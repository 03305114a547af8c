"""Plot panel: curves over time, lanes of states, a legend with statistics, and cursors A and B."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, QRectF, QSize, Qt
from PySide6.QtGui import (
    QAction,
    QContextMenuEvent,
    QGuiApplication,
    QKeyEvent,
    QPainter,
    QResizeEvent,
)
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QStackedWidget, QVBoxLayout, QWidget

from app.core.series.curves import MAX_CURVES, Curve, Curves, topics_of
from app.core.series.field_path import FieldPath
from app.errors import CurveError
from app.ui.panels.base import Blocker, PanelContext, PanelWidget, paused_blocker
from app.ui.panels.watch.plot.advice import PlotAdvice
from app.ui.panels.watch.plot.canvas import PlotCanvas
from app.ui.panels.watch.plot.export import CSV_KIND, PNG_KIND, SVG_KIND, PlotExport
from app.ui.panels.watch.plot.lanes import StateLanes
from app.ui.panels.watch.plot.legend import LegendStats, LegendTable, caption_text, columns, next_style
from app.ui.panels.watch.plot.pace import DrawThrottle
from app.ui.panels.watch.plot.plotted_curve import PlotCurve, parse_style
from app.ui.panels.watch.plot.time_view import SPANS, TimeView
from app.ui.panels.watch.plot.tools import PlotTools
from app.ui.panels.watch.plot.xy_canvas import XYCanvas
from app.ui.text.numbers import group_digits
from app.ui.widgets import (
    Button,
    Chip,
    ElidedLabel,
    EmptyAction,
    EmptyState,
    Separator,
    label,
)
from app.ui.widgets.field_drag import dropped_field
from app.ui.widgets.menus import Menu, open_below
from app.ui.widgets.paint import show_when
from app.ui.widgets.table.model import TableModel
from nep.i18n import _, ngettext

if TYPE_CHECKING:
    from PySide6.QtGui import QDragEnterEvent, QDropEvent


STATS_UPDATE_TICKS = 10  # refreshes at 30 Hz; faster changes would be illegible
IDLE_STATS_UPDATE_TICKS = 2 * STATS_UPDATE_TICKS
MAX_ROWS, MAX_TABLE_RATIO = 6, 0.32


class PlotPanel(PanelWidget):
    """Panel with one plot. Data is also collected while the panel is hidden."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Plot"))
        self.curves = Curves(self.world.series, self._topic_names)
        self.shown: list[PlotCurve] = []
        self.view = TimeView()
        self.stats = LegendStats()
        self._ticks = 0
        self._is_redraw_due = True
        self._ticks_since_stats = IDLE_STATS_UPDATE_TICKS
        self._pace = DrawThrottle()
        self._drawn_points = (0, True)  # number of points, and True if no points are omitted
        self._last_cursor = "A"
        self.exporter = PlotExport(
            context, self._picture_parts, lambda: self.shown, lambda: (self.canvas.begin_s, self.canvas.end_s)
        )
        self._make_header()
        self._make_tools()
        self._make_body()
        self.setAcceptDrops(True)
        self._curves_changed()

    # -- construction -------------------------------------------------------------------------------------

    def _make_header(self) -> None:
        self.paused_chip = Chip(self.theme, "", "off", "pause")
        self.freeze = Button(self.theme, _("Pause"), "pause", size="small")
        self.freeze.setCheckable(True)
        self.freeze.toggled.connect(self._set_paused)
        self.chips, self.header = [self.paused_chip], [self.freeze]

    def _make_tools(self) -> None:
        self.tools = PlotTools(self.theme, self.session, lambda: [each.name for each in self.shown])
        self.add, self.span, self.cursors = self.tools.add, self.tools.span, self.tools.cursors
        self.states, self.xy_toggle, self.export = self.tools.states, self.tools.xy_toggle, self.tools.export
        self.add.add_requested.connect(self._add_typed)
        self.add.exited.connect(lambda: self.canvas.setFocus(Qt.FocusReason.OtherFocusReason))
        self.span.changed.connect(self._set_span)
        self.cursors.toggled.connect(self._show_cursors)
        self.states.toggled.connect(lambda _on: self._curves_changed())
        self.xy_toggle.toggled.connect(lambda _on: self._curves_changed())
        self.export.clicked.connect(lambda: open_below(self.exporter.menu(self), self.export))

    def _make_body(self) -> None:
        theme = self.theme
        self.canvas = PlotCanvas(theme)
        self.xy = XYCanvas(theme)
        self.lanes = StateLanes(theme, self.canvas)
        self.model: TableModel[PlotCurve] = TableModel(
            columns(self.stats, self.cursors.isChecked, self._is_gone), lambda shown: shown.name
        )
        self.table = LegendTable(theme, self.model)
        self.table.changed.connect(self._curves_changed)
        self.table.removed.connect(self.remove)
        self.table.copy_requested.connect(self._copy_path)
        self._connect_canvas()
        body = self._make_plot_page()
        self.empty = EmptyState(
            theme,
            "chart-line",
            _("No curves yet"),
            _("Drag a number here from the Inspector, or type its path."),
            [EmptyAction(_("Add a curve"), self.focus_filter, "plus", is_primary=True)],
        )
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(body)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.tools)
        layout.addWidget(self.pages, 1)
        self.setFocusProxy(self.canvas)

    def _make_plot_page(self) -> QWidget:
        # Page with canvas, lanes and legend, shown if there is at least one curve.
        self.drawings = QStackedWidget()
        self.drawings.addWidget(self.canvas)
        self.drawings.addWidget(self.xy)
        self.drawings.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.caption, self.points = (
            ElidedLabel("small", "textTertiary"),
            label("", "small", role="textTertiary"),
        )
        self.caption.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        footer = QHBoxLayout()
        footer.setContentsMargins(12, 4, 12, 5)
        footer.addWidget(self.caption, 1)
        footer.addWidget(self.points)
        self.advice = PlotAdvice(self.theme, lambda topic: self.context.open_doctor(self, topic))
        body = QWidget()
        column = QVBoxLayout(body)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget, stretch in ((self.drawings, 1), (self.lanes, 0), (self.advice, 0)):
            column.addWidget(widget, stretch)
        column.addWidget(Separator(self.theme))
        column.addWidget(self.table)
        column.addWidget(Separator(self.theme))
        column.addLayout(footer)
        return body

    def _connect_canvas(self) -> None:
        self.canvas.zoomed.connect(self._zoom)
        self.canvas.moved.connect(self._move)
        self.canvas.values_changed.connect(self._schedule_redraw)
        self.canvas.show_all_requested.connect(lambda: self._set_span("all"))
        self.canvas.cursor_moved.connect(self._set_cursor)
        self.canvas.field_dropped.connect(self.plot_field)

    def source_changed(self) -> None:
        """Plot the same fields from the new source."""
        state = self.save_state()
        self.tools.add.dispose()
        self.curves.close()
        self.curves = Curves(self.world.series, self._topic_names)
        self.shown.clear()
        self.canvas.cursors.clear()
        self.cursors.setChecked(False)
        self.restore_state(state)

    def _topic_names(self) -> list[str]:
        topics = self.world.all_topics
        return [topic.key for topic in topics]

    # -- curves -------------------------------------------------------------------------------------------

    def plot_field(self, topic: str, path: str) -> None:
        """Add a curve for a field of a topic; with an empty path, ask for the field."""
        if not path:
            self.add.prompt(f"{topic}.")
            return
        try:
            self._add_curves(self.curves.add_field(topic, FieldPath.parse(path)), right=False)
        except CurveError as error:
            self.context.show_toast(_as_sentence(error))

    def show_topic(self, name: str) -> None:
        """Ask the user which field of a topic to plot."""
        self.plot_field(name, "")

    def _add_typed(self, text: str, right: bool) -> None:
        try:
            curves = self.curves.add(text)
        except CurveError as error:
            self.add.show_error(_as_sentence(error))
            return
        if not curves:
            self.add.show_error(_("{field} is already shown.").format(field=text))
            return
        self.add.clear()
        self.add.dispose()
        self._add_curves(curves, right=right)
        self.setFocus(Qt.FocusReason.OtherFocusReason)

    def _add_curves(self, curves: Sequence[Curve], *, right: bool) -> None:
        for curve in curves:
            self.shown.append(PlotCurve(curve, next_style(self.shown), right))
        self._curves_changed()

    def remove(self, name: str) -> None:
        """Remove a curve; the toast offers to undo the removal."""
        plot_curve = next((each for each in self.shown if each.name == name), None)
        if plot_curve is None:
            return
        index = self.shown.index(plot_curve)
        self.shown.remove(plot_curve)
        self.curves.remove(plot_curve.curve)
        self._curves_changed()
        message = _("Removed {field}").format(field=name)
        self.context.show_toast(message, _("Undo"), lambda: self._restore_removed(plot_curve, index))

    def _restore_removed(self, before: PlotCurve, index: int) -> None:
        self._restore_curve(before.to_json())
        if self.shown and self.shown[-1].name == before.name:
            self.shown.insert(index, self.shown.pop())
        self._curves_changed()

    def _copy_path(self, name: str) -> None:
        QGuiApplication.clipboard().setText(name)
        self.context.show_toast(_("Copied {path}").format(path=name))

    def _is_gone(self, plot_curve: PlotCurve) -> bool:
        for name in topics_of(plot_curve.curve.source):
            topic = self.world.topic(name)
            if topic is None or topic.gone_s is not None:
                return True
        return False

    # -- updates ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        self.curves.advance()
        self.exporter.poll()
        if not self.shown:
            return
        pixel_s = (self.canvas.end_s - self.canvas.begin_s) / self.canvas.columns
        is_drawn = self._is_redraw_due or (
            self.view.is_following and self._ticks % self._pace.interval_ticks(pixel_s) == 0
        )
        if is_drawn:
            self._is_redraw_due = False
            with self._pace.measure(self.canvas):
                self._draw()
        self._ticks_since_stats += 1
        if self._ticks_since_stats >= (
            STATS_UPDATE_TICKS if is_drawn else IDLE_STATS_UPDATE_TICKS
        ):  # in the same repaint as the curves
            self._update_stats()

    def _schedule_redraw(self) -> None:
        # Needed while paused, when `refresh` doesn't redraw by itself.
        self._is_redraw_due = True

    def _visible_range(self) -> tuple[float, float]:
        newest = self.curves.newest_s
        newest = self.world.series.now_s() if newest is None else newest
        starts = [float(each.curve.samples.times[0]) for each in self.shown if len(each.curve.samples)]
        return self.view.visible_range(min(starts, default=newest - self.view.span_s), newest)

    def _draw(self) -> None:
        begin_s, end_s = self._visible_range()
        canvas = self.canvas
        canvas.begin_s, canvas.end_s, canvas.anchor_s = begin_s, end_s, end_s
        if self.cursors.isChecked() and not canvas.cursors:
            self._place_cursors()
        lines = [
            (each, each.curve.samples.line(begin_s, end_s, canvas.columns))
            for each in self.shown
            if not each.is_hidden and not each.curve.is_state
        ]
        self._drawn_points = (
            sum(line.sample_count for _c, line in lines),
            all(line.is_complete for _c, line in lines),
        )
        if self.is_xy:
            self.xy.cursors = canvas.cursors
            self.xy.show_pairs(self._pairs(), begin_s, end_s)
        else:
            self._mark_cursors(lines)
            clock_s = (self.world.series.origin_ns + end_s * 1e9) / 1e9
            canvas.show_lines(lines, clock_s)
        states = [each for each in self.shown if each.curve.is_state]
        self.lanes.show_curves(states if self.states.isChecked() and not self.is_xy else [])

    def _numeric_count(self) -> int:
        return sum(not each.curve.is_state for each in self.shown)

    @property
    def is_xy(self) -> bool:
        """True if curves are drawn against each other instead of over time."""
        return self.xy_toggle.isChecked() and self._numeric_count() > 1

    def _pairs(self) -> list[tuple[PlotCurve, PlotCurve]]:
        visible = [each for each in self.shown if not each.is_hidden and not each.curve.is_state]
        return list(zip(visible[0::2], visible[1::2], strict=False))

    def _mark_cursors(self, lines: Sequence[tuple[PlotCurve, object]]) -> None:
        marks = []
        for curve, _line in lines:
            for time_s in self.canvas.cursors.values():
                sample = curve.curve.samples.at(time_s)
                if sample is not None:
                    marks.append((curve, time_s, sample[1]))
        self.canvas.marks = marks

    def _update_stats(self) -> None:
        self._ticks_since_stats = 0
        cursors = self.canvas.cursors
        both = (cursors["A"], cursors["B"]) if len(cursors) == 2 else None
        begin_s, end_s = (min(both), max(both)) if both else (self.canvas.begin_s, self.canvas.end_s)
        self.stats.set_range(begin_s, end_s, both)
        self.table.refresh_visible()
        distance = self.xy.distance() if self.is_xy else None
        self.caption.setText(caption_text(self.curves, has_cursors=both is not None, distance=distance))
        count, is_complete = self._drawn_points
        points = ngettext("{count} point", "{count} points", count).format(count=group_digits(count))
        text = _("{points}, all shown") if is_complete else _("{points}, downsampled to 2 per pixel")
        self.points.setText(text.format(points=points))
        self.advice.show_for(self.curves, self.shown)

    def _curves_changed(self) -> None:
        has_curves = bool(self.shown)
        self.pages.setCurrentIndex(1 if has_curves else 0)
        show_when(self.freeze, has_curves)
        self.tools.update_tools(len(self.shown), self._numeric_count())
        self.drawings.setCurrentIndex(1 if self.is_xy else 0)
        self.model.set_rows(self.shown)
        self._fit_table()
        topics = {topic for each in self.shown for topic in topics_of(each.curve.source)}
        self.set_title(_("Plot"), next(iter(topics)) if len(topics) == 1 else "")
        self.table.viewport().update()
        self._ticks_since_stats = IDLE_STATS_UPDATE_TICKS
        self._schedule_redraw()

    def _fit_table(self) -> None:
        room = round(self.height() * MAX_TABLE_RATIO / max(1, self.table.row_height)) - 1
        rows = max(1, min(MAX_ROWS, room, len(self.shown)))
        self.table.setFixedHeight(self.table.row_height * rows + self.table.horizontalHeader().height() + 2)
        self.table.fit_columns()

    # -- time range ---------------------------------------------------------------------------------------

    def _set_paused(self, is_paused: bool) -> None:
        if is_paused:
            self.view.pause((self.canvas.begin_s, self.canvas.end_s))
        else:
            self.view.resume()
        self.freeze.set_label(_("Resume") if is_paused else _("Pause"), "play" if is_paused else "pause")
        self.paused_chip.set(_("paused; still collecting data") if is_paused else "", "off", "pause")
        self._update_span()
        self._schedule_redraw()

    def blockers(self) -> list[Blocker]:
        resume = lambda: self.freeze.setChecked(False)  # noqa: E731
        return [paused_blocker(self.title(), resume)] if self.freeze.isChecked() else []

    def _zoom(self, factor: float, at_s: float) -> None:
        self.view.zoom(factor, at_s, (self.canvas.begin_s, self.canvas.end_s))
        self._update_span()
        self._schedule_redraw()

    def _move(self, by_s: float) -> None:
        self.view.move(by_s, (self.canvas.begin_s, self.canvas.end_s))
        self.canvas.begin_s, self.canvas.end_s = self.canvas.begin_s + by_s, self.canvas.end_s + by_s
        self.freeze.setChecked(True)
        self._schedule_redraw()

    def _set_span(self, value: str) -> None:
        self.view.set_span(dict(SPANS)[value])
        self._update_span()
        self._schedule_redraw()

    def _update_span(self) -> None:
        selected = self.view.selected_span()
        if selected:
            self.span.set_value(selected)
        else:
            self.span.clear_selection()

    # -- cursors ------------------------------------------------------------------------------------------

    def _show_cursors(self, is_visible: bool) -> None:
        if not is_visible:
            self.canvas.cursors.clear()
            self.canvas.marks = []
        else:
            self._place_cursors()
        self.table.fit_columns()
        self._schedule_redraw()
        self._update_stats()

    def _place_cursors(self) -> None:
        span = self.canvas.end_s - self.canvas.begin_s
        self.canvas.cursors.update(A=self.canvas.begin_s + span / 3, B=self.canvas.begin_s + span * 2 / 3)

    def _set_cursor(self, name: str, time_s: float) -> None:
        self.cursors.setChecked(True)
        self.canvas.cursors[name] = time_s
        self._last_cursor = name
        self._schedule_redraw()
        self._update_stats()

    def _step_cursor(self, steps: int) -> bool:
        # Moves the cursor by samples of the first visible curve.
        time_s = self.canvas.cursors.get(self._last_cursor)
        first = next((each for each in self.shown if not each.is_hidden and len(each.curve.samples)), None)
        if time_s is None or first is None:
            return False
        target_s = first.curve.samples.time_at_step(time_s, steps)
        if target_s is not None:
            self._set_cursor(self._last_cursor, target_s)
        return True

    # -- keys and drops -----------------------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not self._handle_key(event):
            super().keyPressEvent(event)

    def _handle_key(self, event: QKeyEvent) -> bool:
        if event.modifiers() & ~(Qt.KeyboardModifier.ShiftModifier | Qt.KeyboardModifier.KeypadModifier):
            return False
        steps = 10 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
        replay = self.session.replay  # Space controls an open recording
        actions: dict[int, Callable[[], object]] = {
            Qt.Key.Key_C: self.focus_filter,
            Qt.Key.Key_M: self.cursors.toggle,
            Qt.Key.Key_A: lambda: self._set_cursor_at_mouse("A"),
            Qt.Key.Key_B: lambda: self._set_cursor_at_mouse("B"),
            Qt.Key.Key_Space: self.freeze.toggle if replay is None else replay.toggle,
            Qt.Key.Key_Left: lambda: self._handle_arrow(-steps),
            Qt.Key.Key_Right: lambda: self._handle_arrow(steps),
            Qt.Key.Key_Plus: lambda: self._zoom(1 / 1.5, self._middle_s()),
            Qt.Key.Key_Minus: lambda: self._zoom(1.5, self._middle_s()),
            Qt.Key.Key_0: self._show_all,
        }
        action = actions.get(event.key())
        if action is None or (event.key() != Qt.Key.Key_C and not self.shown):
            return False
        action()
        return True

    def _middle_s(self) -> float:
        return (self.canvas.begin_s + self.canvas.end_s) / 2

    def _handle_arrow(self, steps: int) -> None:
        # Moves the cursor or, if there is none, the time range.
        if not self._step_cursor(steps):
            self._move(steps * (self.canvas.end_s - self.canvas.begin_s) / 20)

    def _show_all(self) -> None:
        self.canvas.reset_value_ranges()
        self._set_span("all")

    def _set_cursor_at_mouse(self, name: str) -> None:
        # Places the cursor under the mouse, or in the middle if the mouse is elsewhere.
        mouse_s = self.canvas.mouse_s
        self._set_cursor(name, self._middle_s() if mouse_s is None else mouse_s)

    def focus_filter(self) -> bool:
        self.add.prompt(self.add.text())
        return True

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped_field(event.mimeData()) is not None:
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        field = dropped_field(event.mimeData())
        if field is not None:
            event.acceptProposedAction()
            self.plot_field(*field)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self._show_menu(event.globalPos())

    def _show_menu(self, position: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addActions(self.more_actions())
        menu.popup(position)

    # -- export -------------------------------------------------------------------------------------------

    def more_actions(self) -> list[QAction]:
        actions = []
        rows: tuple[tuple[str, str, Callable[[], object]], ...] = (
            (_("Add a curve"), "plus", self.focus_filter),
            (_("Show everything"), "maximize", self._show_all),
            (_("Export data (CSV)"), "download", lambda: self.exporter.prompt_file(CSV_KIND)),
            (_("Export image (PNG)"), "image", lambda: self.exporter.prompt_file(PNG_KIND)),
            (_("Export vector image (SVG)"), "spline", lambda: self.exporter.prompt_file(SVG_KIND)),
        )
        for text, icon, callback in rows:
            action = QAction(self.theme.icon(icon), text, self)
            action.triggered.connect(lambda _on=False, callback=callback: callback())
            action.setEnabled(bool(self.shown) or callback == self.focus_filter)
            actions.append(action)
        for old in self._menu_actions:
            old.deleteLater()
        self._menu_actions = actions
        return actions

    _menu_actions: Sequence[QAction] = ()

    def _picture_parts(self) -> list[tuple[QSize, Callable[[QPainter, QRectF], object]]]:
        # Parts of the image, from the top.
        self._draw()
        canvas, xy, lanes = self.canvas, self.xy, self.lanes

        def paint_curves(painter: QPainter, box: QRectF) -> None:
            widget = xy if self.is_xy else canvas
            widget.render(painter, box, widget.viewport().rect())
            if widget is xy:
                xy.paint_marks(painter)
            else:
                canvas.paint_cursors(painter)

        parts: list[tuple[QSize, Callable[[QPainter, QRectF], object]]] = [
            (self.drawings.size(), paint_curves)
        ]
        if not lanes.isHidden():
            parts.append((lanes.size(), lambda painter, _box: lanes.paint_lanes(painter)))
        return parts

    # -- saved state --------------------------------------------------------------------------------------

    def save_state(self) -> dict[str, object]:
        return {
            "curves": [
                {**each.to_json(), "topics": sorted(topics_of(each.curve.source))} for each in self.shown
            ],
            "span": 0.0 if self.view.is_all else self.view.span_s,
            "states": self.states.isChecked(),
            "across": self.xy_toggle.isChecked(),
        }

    def restore_state(self, state: Mapping[str, object]) -> None:
        curves = state.get("curves")
        for saved in curves[:MAX_CURVES] if isinstance(curves, list) else ():
            if isinstance(saved, Mapping):
                self._restore_curve(saved)
        span = state.get("span")
        if isinstance(span, (int, float)) and 0 <= span <= 1e8:
            self.view.set_span(float(span))
            self._update_span()
        self.states.setChecked(state.get("states") is not False)
        self.xy_toggle.setChecked(state.get("across") is True)
        self._curves_changed()

    def _restore_curve(self, saved: Mapping[str, object]) -> None:
        topic, path, text, topics = (saved.get(name) for name in ("topic", "path", "text", "topics"))
        topic_names = [each for each in topics if isinstance(each, str)] if isinstance(topics, list) else []
        try:
            if isinstance(topic, str) and isinstance(path, str):
                curves = self.curves.add_field(topic, FieldPath.parse(path))
            else:
                curves = self.curves.add(text if isinstance(text, str) else "", topic_names)
        except CurveError:
            return
        for curve in curves:
            plot_curve = PlotCurve(curve, parse_style(saved, next_style(self.shown)))
            plot_curve.is_on_right_axis = saved.get("right") is True
            plot_curve.is_hidden = saved.get("hidden") is True
            self.shown.append(plot_curve)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_table()

    def theme_changed(self) -> None:
        self.table.set_row_height(self.row_height(), large=self.density == "comfortable")
        self._fit_table()
        self._schedule_redraw()

    def dispose(self) -> None:
        self.add.dispose()
        self.curves.close()
        self.exporter.close()


def _as_sentence(error: CurveError) -> str:
    text = str(error)
    return f"{text[:1].upper()}{text[1:]}" if text.endswith("?") else f"{text[:1].upper()}{text[1:]}."
