"""Plot panel: numbers and states over time, formulas of fields, and curves against each other.

`canvas` draws curves, `lanes` draws states, `legend` contains the table below the plot and `tools` the
toolbar. The package is imported when the first plot opens, because importing pyqtgraph and numpy takes
200 ms.
"""

from __future__ import annotations

from app.ui.intents import PlotField
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.command import IntentHandler
from app.ui.panels.home import TabHome
from nep.i18n import lazy


def _make_panel(context: PanelContext) -> PanelWidget:
    from app.ui.panels.watch.plot.panel import PlotPanel  # noqa: PLC0415  imports pyqtgraph and numpy

    return PlotPanel(context)


PANEL = Panel(
    "plot",
    lazy("Plot"),
    "chart-line",
    (),
    _make_panel,
    allows_multiple=True,
    home=(TabHome("developer", "topics"), TabHome("behaviour", "behaviour")),
    intents=(IntentHandler(PlotField, lambda panel, intent: panel.plot_field(intent.topic, intent.path)),),
)
