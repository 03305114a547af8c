"""Image: the pictures of one topic."""

from app.ui.panels.image.panel import PANEL as PANEL
