"""Recordings in a folder. Their contents are read in a background thread."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from app.core.messages.picture import Picture, Size, decode
from app.core.recording.opener import LocalOpener, RecordingOpener
from app.core.storage.background_worker import BackgroundWorker
from nep.errors import NepError, RecordingTooLargeError
from nep.i18n import _
from nep.messages.codecs import content_of
from nep.recordings.reader import Recording

SUFFIX = ".mcap"
MAX_FILES = 2_000
MAX_READS_PER_SCAN = 50
"""Number of files after which a partial result is reported."""
MAX_SCAN_S = 2.0
"""Time in seconds after which a partial result is reported. Reading one file may take some seconds."""
MAX_TOPICS = 200
CACHE_BYTES = 8_000_000
"""Cache size in bytes for a recording that is opened only briefly."""
SCAN_BUDGET = (256_000_000, 3.0)
"""Maximum number of bytes and seconds for reading one file."""
_JOB_OWNER = "recordings"


@dataclass(frozen=True, slots=True)
class RecordingInfo:
    """Recording file in the folder.

    Attributes:
        is_read: True if the content was read; otherwise only name, size and time are known.
        topics: Names of the first 200 topics.
        is_complete: True if the file was closed properly; otherwise only the intact part is used.
        is_from_flight_recorder: True if the file was saved by a flight recorder.
        problem: Reason why the file can't be read, or "".
        scan_problem: Reason why the content was not read here, or ""; opening the file may still be
            possible.
        lost: Number of messages that were lost or could not be written; None if unknown.
    """

    path: Path
    size_bytes: int
    changed_s: float
    is_read: bool = False
    start_ns: int = 0
    duration_s: float = 0.0
    message_count: int = 0
    topics: tuple[str, ...] = ()
    note: str = ""
    is_complete: bool = False
    is_repaired: bool = False
    is_from_flight_recorder: bool = False
    problem: str = ""
    scan_problem: str = ""
    lost: int | None = None


@dataclass(frozen=True, slots=True)
class FolderScan:
    """Result of a scan of the folder.

    Attributes:
        files: Recordings, newest first.
        problem: Reason why the folder can't be read, or "".
        omitted_count: Number of older files that are not listed.
        is_complete: True if all files have been read; otherwise call `RecordingFolder.start_scan` again.
    """

    files: Sequence[RecordingInfo] = ()
    problem: str = ""
    omitted_count: int = 0
    is_complete: bool = True


def new_path(folder: Path, now: datetime, prefix: str = "recording") -> Path:
    """Return an unused path for a new recording.

    Args:
        folder: Folder of recordings.
        now: Current local time, used in the file name.
        prefix: First part of the file name.
    """
    stem = f"{prefix}-{now.strftime('%Y-%m-%d-%H-%M-%S')}"
    path, number = folder / f"{stem}{SUFFIX}", 2
    while path.exists():
        path, number = folder / f"{stem}-{number}{SUFFIX}", number + 1
    return path


class RecordingFolder:
    """Scanner of a folder of recordings. Repeated scans open only new files.

    Not thread-safe; use it from the main thread.
    """

    def __init__(self, folder: Path, opener: RecordingOpener | None = None) -> None:
        self.folder = folder
        self._opener: RecordingOpener = LocalOpener() if opener is None else opener
        self._worker: BackgroundWorker[FolderScan] = BackgroundWorker("recordings-folder")
        self._info_cache: dict[Path, tuple[tuple[int, int], RecordingInfo]] = {}
        """Facts already read, with the size and time of each file. Used by the worker thread only."""

    def start_scan(self, active_path: Path | None = None) -> None:
        """Start a scan in the background; `pop_result` returns the result.

        Args:
            active_path: File of the recording in progress, which is not opened.
        """
        self._worker.submit(_JOB_OWNER, lambda: self._scan(active_path))

    def pop_result(self) -> FolderScan | None:
        """Return and clear a new scan result; None if there is none."""
        return self._worker.pop_result(_JOB_OWNER)

    def close(self) -> None:
        """Stop scanning."""
        self._opener.close()
        self._worker.close()

    def _scan(self, active_path: Path | None) -> FolderScan:
        try:
            with os.scandir(self.folder) as entries:
                found_files = [
                    (Path(each.path), each.stat())
                    for each in entries
                    if each.name.lower().endswith(SUFFIX) and each.is_file()
                ]
        except OSError as error:
            return FolderScan(problem=(error.strerror or str(error)).lower())
        found_files.sort(key=lambda each: (-each[1].st_mtime_ns, each[0].name))
        listed_files, omitted_count = found_files[:MAX_FILES], max(0, len(found_files) - MAX_FILES)
        self._info_cache = {
            path: self._info_cache[path] for path, _file_stat in listed_files if path in self._info_cache
        }
        files, opened_count, deadline_s = [], 0, time.monotonic() + MAX_SCAN_S
        for path, file_stat in listed_files:
            stamp = (file_stat.st_mtime_ns, file_stat.st_size)
            cached = self._info_cache.get(path)
            if cached is not None and cached[0] == stamp:
                files.append(cached[1])
                continue
            info = RecordingInfo(path, file_stat.st_size, file_stat.st_mtime)
            if (
                path != active_path
                and opened_count < MAX_READS_PER_SCAN
                and (not opened_count or time.monotonic() < deadline_s)
            ):
                opened_count += 1
                info = read_info(info, self._opener)
                self._info_cache[path] = (stamp, info)
            files.append(info)
        is_complete = all(each.is_read or each.path == active_path for each in files)
        return FolderScan(tuple(files), "", omitted_count, is_complete)


def read_info(file_info: RecordingInfo, opener: RecordingOpener) -> RecordingInfo:
    """Return the description of a recording, with the values that are read from the file.

    If reading fails, `problem` contains the reason; if the file is too large to scan, `scan_problem`
    does.

    Args:
        file_info: Path, size and time of the file.
        opener: Opener of recordings.
    """
    try:
        with opener.open(file_info.path, cache_bytes=CACHE_BYTES, budget=SCAN_BUDGET) as recording:
            metadata = recording.recorder_metadata
            return RecordingInfo(
                file_info.path,
                file_info.size_bytes,
                file_info.changed_s,
                is_read=True,
                start_ns=recording.start_ns,
                duration_s=recording.duration_s,
                message_count=recording.message_count,
                topics=tuple(recording.topics)[:MAX_TOPICS],
                note=metadata.get("note", ""),
                is_complete=recording.is_complete,
                is_repaired=metadata.get("repaired") == "1",
                is_from_flight_recorder=metadata.get("kept") == "1",
                lost=_lost_count(recording),
            )
    except RecordingTooLargeError as error:
        problem = _("Not scanned: {reason}.").format(reason=error.reason)
        return replace(file_info, is_read=True, is_complete=True, scan_problem=problem)
    except (NepError, OSError) as error:
        return replace(file_info, is_read=True, problem=str(error))


def _lost_count(recording: Recording) -> int | None:
    try:
        stats = recording.stats()
    except RecordingTooLargeError:  # a file that was not closed would have to be read completely
        return None
    return sum((each.lost or 0) + each.unkept for each in stats.values()) if stats else None


def read_picture(path: Path, display_size: Size, opener: RecordingOpener) -> Picture | None:
    """Return an image of the topic with the most images; None if the recording has no readable image.

    Args:
        path: File of the recording.
        display_size: Size of the view in pixels.
        opener: Opens the recording.
    """
    try:
        with opener.open(path, cache_bytes=CACHE_BYTES, budget=SCAN_BUDGET) as recording:
            topics = [each for each in recording.topics.values() if content_of(each.codec) == "image"]
            if not topics:
                return None
            topic = max(topics, key=lambda each: each.message_count).name
            middle_ns = (recording.start_ns + recording.end_ns) // 2
            entry = recording.newest(middle_ns, (topic,)).get(topic) or recording.after(middle_ns, topic)
            return decode(entry.message, 0.0, display_size)[0] if entry is not None else None
    except (NepError, OSError):
        return None
