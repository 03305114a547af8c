"""Line above the legend that explains why curves have no data."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.core.series.curves import Curves, topics_of
from app.ui.panels.watch.plot.plotted_curve import PlotCurve
from app.ui.theme.theme import Theme
from app.ui.widgets import label
from app.ui.widgets.buttons import LinkButton
from app.ui.widgets.paint import show_when
from nep.i18n import _


class PlotAdvice(QWidget):
    """Line with a hint, hidden while there is nothing to explain.

    Args:
        on_click: Opens the connection doctor for a topic.
    """

    def __init__(self, theme: Theme, on_click: Callable[[str], object]) -> None:
        super().__init__()
        self.topic = ""
        """Topic without data, or ""."""
        self._label = label("", "small", role="warn", wrap=True)
        self._label.setMinimumWidth(0)
        self.doctor_link = LinkButton(theme, _("Why is nothing shown?"))
        self.doctor_link.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.doctor_link.clicked.connect(lambda: on_click(self.topic))
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 2, 12, 2)
        row.setSpacing(8)
        row.addWidget(self._label, 1)
        row.addWidget(self.doctor_link, 0, Qt.AlignmentFlag.AlignTop)

    def text(self) -> str:
        """Return the text of the hint, or ""."""
        return self._label.text()

    def show_for(self, curves: Curves, plot_curves: Sequence[PlotCurve]) -> None:
        """Show the hint that applies to some curves, or hide the line.

        Args:
            curves: All curves of the plot.
            plot_curves: The same curves with their display settings.
        """
        message = next(filter(None, (curves.no_values_reason(each.curve) for each in plot_curves)), "")
        empty = [each for each in plot_curves if not message and not _has_data(each)]
        topics = (
            sorted(topics_of(empty[0].curve.source)) if plot_curves and len(empty) == len(plot_curves) else []
        )
        self.topic = topics[0] if topics else ""
        if self.topic:
            message = _("No values that can be plotted yet.")
        self._label.setText(message)
        show_when(self.doctor_link, bool(self.topic))
        show_when(self, bool(message))


def _has_data(plot_curve: PlotCurve) -> bool:
    curve = plot_curve.curve
    return bool(len(curve.samples) or (curve.states is not None and len(curve.states)))
