"""Timeline panel: contents of an open recording, and controls of its replay.

`transport` is the row of controls, `canvas` has the ruler and lanes.
"""

from __future__ import annotations

from app.ui.panels.base import Panel
from app.ui.panels.timeline.panel import TimelinePanel
from nep.i18n import lazy

PANEL = Panel("timeline", lazy("Timeline"), "film", (), TimelinePanel)
