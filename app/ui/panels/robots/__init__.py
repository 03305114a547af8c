"""Robots: what each robot can do, as forms that can be tried at once.

`list` has the robots, `action_card` one action with its `form` and its last `tries`.
"""

from app.ui.panels.robots.panel import PANEL as PANEL
