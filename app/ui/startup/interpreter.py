"""How long another thread may keep Python to itself while the window waits for its turn.

Painting a table gives Python up and wants it back hundreds of times. While a thread of ours receives 50 000
messages a second each of these could take 5 ms, Python's own measure, and a click waited for several.
"""

from __future__ import annotations

import sys

TURN_S = 0.0005


def shorten() -> None:
    """Let every thread have its turn soon; said again it does nothing."""
    sys.setswitchinterval(TURN_S)
