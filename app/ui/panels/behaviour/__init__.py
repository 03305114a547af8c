"""Behaviour panel: block editor, tabs and the generated program.

`panel` has the panel, `tabs` and `tab` its title bar, `live_values` the values on sensor blocks.
"""

from app.ui.panels.behaviour.panel import PANEL as PANEL
