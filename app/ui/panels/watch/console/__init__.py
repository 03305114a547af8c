"""Console panel: log records of Studio, programs and robots.

The records are stored in `app.core.world.console`; `list` filters and paints them.
"""

from app.ui.panels.watch.console.panel import PANEL as PANEL
