"""Console: what happened, line by line."""

from app.ui.panels.console.panel import PANEL as PANEL
