"""Topics: everything that is on the network, with its figures.

`columns` has its columns, cells and words.
"""

from app.ui.panels.topics.panel import PANEL as PANEL
