"""Legend below the curves: visibility, style, axis and statistics of each curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QModelIndex, QPoint, Qt, Signal
from PySide6.QtGui import QKeyEvent

from app.core.series.curves import Curves
from app.core.series.formula import FieldSource
from app.core.series.samples import Figures
from app.ui.panels.plot.look import COLOURS, CurveLook, Stroke
from app.ui.panels.plot.shown_curve import MINUS, ShownCurve, number_words, value_words
from app.ui.text.numbers import grouped, seconds_words
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext, pgettext


class LegendFigures:
    """Statistics of curves within a time range, computed on request."""

    def __init__(self) -> None:
        self.begin_s = self.end_s = 0.0
        self.cursors: tuple[float, float] | None = None
        self._kept: dict[str, Figures] = {}

    def look_at(self, begin_s: float, end_s: float, cursors: tuple[float, float] | None) -> None:
        """Set the time range, and the times of cursors A and B."""
        self.begin_s, self.end_s, self.cursors = begin_s, end_s, cursors
        self._kept.clear()

    def of(self, shown: ShownCurve) -> Figures:
        """Return minimum, maximum and mean of a curve."""
        found = self._kept.get(shown.name)
        if found is None:
            found = self._kept[shown.name] = shown.curve.samples.figures(self.begin_s, self.end_s)
        return found

    def at_cursor(self, shown: ShownCurve, which: int) -> float | str | None:
        """Return a curve's value at cursor A (0) or B (1)."""
        if self.cursors is None:
            return None
        time_s = self.cursors[which]
        if shown.curve.is_state:
            return shown.curve.states.at(time_s) if shown.curve.states is not None else None
        found = shown.curve.samples.at(time_s)
        return found[1] if found is not None else None


class _Cells:
    """Factory of the cells of each column."""

    def __init__(self, figures: LegendFigures, is_gone: Callable[[ShownCurve], bool]) -> None:
        self.figures, self._is_gone = figures, is_gone

    @staticmethod
    def _role(shown: ShownCurve) -> str:
        return "textDisabled" if shown.hidden else "text"

    @staticmethod
    def eye(shown: ShownCurve) -> Cell:
        name = "eye-off" if shown.hidden else "eye"
        words = pgettext("curve", "hidden") if shown.hidden else pgettext("curve", "shown")
        return Cell(icon=name, role="textTertiary" if shown.hidden else "textSecondary", said=words)

    @staticmethod
    def stroke(shown: ShownCurve) -> Cell:
        look = shown.look
        return Cell(
            mark=Stroke(look, shown.curve.is_state, shown.hidden), said=_(COLOURS[look.colour % len(COLOURS)])
        )

    def name(self, shown: ShownCurve) -> Cell:
        is_field = isinstance(shown.curve.source, FieldSource)
        icon = None if is_field else "square-function"
        gone = self._is_gone(shown)
        return Cell(shown.name, icon, self._role(shown), mono=True, middle=True, struck=gone)

    def axis(self, shown: ShownCurve) -> Cell:
        if shown.curve.is_state:
            words = _("yes or no") if isinstance(shown.curve.last, bool) else _("text")
        else:
            words = pgettext("axis", "right") if shown.right else pgettext("axis", "left")
        return Cell(words, role="textSecondary" if not shown.hidden else "textDisabled")

    def last(self, shown: ShownCurve) -> Cell:
        return Cell(value_words(shown.curve.last), role=self._role(shown))

    def at_a(self, shown: ShownCurve) -> Cell:
        return Cell(value_words(self.figures.at_cursor(shown, 0)), role=self._role(shown))

    def at_b(self, shown: ShownCurve) -> Cell:
        return Cell(value_words(self.figures.at_cursor(shown, 1)), role=self._role(shown))

    def difference(self, shown: ShownCurve) -> Cell:
        figures = self.figures
        if figures.cursors is None:
            return Cell()
        if shown.curve.is_state and shown.curve.states is not None:
            begin_s, end_s = sorted(figures.cursors)
            if isinstance(shown.curve.last, bool):
                lasted = seconds_words(shown.curve.states.lasted_s("true", begin_s, end_s))
                words = _("true for {seconds}").format(seconds=lasted)
            else:
                count = shown.curve.states.changes(begin_s, end_s)
                words = ngettext("{count} change", "{count} changes", count).format(count=count)
            return Cell(words, role=self._role(shown), bold=True)
        first, second = figures.at_cursor(shown, 0), figures.at_cursor(shown, 1)
        if not (isinstance(first, float) and isinstance(second, float)):
            return Cell()
        return Cell(number_words(second - first), role=self._role(shown), bold=True)

    def figure(self, which: str) -> Callable[[ShownCurve], Cell]:
        def cell(shown: ShownCurve) -> Cell:
            found = None if shown.curve.is_state else getattr(self.figures.of(shown), which)
            return Cell("" if found is None else number_words(found), role=self._role(shown))

        return cell


def columns(
    figures: LegendFigures, has_cursors: Callable[[], bool], is_gone: Callable[[ShownCurve], bool]
) -> tuple[Column[ShownCurve], ...]:
    """Return the columns of the legend. Those for cursors A and B are hidden without cursors."""
    cells = _Cells(figures, is_gone)
    between = {"figures": True, "when": has_cursors}
    return (
        Column("eye", "", 34, cells.eye, words=lazy("Shown")),
        Column("stroke", "", 48, cells.stroke, words=lazy("Colour and axis")),
        Column("name", lazy("Curve"), 150, cells.name, stretch=True, tip=lambda shown: shown.name),
        Column("axis", lazy("Axis"), 84, cells.axis, yields=5),
        Column("last", lazy("Last"), 74, cells.last, figures=True),
        Column("a", "A", 70, cells.at_a, yields=2, **between),  # type: ignore[arg-type]
        Column("b", "B", 70, cells.at_b, yields=2, **between),  # type: ignore[arg-type]
        Column("difference", f"B {MINUS} A", 86, cells.difference, yields=1, **between),  # type: ignore[arg-type]
        Column("min", lazy("Min"), 70, cells.figure("least"), figures=True, yields=4),
        Column("max", lazy("Max"), 70, cells.figure("most"), figures=True, yields=4),
        Column("mean", lazy("Mean"), 70, cells.figure("mean"), figures=True, yields=3),
    )


class LegendTable(TableView[ShownCurve]):
    """Table of a plot's curves; `changed` is emitted when visibility, axis or style of a curve change."""

    changed = Signal()
    removed = Signal(str)
    chosen_copy = Signal(str)

    def __init__(self, theme: Theme, model: TableModel[ShownCurve]) -> None:
        super().__init__(theme, model)
        self.setAccessibleName(_("Curves and their values"))
        self.clicked.connect(self._press)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._show_menu)
        self.opened.connect(self._enter)

    def _press(self, index: QModelIndex) -> None:
        shown = self._model.row_at(index)
        column = self.columns[index.column()].name
        if shown is None:
            return
        if column == "eye":
            self.hide_or_show(shown)
        elif column == "stroke":
            self._popup(shown, self.visualRect(index).bottomLeft())

    def _enter(self, key: str) -> None:
        # Enter opens the menu; a click does so only on the sample of the line.
        if self.keyboard:
            index = self._model.index_of(key)
            shown = self._model.row_at(index)
            if shown is not None:
                self._popup(shown, self.visualRect(index).bottomLeft())

    def hide_or_show(self, shown: ShownCurve) -> None:
        """Toggle the visibility of a curve."""
        shown.hidden = not shown.hidden
        self.changed.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        shown = self._model.row_at(self.currentIndex())
        if shown is not None and event.key() in {Qt.Key.Key_Delete, Qt.Key.Key_Backspace}:
            self.removed.emit(shown.name)
        elif shown is not None and event.key() == Qt.Key.Key_H and not event.modifiers():
            self.hide_or_show(shown)
        elif event.text().isprintable() and event.text().strip() != "/" and event.text():
            event.ignore()  # handled by the plot panel
        else:
            super().keyPressEvent(event)

    def _show_menu(self, at: QPoint) -> None:
        index = self.indexAt(at)
        shown = self._model.row_at(index)
        if shown is not None:
            self._popup(shown, at)

    def _popup(self, shown: ShownCurve, at: QPoint) -> None:
        menu = self.menu_of(shown)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.viewport().mapToGlobal(at))

    def menu_of(self, shown: ShownCurve) -> Menu:
        """Return the context menu of a curve."""
        menu = Menu(self.theme, self)
        if not shown.curve.is_state:
            for right, words in ((False, _("Left axis")), (True, _("Right axis"))):
                action = menu.addAction(words)
                action.setCheckable(True)
                action.setChecked(shown.right is right)
                action.triggered.connect(lambda _on=False, right=right: self._put(shown, right=right))
            menu.addSeparator()
        for number, words in enumerate(COLOURS):
            action = menu.addAction(_(words))
            action.setCheckable(True)
            action.setChecked(shown.look.colour % len(COLOURS) == number)
            action.triggered.connect(lambda _on=False, number=number: self._colour(shown, number))
        menu.addSeparator()
        hide = menu.addAction(
            self.theme.icon("eye" if shown.hidden else "eye-off"), _("Show") if shown.hidden else _("Hide")
        )
        hide.triggered.connect(lambda: self.hide_or_show(shown))
        copy = menu.addAction(self.theme.icon("copy"), _("Copy name"))
        copy.triggered.connect(lambda: self.chosen_copy.emit(shown.name))
        remove = menu.addAction(self.theme.icon("trash-2"), _("Remove"))
        remove.triggered.connect(lambda: self.removed.emit(shown.name))
        return menu

    def _put(self, shown: ShownCurve, *, right: bool) -> None:
        shown.right = right
        self.changed.emit()

    def _colour(self, shown: ShownCurve, number: int) -> None:
        shown.look = CurveLook(number, shown.look.pattern)
        self.changed.emit()


def next_look(there: Sequence[ShownCurve]) -> CurveLook:
    """Return a style that no other curve has, or a repeated one if all are in use."""
    colours = [shown.look.colour % len(COLOURS) for shown in there]
    patterns = [shown.look.pattern % 4 for shown in there]
    colour = min(range(len(COLOURS)), key=lambda each: (colours.count(each), each))
    pattern = min(range(4), key=lambda each: (patterns.count(each), each))
    return CurveLook(colour, pattern)


def foot_words(curves: Curves, *, has_cursors: bool, distance: float | None) -> str:
    """Return the caption of the legend: range of the statistics, distance of A and B, missing data."""
    about = _("Min, max and mean between A and B")
    parts = [about if has_cursors else _("Min, max and mean of the visible range")]
    if distance is not None:
        parts.append(_("A to B: {distance}").format(distance=number_words(distance)))
    for count, words in (
        (curves.lost, ngettext("{count} message lost: a gap", "{count} messages lost: gaps", curves.lost)),
        (
            curves.unread,
            ngettext("{count} message can't be decoded", "{count} messages can't be decoded", curves.unread),
        ),
        (
            curves.undone,
            ngettext(
                "{count} point discarded: the clock was set back",
                "{count} points discarded: the clock was set back",
                curves.undone,
            ),
        ),
        (
            curves.forgotten,
            ngettext("{count} old point discarded", "{count} old points discarded", curves.forgotten),
        ),
    ):
        if count:
            parts.append(words.format(count=grouped(count)))
    return " · ".join(parts)
