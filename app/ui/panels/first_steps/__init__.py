"""First steps: six things to do, each checked as soon as the blocks and the run show it."""

from app.ui.panels.first_steps.panel import PANEL as PANEL
