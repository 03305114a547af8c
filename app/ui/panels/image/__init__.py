"""Image: the pictures of one topic.

What paints and zooms is in `app.ui.pictures`; here are the panel, its menu and its PNG files.
"""

from app.ui.panels.image.panel import PANEL as PANEL
