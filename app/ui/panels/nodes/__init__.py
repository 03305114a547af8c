"""Nodes panel: nodes with their topics, parameters and figures.

`rows` has the columns and texts.
"""

from app.ui.panels.nodes.panel import PANEL as PANEL
