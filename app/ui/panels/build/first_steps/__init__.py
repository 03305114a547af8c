"""First steps panel: tutorial of six steps. Completed steps are detected from the blocks and the runs."""

from app.ui.panels.build.first_steps.panel import PANEL as PANEL
