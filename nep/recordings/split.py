"""A recording in several files, none much larger than asked, each complete in itself."""

from __future__ import annotations

from pathlib import Path

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.formats.destination import USUAL_LIMITS, OneFile, WriterLimits, disk_sentence
from nep.recordings.formats.mcap_file import ChannelTable, FileWriter

__all__ = ["MIN_PART_BYTES", "SplitFiles", "part_path"]

MIN_PART_BYTES = 100_000


def part_path(path: Path, number: int) -> Path:
    """The name of a file of a recording that is split: "tour.mcap" gives "tour-001.mcap"."""
    return path.with_name(f"{path.stem}-{number:03d}{path.suffix}")


class SplitFiles:
    """A `nep.recordings.writer.Destination`: the next file begins when one has so many bytes.

    A file is full when the chunk is written with which it reaches its size, so it may be larger by a chunk:
    1 MB, or one message.
    """

    def __init__(self, path: Path, part_bytes: int, limits: WriterLimits = USUAL_LIMITS) -> None:
        """Make the first file. Raises `RecordingError`."""
        self._path, self._part_bytes, self._limits = path, part_bytes, limits
        self._table = ChannelTable()
        self.paths: list[Path] = []
        """The files so far."""
        self._part = self._new()

    def _new(self) -> OneFile:
        path = part_path(self._path, len(self.paths) + 1)
        try:
            file = FileWriter(path, self._table)
        except FileExistsError:
            raise RecordingError(str(path), _("there is such a file already; choose another name")) from None
        except OSError as error:
            raise disk_sentence(path, error) from error
        self.paths.append(path)
        return OneFile(file, self._limits.least_free_bytes)

    @property
    def file(self) -> FileWriter:
        """See `Destination`."""
        return self._part.file

    @property
    def is_full(self) -> bool:
        """See `Destination`."""
        return self.file.size_bytes >= self._part_bytes

    def flushed(self) -> None:
        """There is nothing to do."""

    def next_file(self) -> None:
        """See `Destination`."""
        full = self._part
        self._part = self._new()
        full.finish()

    def look(self) -> None:
        """See `Destination`."""
        self._part.look()

    def finish(self) -> None:
        """See `Destination`."""
        self._part.finish()

    def fail(self) -> None:
        """See `Destination`."""
        self._part.fail()
