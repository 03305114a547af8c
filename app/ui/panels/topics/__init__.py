"""Topics: everything that is on the network, with its figures."""

from app.ui.panels.topics.panel import PANEL as PANEL
