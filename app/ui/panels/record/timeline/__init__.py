"""Timeline panel: contents of the open recording, and controls for its replay.

`transport` contains the row of controls, `lanes` the contents of the widget in `app.ui.timeline`.
"""

from __future__ import annotations

from app.ui.panels.base import Panel
from app.ui.panels.home import BottomHome
from app.ui.panels.record.timeline.panel import TimelinePanel
from nep.i18n import lazy

PANEL = Panel(
    "timeline",
    lazy("Timeline"),
    "film",
    (),
    TimelinePanel,
    home=(BottomHome("developer", 324), BottomHome("behaviour", 324)),
)
