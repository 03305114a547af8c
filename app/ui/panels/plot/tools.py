"""The row above the curves: adding one, how much time, A and B, states, one over another, export."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from app.ui.panels.plot.add_curve import AddCurve
from app.ui.panels.plot.time_view import SPANS
from app.ui.theme.theme import Theme
from app.ui.widgets import MenuButton, Segments, ToggleButton
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.paint import show_when
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.session import Session

SPAN_WORDS = {"12": lazy("12 s"), "60": lazy("1 min"), "300": lazy("5 min"), "all": lazy("All")}


class PlotTools(QWidget):
    """The row; in narrow places it becomes several."""

    def __init__(self, theme: Theme, session: Session, plotted: Callable[[], Iterable[str]]) -> None:
        """``plotted`` tells the curves that there are."""
        super().__init__()
        self.add = AddCurve(theme, session, plotted)
        self.span = Segments(
            theme,
            [(value, _(SPAN_WORDS[value]), None) for value, _s in SPANS],
            "60",
            size="small",
            name=_("How much time is shown"),
        )
        self.cursors = ToggleButton(theme, _("A and B"), "ruler")
        self.states = ToggleButton(theme, _("States"), "rows-3")
        self.states.setChecked(True)
        self.across = ToggleButton(theme, _("X and Y"), "chart-spline")
        self.across.setToolTip(_("Draw the second curve over the first"))
        self.across.setProperty("tip", True)
        self.export = MenuButton(theme, _("Export"), "download", size="small")
        row = Flow(self, gap=8, row_gap=6)
        row.setContentsMargins(10, 6, 10, 6)
        row.add_elastic(self.add, greedy=True)
        row.push()
        self._when_there = (self.span, self.cursors, self.states, self.across, self.export)
        for widget in self._when_there:
            row.addWidget(widget)

    def fit(self, curves: int, numbers: int) -> None:
        """Show what makes sense for so many curves, of which so many are of numbers."""
        for widget in self._when_there:
            show_when(widget, curves > 0)
        show_when(self.states, curves > numbers)
        show_when(self.across, numbers > 1)
