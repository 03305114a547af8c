"""Robots panel: actions of each robot as forms, to try them.

`list` has the robots, `action_card` the card of an action, with its `form` and latest `tries`.
"""

from app.ui.panels.robots.panel import PANEL as PANEL
