"""Robots panel: actions of each robot as forms that can be tried.

`list` has the robots, `action_card` an action with its `form` and latest `tries`.
"""

from app.ui.panels.robots.panel import PANEL as PANEL
