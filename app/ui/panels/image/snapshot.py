"""Saves and copies pictures in a thread of its own: a large one takes longer than a frame of the window."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QImage

from app.core.messages import snapshots
from app.core.messages.picture import png_of
from nep.errors import NepError
from nep.i18n import _

if TYPE_CHECKING:
    from nep.messages.message import Message

LOOK_MS = 30
Made = Path | QImage | str
"""The file that was saved, the image that was made, or the sentence that says why not."""


class SnapshotJob(QObject):
    """One picture at a time. Its thread touches nothing of Qt but images; the window's thread tells."""

    saved = Signal(str)  # the path of the file
    copied = Signal(QImage)
    failed = Signal(str)  # a sentence

    def __init__(self, parent: QObject, folder: Callable[[], Path] = snapshots.folder) -> None:
        """``folder`` is where files go."""
        super().__init__(parent)
        self._folder = folder
        self._thread: threading.Thread | None = None
        self._made: queue.SimpleQueue[Made] = queue.SimpleQueue()
        self._timer = QTimer(self)
        self._timer.setInterval(LOOK_MS)
        self._timer.timeout.connect(self._tell)

    @property
    def busy(self) -> bool:
        """Whether one is being made, or not told yet."""
        return self._thread is not None

    def save(self, message: Message) -> None:
        """Save it as a PNG file; nothing while another one is being made."""
        folder = self._folder()
        self._start(lambda: snapshots.save(message, folder))

    def copy(self, message: Message) -> None:
        """Make an image of it, as large as it was received; nothing while another one is being made."""
        self._start(lambda: QImage.fromData(png_of(message)))

    def wait(self) -> None:
        """The window closes: until what was begun has ended, two seconds at most; nothing is told then."""
        self._timer.stop()
        if self._thread is not None:
            self._thread.join(2.0)

    def _start(self, work: Callable[[], Made]) -> None:
        if not self.busy:
            self._thread = threading.Thread(
                target=self._do, args=(work,), name="studio-snapshot", daemon=True
            )
            self._thread.start()
            self._timer.start()

    def _do(self, work: Callable[[], Made]) -> None:
        """In the thread: make it; whatever goes wrong is a sentence."""
        try:
            made: Made = work()
        except NepError as error:
            made = str(error)
        except OSError as error:
            what = error.filename or _("image")
            made = f"{what}: {(error.strerror or str(error)).lower()}"
        except Exception as error:  # noqa: BLE001  a job that ends without a word would be busy for ever
            made = f"{type(error).__name__}: {error}"
        self._made.put(made)

    def _tell(self) -> None:
        try:
            made = self._made.get_nowait()
        except queue.Empty:
            return
        self._timer.stop()
        self._thread = None
        if isinstance(made, Path):
            self.saved.emit(str(made))
        elif isinstance(made, QImage):
            self.copied.emit(made)
        else:
            self.failed.emit(made)
