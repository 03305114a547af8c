"""`SplitFiles`: destination that splits a recording into files of limited size, each of them complete."""

from __future__ import annotations

from pathlib import Path

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.formats.destination import DEFAULT_LIMITS, SingleFile, WriterLimits, disk_error
from nep.recordings.formats.mcap_file import ChannelTable, FileWriter

MIN_PART_BYTES = 100_000


def part_path(path: Path, number: int) -> Path:
    """Return the path of a numbered part, such as "tour-001.mcap" for part 1 of "tour.mcap"."""
    return path.with_name(f"{path.stem}-{number:03d}{path.suffix}")


class SplitFiles:
    """Destination that starts a new file at a given size.

    A file ends with the chunk that reaches the size, so it may be larger by one chunk: 1 MB, or one
    message.

    Args:
        path: Path from which the names of the files are derived, see `part_path`.
        part_bytes: Size in bytes at which a new file starts.
        limits: Limits of the writer.
    """

    def __init__(self, path: Path, part_bytes: int, limits: WriterLimits = DEFAULT_LIMITS) -> None:
        """Create the first file. Raises `RecordingError`."""
        self._path, self._part_bytes, self._limits = path, part_bytes, limits
        self._table = ChannelTable()
        self.paths: list[Path] = []
        """Files created so far."""
        self._part = self._new_file()

    def _new_file(self) -> SingleFile:
        path = part_path(self._path, len(self.paths) + 1)
        try:
            file = FileWriter(path, self._table)
        except FileExistsError:
            raise RecordingError(str(path), _("the file already exists; choose another name")) from None
        except OSError as error:
            raise disk_error(path, error) from error
        self.paths.append(path)
        return SingleFile(file, self._limits.min_free_bytes)

    @property
    def file(self) -> FileWriter:
        """File to which messages are currently written."""
        return self._part.file

    @property
    def is_full(self) -> bool:
        """True if the current file has reached its maximum size."""
        return self.file.size_bytes >= self._part_bytes

    def on_flushed(self) -> None:
        """Do nothing, because `is_full` starts the next file."""

    def next_file(self) -> None:
        """Open the next file and finish the current one. Raises `RecordingError` or `OSError`."""
        full_part = self._part
        self._part = self._new_file()
        full_part.finish()

    def check_file(self) -> None:
        """Raise `RecordingError` if the current file no longer exists or the disk is full."""
        self._part.check_file()

    def finish(self) -> None:
        """Finish the last file. Raises `OSError`."""
        self._part.finish()

    def abort(self) -> None:
        """Close the last file without a summary."""
        self._part.abort()
