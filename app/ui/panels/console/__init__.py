"""Console: what happened, line by line.

The records are `app.core.console`; `list` paints them and says which are wanted.
"""

from app.ui.panels.console.panel import PANEL as PANEL
