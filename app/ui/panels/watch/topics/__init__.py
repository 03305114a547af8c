"""Topics panel: all topics of the network with their rates, bandwidths and losses.

`columns` contains the columns and their cells.
"""

from app.ui.panels.watch.topics.panel import PANEL as PANEL
