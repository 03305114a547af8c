"""Python's own settings that a window needs: how soon a thread has its turn, and when garbage is collected.

Painting a table gives Python up and wants it back hundreds of times. While a thread of ours receives 50 000
messages a second each of these could take 5 ms, Python's own measure, and a click waited for several.

A collection of everything takes 50 to 170 ms with what a window is made of, and many messages that come and
go call for one. So nothing is collected while Studio starts; what stands then is put aside from all later
collections, which have little left to look at.
"""

from __future__ import annotations

import gc
import sys

from PySide6.QtCore import QObject, QTimer

SWITCH_INTERVAL_S = 0.0005
SETTLE_MS = 1000
NEW_OBJECTS = 10_000


def shorten_switch_interval() -> None:
    """Let every thread have its turn soon; said again it does nothing."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def freeze_garbage() -> None:
    """Put everything that there is now aside: it is not looked at again. Takes a few microseconds."""
    gc.freeze()
    gc.set_threshold(NEW_OBJECTS, 20, 20)
    gc.enable()


class GcFreezeTimer(QTimer):
    """`freeze_garbage` a second after the last large thing was made; `start` it when one was."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.setSingleShot(True)
        self.setInterval(SETTLE_MS)
        self.timeout.connect(freeze_garbage)
