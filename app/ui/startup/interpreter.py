"""Python's own settings that a window needs: how soon a thread has its turn, and when garbage is collected.

Painting a table gives Python up and wants it back hundreds of times. While a thread of ours receives 50 000
messages a second each of these could take 5 ms, Python's own measure, and a click waited for several.

A collection of everything takes 50 to 170 ms with what a window is made of, and many messages that come and
go call for one. So nothing is collected while Studio starts; what stands then is put aside from all later
collections, which have little left to look at.

Python collects in whichever thread makes one object too many. What a circle holds of Qt's (a timer, a model)
would be deleted there, while the window's thread may be using it, which ends Studio with a segmentation
fault; or in the middle of what Qt does with a widget. So only the window's thread collects, and only
between two events.
"""

from __future__ import annotations

import gc
import sys

from PySide6.QtCore import QObject, Qt, QTimer

SWITCH_INTERVAL_S = 0.0005
SETTLE_MS = 1000
COLLECT_MS = 250
NEW_OBJECTS, COLLECTIONS = 10_000, 20
"""Objects after which the young are collected, and collections after which the next older are, too."""


def shorten_switch_interval() -> None:
    """Let every thread have its turn soon; said again it does nothing."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def freeze_garbage() -> None:
    """Put everything that there is now aside: it is not looked at again. Takes a few microseconds."""
    gc.freeze()


def collect_garbage() -> None:
    """Collect here and now what Python would have collected by itself since the last time."""
    made, young, middle = gc.get_count()
    if made > NEW_OBJECTS:
        gc.collect(0 if young <= COLLECTIONS else 1 if middle <= COLLECTIONS else 2)


class GcTimer(QTimer):
    """`collect_garbage` four times a second from `start` on, in its own thread; no other collects."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        gc.disable()
        self.setTimerType(Qt.TimerType.CoarseTimer)  # the computer need not wake for it alone
        self.setInterval(COLLECT_MS)
        self.timeout.connect(collect_garbage)


class GcFreezeTimer(QTimer):
    """`freeze_garbage` a second after the last large thing was made; `start` it when one was."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.setSingleShot(True)
        self.setInterval(SETTLE_MS)
        self.timeout.connect(freeze_garbage)
