"""Robot panel: virtual robots in their room, which can be touched, moved and spoken to.

`room_view` contains the interactive drawing, `say_bar` the field for speech and the menu of simulated
events.
"""

from app.ui.panels.robots.robot.panel import PANEL as PANEL
