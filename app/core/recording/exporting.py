"""An export that goes on beside the window, tells how far it is, and can be cancelled."""

from __future__ import annotations

import threading
from pathlib import Path

from app.core.recording.opener import LocalOpener, RecordingOpener
from nep.errors import NepError
from nep.i18n import _, ngettext
from nep.recordings.export import ALL_OF_IT, Exported, Part, export
from nep.recordings.formats.damage import damage_words


class _CancelledError(Exception):
    """A person gave it up."""


class RecordingExport:
    """One export, in a thread of its own. All that is here may be asked from any thread."""

    def __init__(
        self,
        recording: Path,
        kind: str,
        folder: Path,
        part: Part = ALL_OF_IT,
        opener: RecordingOpener | None = None,
    ) -> None:
        """Begin; ``kind`` is one of `nep.recordings.export.FORMATS`, the folder is made.

        ``opener`` is closed at the end.
        """
        self._opener: RecordingOpener = LocalOpener() if opener is None else opener
        self.damage = ""
        """What of the recording could not be read, in words; "" for nothing."""
        self._part = part
        self.folder = folder
        self.files: tuple[Exported, ...] = ()
        self.problem = ""
        """Why it failed, in words; "" when it did not."""
        self._recording, self._kind = recording, kind
        self._progress = (0, 0)
        self._is_cancelled = threading.Event()
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording-export", daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """Whether it is finished, has failed, or was cancelled."""
        return self._is_over.is_set()

    @property
    def was_cancelled(self) -> bool:
        """Whether a person gave it up."""
        return self._is_cancelled.is_set()

    @property
    def share(self) -> float | None:
        """How far it is, 0 to 1; None while that is not known."""
        done, total = self._progress
        return done / total if total else None

    def cancel(self) -> None:
        """Give it up: a file that is not whole is removed, those before it stay."""
        self._is_cancelled.set()

    def close(self, wait_s: float = 2.0) -> None:
        """Give it up and wait so long for its end."""
        self.cancel()
        self._thread.join(wait_s)
        self._opener.close()

    def words(self) -> str:
        """What came of it, in a sentence without a full stop; "" while it goes on."""
        if not self.is_over:
            return ""
        if self.was_cancelled and not self.files:
            return _("The export was cancelled")
        if self.problem:
            return _("Not exported: {reason}").format(reason=self.problem)
        count = len(self.files)
        said = ngettext("Exported {count} file", "Exported {count} files", count).format(count=count)
        return said if not self.damage else f"{said}; {self.damage}"

    def _run(self) -> None:
        try:
            with self._opener.open(self._recording) as recording:
                made = export(recording, self._kind, self.folder, self._part, progress=self._tell)
                self.damage = damage_words(recording.damage, recording.start_ns)
            self.files = tuple(made)
        except _CancelledError:
            pass
        except (NepError, OSError, MemoryError) as error:
            self.problem = str(error) or type(error).__name__
        finally:
            self._opener.close()
            self._is_over.set()

    def _tell(self, done: int, total: int) -> None:
        self._progress = (done, total)
        if self._is_cancelled.is_set():
            raise _CancelledError
