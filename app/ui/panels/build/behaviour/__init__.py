"""Behaviour panel: block editor, tabs and the generated program.

`panel` contains the panel, `commands` what it contributes to the window, and `tabs` and `tab` its title
bar. `live_values` formats the values on sensor blocks.
"""

from app.ui.panels.build.behaviour.commands import PANEL as PANEL
