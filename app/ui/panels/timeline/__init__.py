"""Timeline: where in an open recording one is, what is in it, and how it is played.

`transport` is the row with the buttons, `canvas` the ruler and the lanes.
"""

from __future__ import annotations

from app.ui.panels.base import Panel
from app.ui.panels.timeline.panel import TimelinePanel
from nep.i18n import lazy

PANEL = Panel("timeline", lazy("Timeline"), "film", (), TimelinePanel)
