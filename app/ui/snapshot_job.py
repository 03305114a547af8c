"""Saves and copies pictures in a thread of its own: a large one takes longer than a frame of the window."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QImage

from app.core import snapshots
from app.core.pictures import png_of
from app.ui.picture_file import image_of
from nep.errors import NepError

if TYPE_CHECKING:
    from nep.message import Message


class SnapshotJob(QObject):
    """One picture at a time; the signals come in the window's thread."""

    saved = Signal(str)  # the path of the file
    copied = Signal(QImage)
    failed = Signal(str)  # a sentence

    def __init__(self, parent: QObject, folder: Callable[[], Path] = snapshots.folder) -> None:
        """``folder`` is where files go."""
        super().__init__(parent)
        self._folder = folder
        self._thread: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether one is being made."""
        return self._thread is not None and self._thread.is_alive()

    def save(self, message: Message) -> None:
        """Save it as a PNG file; nothing while another one is being made."""
        self._start(lambda: self.saved.emit(str(snapshots.save(message, self._folder()))))

    def copy(self, message: Message) -> None:
        """Make an image of it, as large as it was received; nothing while another one is being made."""
        self._start(lambda: self.copied.emit(image_of(png_of(message))))

    def wait(self) -> None:
        """Until what was begun has ended, two seconds at most."""
        if self._thread is not None:
            self._thread.join(2.0)

    def _start(self, work: Callable[[], None]) -> None:
        if not self.busy:
            self._thread = threading.Thread(
                target=self._do, args=(work,), name="studio-snapshot", daemon=True
            )
            self._thread.start()

    def _do(self, work: Callable[[], None]) -> None:
        try:
            work()
        except NepError as error:
            self.failed.emit(str(error))
        except OSError as error:
            self.failed.emit(f"{self._folder()}: {(error.strerror or str(error)).lower()}")
