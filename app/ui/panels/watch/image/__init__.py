"""Image panel: images of one topic.

`app.ui.pictures` implements painting and zoom; this package contains the panel, its actions, overlays of
other topics, the bars for display style and clicks, and the PNG export.
"""

from app.ui.panels.watch.image.panel import PANEL as PANEL
