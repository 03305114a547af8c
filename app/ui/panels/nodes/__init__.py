"""Nodes: the programs that are there, with what they publish and subscribe."""

from app.ui.panels.nodes.panel import PANEL as PANEL
