"""Robots panel: forms for trying the actions of each robot.

`list` contains the list of robots, `action_card` the card of an action, `form` its form, and `invocations`
the list of its latest tries.
"""

from app.ui.panels.robots.robots.panel import PANEL as PANEL
