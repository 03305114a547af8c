"""Nodes panel: table of nodes with their topics, parameters and statistics.

`rows` contains the columns and the texts.
"""

from app.ui.panels.watch.nodes.panel import PANEL as PANEL
