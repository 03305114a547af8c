"""First steps panel: a tutorial of six steps, which are checked off by observing blocks and runs."""

from app.ui.panels.first_steps.panel import PANEL as PANEL
