"""Nodes panel: table of nodes with their topics, parameters and statistics.

`rows` has the columns and texts.
"""

from app.ui.panels.nodes.panel import PANEL as PANEL
