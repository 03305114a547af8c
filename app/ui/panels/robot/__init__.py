"""Robot panel: virtual robots in their room. They can be touched, moved and spoken to.

`room_view` is the interactive drawing, `say_bar` the speech field and the menu of simulated events.
"""

from app.ui.panels.robot.panel import PANEL as PANEL
