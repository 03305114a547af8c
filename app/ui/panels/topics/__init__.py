"""Topics panel: all topics of the network with their figures.

`columns` has the columns and cells.
"""

from app.ui.panels.topics.panel import PANEL as PANEL
