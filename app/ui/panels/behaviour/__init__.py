"""Behaviour: the block editor, its tabs, and the program that its blocks make.

`panel` is the whole, `tabs` and `tab` its head, `live_values` what sensors' blocks show.
"""

from app.ui.panels.behaviour.panel import PANEL as PANEL
