"""Topics panel: all topics of the network with their rates, bandwidths and losses.

`columns` has the columns and cells.
"""

from app.ui.panels.topics.panel import PANEL as PANEL
