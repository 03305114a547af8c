"""Robot: the virtual robots in their room, to be touched, moved and spoken to.

`room_view` is the drawing under the mouse, `say_bar` what a person says or lets happen.
"""

from app.ui.panels.robot.panel import PANEL as PANEL
