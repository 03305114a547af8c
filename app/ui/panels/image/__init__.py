"""Image panel: images of one topic.

Painting and zoom are implemented in `app.ui.pictures`; this package has the panel, its menu and the PNG
export.
"""

from app.ui.panels.image.panel import PANEL as PANEL
