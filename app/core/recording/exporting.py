"""Export of a recording in the background, with progress and cancellation."""

from __future__ import annotations

import threading
from pathlib import Path

from app.core.recording.opener import LocalOpener, RecordingOpener
from nep.errors import NepError
from nep.i18n import _, ngettext
from nep.recordings.export import FULL_RECORDING, ExportedFile, Part, export
from nep.recordings.formats.damage import corruption_text


class _CancelledError(Exception):
    """Raised in the export thread when the user cancels the export."""


class RecordingExport:
    """Export that runs in a background thread. Thread-safe."""

    def __init__(
        self,
        recording: Path,
        kind: str,
        folder: Path,
        part: Part = FULL_RECORDING,
        opener: RecordingOpener | None = None,
    ) -> None:
        # `kind` is one of `nep.recordings.export.FORMATS`; the folder is created. `opener` is closed at the
        # end.
        self._opener: RecordingOpener = LocalOpener() if opener is None else opener
        self.damage = ""
        """Description of parts of the recording that can't be read, or ""."""
        self._part = part
        self.folder = folder
        self.files: tuple[ExportedFile, ...] = ()
        self.problem = ""
        """Reason why the export failed, or ""."""
        self._recording, self._kind = recording, kind
        self._progress = (0, 0)
        self._is_cancelled = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording-export", daemon=True)
        self._thread.start()

    @property
    def is_finished(self) -> bool:
        """True if the export has finished, failed, or was cancelled."""
        return self._ended.is_set()

    @property
    def was_cancelled(self) -> bool:
        """True if the user cancelled the export."""
        return self._is_cancelled.is_set()

    @property
    def progress(self) -> float | None:
        """Progress from 0 to 1; None if unknown."""
        done, total = self._progress
        return done / total if total else None

    def cancel(self) -> None:
        """Cancel the export. The incomplete file is deleted; completed files remain."""
        self._is_cancelled.set()

    def close(self, wait_s: float = 2.0) -> None:
        """Cancel the export and wait at most ``wait_s`` seconds until the thread has stopped."""
        self.cancel()
        self._thread.join(wait_s)
        self._opener.close()

    def result_text(self) -> str:
        """Return the result as a sentence without a full stop; "" while the export is in progress."""
        if not self.is_finished:
            return ""
        if self.was_cancelled and not self.files:
            return _("The export was cancelled")
        if self.problem:
            return _("Not exported: {reason}").format(reason=self.problem)
        count = len(self.files)
        text = ngettext("Exported {count} file", "Exported {count} files", count).format(count=count)
        return text if not self.damage else f"{text}; {self.damage}"

    def _run(self) -> None:
        try:
            with self._opener.open(self._recording) as recording:
                files = export(recording, self._kind, self.folder, self._part, progress=self._report_progress)
                self.damage = corruption_text(recording.corruption, recording.start_ns)
            self.files = tuple(files)
        except _CancelledError:
            pass
        except (NepError, OSError, MemoryError) as error:
            self.problem = str(error) or type(error).__name__
        finally:
            self._opener.close()
            self._ended.set()

    def _report_progress(self, done: int, total: int) -> None:
        self._progress = (done, total)
        if self._is_cancelled.is_set():
            raise _CancelledError
