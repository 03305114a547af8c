"""Interpreter settings that keep the window responsive: thread switching and garbage collection.

Painting a table releases and reacquires the GIL hundreds of times. With Python's default switch
interval, each reacquisition can take 5 ms while another thread receives 50 000 messages per second,
which delays the response to a click.

A full collection takes 50 to 170 ms with the objects of a window, and is triggered often by many
short-lived messages. Therefore nothing is collected during startup, and the objects that exist
afterwards are frozen, which shortens later collections.

Python runs a collection in the thread that exceeds the allocation threshold. Qt objects in a reference
cycle, such as a timer or a model, would be deleted in that thread, while the main thread may be using
them, or in the middle of Qt's own work. Either can crash Studio. Therefore only the main thread
collects, between two events.
"""

from __future__ import annotations

import gc
import sys

from PySide6.QtCore import QObject, Qt, QTimer

SWITCH_INTERVAL_S = 0.0005
FREEZE_DELAY_MS = 1000
COLLECT_INTERVAL_MS = 250
NEW_OBJECTS_THRESHOLD, COLLECTIONS_THRESHOLD = 10_000, 20
"""Thresholds as in `gc.set_threshold`.

These are the number of new objects for a collection of generation 0, and the number of collections for a
collection of the next older generation.
"""


def shorten_switch_interval() -> None:
    """Set a short thread switch interval. Idempotent."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def freeze_objects() -> None:
    """Exclude all existing objects from later collections. Takes a few microseconds."""
    gc.freeze()


def collect_garbage() -> None:
    """Run the collection that the thresholds require, if any, as Python's automatic collection would."""
    new_objects, young, middle = gc.get_count()
    if new_objects > NEW_OBJECTS_THRESHOLD:
        gc.collect(0 if young <= COLLECTIONS_THRESHOLD else 1 if middle <= COLLECTIONS_THRESHOLD else 2)


class GcTimer(QTimer):
    """Timer that calls `collect_garbage` four times a second and replaces the automatic collection.

    Creating the timer disables the automatic collection; collections run in the timer's thread after
    `start`.
    """

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        gc.disable()
        self.setTimerType(Qt.TimerType.CoarseTimer)  # precise wake-ups of the computer are not needed
        self.setInterval(COLLECT_INTERVAL_MS)
        self.timeout.connect(collect_garbage)


class GcFreezeTimer(QTimer):
    """Single-shot timer that calls `freeze_objects` one second after `start`.

    Start the timer after many long-lived objects were created.
    """

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.setSingleShot(True)
        self.setInterval(FREEZE_DELAY_MS)
        self.timeout.connect(freeze_objects)
