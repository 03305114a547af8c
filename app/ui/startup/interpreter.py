"""Interpreter settings for a responsive window: thread switching and garbage collection.

Painting a table releases and reacquires the GIL hundreds of times. While another thread receives 50 000
messages per second, each reacquisition could take Python's default interval of 5 ms, and a click waited for
several.

A full collection takes 50 to 170 ms with the objects of a window, and many short-lived messages trigger one.
So nothing is collected while Studio starts; the objects that exist then are frozen, which leaves little for
later collections.

Python collects in whichever thread allocates one object too many. Qt objects in a cycle (a timer, a model)
would be deleted there while the window's thread may be using them, which crashes Studio; or in the middle of
Qt's own work with a widget. So only the window's thread collects, and only between two events.
"""

from __future__ import annotations

import gc
import sys

from PySide6.QtCore import QObject, Qt, QTimer

SWITCH_INTERVAL_S = 0.0005
SETTLE_MS = 1000
COLLECT_MS = 250
NEW_OBJECTS, COLLECTIONS = 10_000, 20
"""Number of new objects after which the youngest generation is collected, and of collections after which the
next older one is."""


def shorten_switch_interval() -> None:
    """Shorten the thread switch interval. Idempotent."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def freeze_garbage() -> None:
    """Exclude all existing objects from later collections. Takes a few microseconds."""
    gc.freeze()


def collect_garbage() -> None:
    """Collect what Python would have collected automatically since the last call."""
    new_objects, young, middle = gc.get_count()
    if new_objects > NEW_OBJECTS:
        gc.collect(0 if young <= COLLECTIONS else 1 if middle <= COLLECTIONS else 2)


class GcTimer(QTimer):
    """Calls `collect_garbage` four times a second in its own thread, from `start` on.

    Automatic collection is off.
    """

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        gc.disable()
        self.setTimerType(Qt.TimerType.CoarseTimer)  # it need not wake the computer
        self.setInterval(COLLECT_MS)
        self.timeout.connect(collect_garbage)


class GcFreezeTimer(QTimer):
    """Calls `freeze_garbage` one second after `start`; start it when many objects were created."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.setSingleShot(True)
        self.setInterval(SETTLE_MS)
        self.timeout.connect(freeze_garbage)
