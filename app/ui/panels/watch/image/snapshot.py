"""Saving and copying of images in a background thread, because a large image takes longer than a frame."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QImage

from app.core.messages import snapshots
from app.core.messages.picture import encode_png
from app.core.storage.folders import default_pictures_folder
from nep.errors import NepError
from nep.i18n import _

if TYPE_CHECKING:
    from nep.messages.message import Message

POLL_MS = 30
JobResult = Path | QImage | str
"""Result of a job: path of the saved file, image for the clipboard, or error message."""


class SnapshotJob(QObject):
    """Background job that saves or copies one image at a time.

    The result is emitted on the main thread. QImage is the only Qt class used in the background thread.

    Args:
        folder: Returns the folder for saved images.

    Signals:
        saved: Path of the saved file.
        copied: Image for the clipboard.
        failed: Error message.
    """

    saved = Signal(str)  # path of the file
    copied = Signal(QImage)
    failed = Signal(str)  # error message

    def __init__(self, parent: QObject, folder: Callable[[], Path] = default_pictures_folder) -> None:
        super().__init__(parent)
        self._folder = folder
        self._thread: threading.Thread | None = None
        self._results: queue.SimpleQueue[JobResult] = queue.SimpleQueue()
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._report)

    @property
    def is_busy(self) -> bool:
        """True while a job is running or its result has not been emitted."""
        return self._thread is not None

    def save(self, message: Message) -> None:
        """Save the image of a message as PNG; ignored while `is_busy`."""
        folder = self._folder()
        self._start(lambda: snapshots.save(message, folder))

    def copy(self, message: Message) -> None:
        """Emit the image of a message at its original size as `copied`; ignored while `is_busy`."""
        self._start(lambda: QImage.fromData(encode_png(message)))

    def wait(self) -> None:
        """Wait up to 2 s for the thread and discard its result; called before the image stream is closed."""
        self._timer.stop()
        thread, self._thread = self._thread, None
        self._results = queue.SimpleQueue()  # the thread may outlive the wait and report to the old queue
        if thread is not None:
            thread.join(2.0)

    def _start(self, job: Callable[[], JobResult]) -> None:
        if not self.is_busy:
            self._thread = threading.Thread(
                target=self._run, args=(job, self._results), name="studio-snapshot", daemon=True
            )
            self._thread.start()
            self._timer.start()

    def _run(self, job: Callable[[], JobResult], results: queue.SimpleQueue[JobResult]) -> None:
        # Runs in the background thread. An exception is returned as an error message.
        try:
            result: JobResult = job()
        except NepError as error:
            result = str(error)
        except OSError as error:
            file_name = error.filename or _("image")
            result = f"{file_name}: {(error.strerror or str(error)).lower()}"
        except Exception as error:  # noqa: BLE001  otherwise the job would stay busy forever
            result = f"{type(error).__name__}: {error}"
        results.put(result)

    def _report(self) -> None:
        try:
            result = self._results.get_nowait()
        except queue.Empty:
            return
        self._timer.stop()
        self._thread = None
        if isinstance(result, Path):
            self.saved.emit(str(result))
        elif isinstance(result, QImage):
            self.copied.emit(result)
        else:
            self.failed.emit(result)
