"""First steps panel: six steps, each checked off when blocks and run show that it is done."""

from app.ui.panels.first_steps.panel import PANEL as PANEL
