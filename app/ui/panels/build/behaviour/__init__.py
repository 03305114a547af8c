"""Behaviour panel: block editor, tabs and the generated program.

`panel` contains the panel; `tabs` and `tab` implement its title bar. `live_values` formats the values
on sensor blocks.
"""

from app.ui.panels.build.behaviour.panel import PANEL as PANEL
