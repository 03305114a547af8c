"""Interpreter settings that keep the window responsive: thread switching and garbage collection.

Painting a table releases and reacquires the GIL hundreds of times. While another thread receives 50 000
messages per second, each reacquisition could take Python's default switch interval of 5 ms, and a click
waited for several of them.

A full collection takes 50 to 170 ms with the objects of a window, and many short-lived messages trigger one.
Therefore nothing is collected during startup. The objects that exist afterwards are frozen, which leaves
little work for later collections.

Python runs a collection in the thread that exceeds the allocation threshold. Qt objects in a reference cycle
(a timer, a model) would be deleted there while the GUI thread may be using them, which crashes Studio, or in
the middle of Qt's own work with a widget. Therefore only the GUI thread collects, between two events.
"""

from __future__ import annotations

import gc
import sys

from PySide6.QtCore import QObject, Qt, QTimer

SWITCH_INTERVAL_S = 0.0005
SETTLE_MS = 1000
COLLECT_MS = 250
NEW_OBJECTS, COLLECTIONS = 10_000, 20
"""Thresholds: new objects for a collection of generation 0, and collections for one of the next older."""


def shorten_switch_interval() -> None:
    """Shorten the interpreter's thread switch interval. Idempotent."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def freeze_objects() -> None:
    """Exclude all existing objects from later collections. Takes a few microseconds."""
    gc.freeze()


def collect_garbage() -> None:
    """Run the collection that Python would have run automatically since the last call, if any."""
    new_objects, young, middle = gc.get_count()
    if new_objects > NEW_OBJECTS:
        gc.collect(0 if young <= COLLECTIONS else 1 if middle <= COLLECTIONS else 2)


class GcTimer(QTimer):
    """Calls `collect_garbage` four times a second in its own thread after `start`.

    Automatic collection is disabled.
    """

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        gc.disable()
        self.setTimerType(Qt.TimerType.CoarseTimer)  # precise wake-ups of the computer are not needed
        self.setInterval(COLLECT_MS)
        self.timeout.connect(collect_garbage)


class GcFreezeTimer(QTimer):
    """Calls `freeze_garbage` one second after `start`. Start the timer after many objects were created."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.setSingleShot(True)
        self.setInterval(SETTLE_MS)
        self.timeout.connect(freeze_objects)
