"""Plot: numbers and states of messages over their own time; what is calculated from them; one over another.

`canvas` draws the curves, `lanes` the states, `legend` is the table below, `tools` the row above.
Nothing but this is loaded before somebody opens a plot: pyqtgraph and numpy take a fifth of a second.
"""

from __future__ import annotations

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from nep.i18n import lazy


def _make(context: PanelContext) -> PanelWidget:
    from app.ui.panels.plot.panel import PlotPanel  # noqa: PLC0415  loads pyqtgraph and numpy

    return PlotPanel(context)


PANEL = Panel("plot", lazy("Plot"), "chart-line", (), _make, several=True)
