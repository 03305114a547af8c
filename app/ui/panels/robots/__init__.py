"""Robots: what each robot can do, as forms that can be tried at once."""

from app.ui.panels.robots.panel import PANEL as PANEL
