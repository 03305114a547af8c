"""Python's collection of garbage, so that it does not stop the window.

A collection of everything takes 50 to 170 ms with what a window is made of, and many messages that come and
go call for one. So nothing is collected while Studio starts; what stands then is put aside from all later
collections, which have little left to look at.
"""

from __future__ import annotations

import gc

from PySide6.QtCore import QObject, QTimer

SETTLE_MS = 1000
NEW_OBJECTS = 10_000


def settle() -> None:
    """Put everything that there is now aside: it is not looked at again. Takes a few microseconds."""
    gc.freeze()
    gc.set_threshold(NEW_OBJECTS, 20, 20)
    gc.enable()


class Settling(QTimer):
    """`settle` a second after the last large thing was made; `start` it when one was."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.setSingleShot(True)
        self.setInterval(SETTLE_MS)
        self.timeout.connect(settle)
