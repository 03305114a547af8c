"""Nodes: the programs that are there, with what they publish and subscribe.

`rows` has its columns and words.
"""

from app.ui.panels.nodes.panel import PANEL as PANEL
