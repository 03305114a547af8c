"""Legend below the curves: visibility, style, axis and statistics of each curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QModelIndex, QPoint, Qt, Signal
from PySide6.QtGui import QKeyEvent

from app.core.series.curves import Curves
from app.core.series.formula import FieldSource
from app.core.series.samples import RangeStats
from app.ui.panels.watch.plot.curve_style import COLOUR_NAMES, CurveStyle, Stroke
from app.ui.panels.watch.plot.plotted_curve import MINUS, PlotCurve, number_text, value_text
from app.ui.text.numbers import group_digits, seconds_text
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext, pgettext


class LegendStats:
    """Statistics of curves within a time range, computed when they are first requested."""

    def __init__(self) -> None:
        self.begin_s = self.end_s = 0.0
        self.cursors: tuple[float, float] | None = None
        self._stats_cache: dict[str, RangeStats] = {}

    def set_range(self, begin_s: float, end_s: float, cursors: tuple[float, float] | None) -> None:
        """Set the time range of the statistics.

        Args:
            begin_s: Start of the range in s.
            end_s: End of the range in s.
            cursors: Times of cursors A and B in s, or None without cursors.
        """
        self.begin_s, self.end_s, self.cursors = begin_s, end_s, cursors
        self._stats_cache.clear()

    def stats_for(self, plot_curve: PlotCurve) -> RangeStats:
        """Return minimum, maximum and mean of a curve."""
        stats = self._stats_cache.get(plot_curve.name)
        if stats is None:
            stats = self._stats_cache[plot_curve.name] = plot_curve.curve.samples.stats(
                self.begin_s, self.end_s
            )
        return stats

    def value_at_cursor(self, plot_curve: PlotCurve, which: int) -> float | str | None:
        """Return the value of a curve at a cursor, or None if there is no value or no cursor.

        Args:
            plot_curve: Curve.
            which: 0 for cursor A, 1 for cursor B.
        """
        if self.cursors is None:
            return None
        time_s = self.cursors[which]
        if plot_curve.curve.is_state:
            return plot_curve.curve.states.at(time_s) if plot_curve.curve.states is not None else None
        sample = plot_curve.curve.samples.at(time_s)
        return sample[1] if sample is not None else None


class _CellFactory:
    """Functions that create the cells of the columns."""

    def __init__(self, stats: LegendStats, is_gone: Callable[[PlotCurve], bool]) -> None:
        self._stats, self._is_gone = stats, is_gone

    @staticmethod
    def _role(plot_curve: PlotCurve) -> str:
        return "textDisabled" if plot_curve.is_hidden else "text"

    @staticmethod
    def eye(plot_curve: PlotCurve) -> Cell:
        name = "eye-off" if plot_curve.is_hidden else "eye"
        text = pgettext("curve", "hidden") if plot_curve.is_hidden else pgettext("curve", "shown")
        return Cell(
            icon=name, role="textTertiary" if plot_curve.is_hidden else "textSecondary", accessible_text=text
        )

    @staticmethod
    def stroke(plot_curve: PlotCurve) -> Cell:
        style = plot_curve.style
        return Cell(
            mark=Stroke(style, plot_curve.curve.is_state, plot_curve.is_hidden),
            accessible_text=_(COLOUR_NAMES[style.colour % len(COLOUR_NAMES)]),
        )

    def name(self, plot_curve: PlotCurve) -> Cell:
        is_field = isinstance(plot_curve.curve.source, FieldSource)
        icon = None if is_field else "square-function"
        is_gone = self._is_gone(plot_curve)
        return Cell(
            plot_curve.name, icon, self._role(plot_curve), mono=True, elide_middle=True, is_struck_out=is_gone
        )

    def axis(self, plot_curve: PlotCurve) -> Cell:
        if plot_curve.curve.is_state:
            text = _("yes or no") if isinstance(plot_curve.curve.last, bool) else _("text")
        else:
            text = pgettext("axis", "right") if plot_curve.is_on_right_axis else pgettext("axis", "left")
        return Cell(text, role="textSecondary" if not plot_curve.is_hidden else "textDisabled")

    def last(self, plot_curve: PlotCurve) -> Cell:
        return Cell(value_text(plot_curve.curve.last), role=self._role(plot_curve))

    def at_a(self, plot_curve: PlotCurve) -> Cell:
        return Cell(value_text(self._stats.value_at_cursor(plot_curve, 0)), role=self._role(plot_curve))

    def at_b(self, plot_curve: PlotCurve) -> Cell:
        return Cell(value_text(self._stats.value_at_cursor(plot_curve, 1)), role=self._role(plot_curve))

    def difference(self, plot_curve: PlotCurve) -> Cell:
        stats = self._stats
        if stats.cursors is None:
            return Cell()
        if plot_curve.curve.is_state and plot_curve.curve.states is not None:
            begin_s, end_s = sorted(stats.cursors)
            if isinstance(plot_curve.curve.last, bool):
                duration = seconds_text(plot_curve.curve.states.duration_s("true", begin_s, end_s))
                text = _("true for {seconds}").format(seconds=duration)
            else:
                count = plot_curve.curve.states.change_count(begin_s, end_s)
                text = ngettext("{count} change", "{count} changes", count).format(count=count)
            return Cell(text, role=self._role(plot_curve), bold=True)
        first, second = stats.value_at_cursor(plot_curve, 0), stats.value_at_cursor(plot_curve, 1)
        if not (isinstance(first, float) and isinstance(second, float)):
            return Cell()
        return Cell(number_text(second - first), role=self._role(plot_curve), bold=True)

    def stat(self, which: str) -> Callable[[PlotCurve], Cell]:
        def cell(plot_curve: PlotCurve) -> Cell:
            value = None if plot_curve.curve.is_state else getattr(self._stats.stats_for(plot_curve), which)
            return Cell("" if value is None else number_text(value), role=self._role(plot_curve))

        return cell


def columns(
    stats: LegendStats, has_cursors: Callable[[], bool], is_gone: Callable[[PlotCurve], bool]
) -> tuple[Column[PlotCurve], ...]:
    """Return the columns of the legend.

    Args:
        stats: Statistics of the curves.
        has_cursors: Returns True if there are cursors; the columns of cursors A and B are hidden otherwise.
        is_gone: Returns True for a curve whose topic no longer exists.
    """
    cells = _CellFactory(stats, is_gone)
    between = {"is_numeric": True, "is_available": has_cursors}
    return (
        Column("eye", "", 34, cells.eye, label=lazy("Shown")),
        Column("stroke", "", 48, cells.stroke, label=lazy("Colour and axis")),
        Column("name", lazy("Curve"), 150, cells.name, stretch=True, tip=lambda shown: shown.name),
        Column("axis", lazy("Axis"), 84, cells.axis, hide_order=5),
        Column("last", lazy("Last"), 74, cells.last, is_numeric=True),
        Column("a", "A", 70, cells.at_a, hide_order=2, **between),  # type: ignore[arg-type]
        Column("b", "B", 70, cells.at_b, hide_order=2, **between),  # type: ignore[arg-type]
        Column("difference", f"B {MINUS} A", 86, cells.difference, hide_order=1, **between),  # type: ignore[arg-type]
        Column("min", lazy("Min"), 70, cells.stat("minimum"), is_numeric=True, hide_order=4),
        Column("max", lazy("Max"), 70, cells.stat("maximum"), is_numeric=True, hide_order=4),
        Column("mean", lazy("Mean"), 70, cells.stat("mean"), is_numeric=True, hide_order=3),
    )


class LegendTable(TableView[PlotCurve]):
    """Table of the curves of a plot.

    Signals:
        changed: Visibility, axis or style of a curve changed.
        removed: Name of a curve to remove.
        copy_requested: Name of a curve to copy to the clipboard.
    """

    changed = Signal()
    removed = Signal(str)
    copy_requested = Signal(str)

    def __init__(self, theme: Theme, model: TableModel[PlotCurve]) -> None:
        super().__init__(theme, model)
        self.setAccessibleName(_("Curves and their values"))
        self.clicked.connect(self._handle_click)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._show_menu)
        self.opened.connect(self._handle_enter)

    def _handle_click(self, index: QModelIndex) -> None:
        plot_curve = self._model.row_at(index)
        column = self.columns[index.column()].name
        if plot_curve is None:
            return
        if column == "eye":
            self.toggle_visibility(plot_curve)
        elif column == "stroke":
            self._open_curve_menu(plot_curve, self.visualRect(index).bottomLeft())

    def _handle_enter(self, key: str) -> None:
        # Enter opens the menu; a click does so only on the sample of the line.
        if self.is_keyboard_navigation:
            index = self._model.index_of(key)
            plot_curve = self._model.row_at(index)
            if plot_curve is not None:
                self._open_curve_menu(plot_curve, self.visualRect(index).bottomLeft())

    def toggle_visibility(self, plot_curve: PlotCurve) -> None:
        """Toggle the visibility of a curve."""
        plot_curve.is_hidden = not plot_curve.is_hidden
        self.changed.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        plot_curve = self._model.row_at(self.currentIndex())
        if plot_curve is not None and event.key() in {Qt.Key.Key_Delete, Qt.Key.Key_Backspace}:
            self.removed.emit(plot_curve.name)
        elif plot_curve is not None and event.key() == Qt.Key.Key_H and not event.modifiers():
            self.toggle_visibility(plot_curve)
        elif event.text().isprintable() and event.text().strip() != "/" and event.text():
            event.ignore()  # handled by the plot panel
        else:
            super().keyPressEvent(event)

    def _show_menu(self, position: QPoint) -> None:
        index = self.indexAt(position)
        plot_curve = self._model.row_at(index)
        if plot_curve is not None:
            self._open_curve_menu(plot_curve, position)

    def _open_curve_menu(self, plot_curve: PlotCurve, position: QPoint) -> None:
        menu = self.menu_of(plot_curve)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.viewport().mapToGlobal(position))

    def menu_of(self, plot_curve: PlotCurve) -> Menu:
        """Return the context menu of a curve."""
        menu = Menu(self.theme, self)
        if not plot_curve.curve.is_state:
            for right, text in ((False, _("Left axis")), (True, _("Right axis"))):
                action = menu.addAction(text)
                action.setCheckable(True)
                action.setChecked(plot_curve.is_on_right_axis is right)
                action.triggered.connect(
                    lambda _on=False, right=right: self._set_axis(plot_curve, right=right)
                )
            menu.addSeparator()
        for number, text in enumerate(COLOUR_NAMES):
            action = menu.addAction(_(text))
            action.setCheckable(True)
            action.setChecked(plot_curve.style.colour % len(COLOUR_NAMES) == number)
            action.triggered.connect(lambda _on=False, number=number: self._set_colour(plot_curve, number))
        menu.addSeparator()
        hide = menu.addAction(
            self.theme.icon("eye" if plot_curve.is_hidden else "eye-off"),
            _("Show") if plot_curve.is_hidden else _("Hide"),
        )
        hide.triggered.connect(lambda: self.toggle_visibility(plot_curve))
        copy = menu.addAction(self.theme.icon("copy"), _("Copy name"))
        copy.triggered.connect(lambda: self.copy_requested.emit(plot_curve.name))
        remove = menu.addAction(self.theme.icon("trash-2"), _("Remove"))
        remove.triggered.connect(lambda: self.removed.emit(plot_curve.name))
        return menu

    def _set_axis(self, plot_curve: PlotCurve, *, right: bool) -> None:
        plot_curve.is_on_right_axis = right
        self.changed.emit()

    def _set_colour(self, plot_curve: PlotCurve, number: int) -> None:
        plot_curve.style = CurveStyle(number, plot_curve.style.pattern)
        self.changed.emit()


def next_style(curves: Sequence[PlotCurve]) -> CurveStyle:
    """Return a style for a new curve, with the colour and the pattern that the fewest curves have."""
    colours = [curve.style.colour % len(COLOUR_NAMES) for curve in curves]
    patterns = [curve.style.pattern % 4 for curve in curves]
    colour = min(range(len(COLOUR_NAMES)), key=lambda each: (colours.count(each), each))
    pattern = min(range(4), key=lambda each: (patterns.count(each), each))
    return CurveStyle(colour, pattern)


def caption_text(curves: Curves, *, has_cursors: bool, distance: float | None) -> str:
    """Format the text below the legend: range of the statistics, and number of lost or discarded values.

    Args:
        curves: All curves of the plot.
        has_cursors: True if the statistics are limited to the range between the cursors.
        distance: Distance of the cursors in a plot of curves against each other, or None.
    """
    range_text = _("Min, max and mean between A and B")
    parts = [range_text if has_cursors else _("Min, max and mean of the visible range")]
    if distance is not None:
        parts.append(_("A to B: {distance}").format(distance=number_text(distance)))
    for count, template in (
        (
            curves.lost,
            ngettext(
                "{count} message lost (gap in the curve)",
                "{count} messages lost (gaps in the curve)",
                curves.lost,
            ),
        ),
        (
            curves.skipped_count,
            ngettext(
                "{count} message can't be decoded", "{count} messages can't be decoded", curves.skipped_count
            ),
        ),
        (
            curves.discarded_count,
            ngettext(
                "{count} point discarded: the clock was set back",
                "{count} points discarded: the clock was set back",
                curves.discarded_count,
            ),
        ),
        (
            curves.evicted_count,
            ngettext("{count} old point discarded", "{count} old points discarded", curves.evicted_count),
        ),
    ):
        if count:
            parts.append(template.format(count=group_digits(count)))
    return " · ".join(parts)
