"""The recordings of a folder with what is in each, read outside of the window's thread."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import platformdirs

from app.core.documents.background_worker import BackgroundWorker
from app.core.messages.picture import Picture, Size, decode
from app.core.recording.opener import LocalOpener, RecordingOpener
from nep.errors import NepError, RecordingTooLargeError
from nep.i18n import _
from nep.recordings.reader import Recording

SUFFIX = ".mcap"
MOST_FILES = 2_000
AT_ONCE = 50
"""So many files are opened before what is known so far is shown."""
MOST_S = 2.0
"""... and for so long: each of them may take some seconds."""
MOST_TOPICS = 200
CACHE_BYTES = 8_000_000
"""Of one recording that is open for a moment only."""
SCAN_BUDGET = (256_000_000, 3.0)
"""Bytes and seconds of work that a look into one file may take."""
_OWNER = "recordings"


@dataclass(frozen=True, slots=True)
class RecordingFacts:
    """A file of the folder.

    ``problem`` says why it cannot be read; "" when it can. ``not_scanned``: why it was not looked into; it
    may be opened all the same. ``is_complete``: it was closed; else it is read as far as it is whole.
    ``is_kept``: made by a flight recorder. ``is_read``: whether
    more than name, size and time is known yet. ``topics``: the first 200 names. ``lost``: messages that did
    not come or could not be written, None where nobody counted.
    """

    path: Path
    size_bytes: int
    changed_s: float
    is_read: bool = False
    started_ns: int = 0
    duration_s: float = 0.0
    message_count: int = 0
    topics: tuple[str, ...] = ()
    note: str = ""
    is_complete: bool = False
    is_repaired: bool = False
    is_kept: bool = False
    problem: str = ""
    not_scanned: str = ""
    lost: int | None = None


@dataclass(frozen=True, slots=True)
class FolderLook:
    """What is in the folder, the newest first.

    ``problem`` says why it cannot be looked at. ``left_out``: older files beyond the most that are listed.
    ``is_whole``: all files have been read; else look again.
    """

    files: Sequence[RecordingFacts] = ()
    problem: str = ""
    left_out: int = 0
    is_whole: bool = True


def usual_folder() -> Path:
    """Where recordings go unless a person chooses another folder."""
    home = os.environ.get("NEP_STUDIO_HOME")
    return Path(home or platformdirs.user_documents_dir()) / _("Recordings")


def new_path(folder: Path, now: datetime, word: str = "recording") -> Path:
    """A name for a recording that no file of the folder has yet."""
    stem = f"{word}-{now.strftime('%Y-%m-%d-%H-%M-%S')}"
    made, number = folder / f"{stem}{SUFFIX}", 2
    while made.exists():
        made, number = folder / f"{stem}-{number}{SUFFIX}", number + 1
    return made


class RecordingFolder:
    """Looks at a folder again and again, and opens only what is new. One thread uses it (the window's)."""

    def __init__(self, folder: Path, opener: RecordingOpener | None = None) -> None:
        """Nothing is looked at before `look`. ``opener`` is closed with it."""
        self.folder = folder
        self._opener: RecordingOpener = LocalOpener() if opener is None else opener
        self._worker: BackgroundWorker[FolderLook] = BackgroundWorker("recordings-folder")
        self._known: dict[Path, tuple[tuple[int, int], RecordingFacts]] = {}
        """By the thread of the worker alone."""

    def look(self, being_written: Path | None = None) -> None:
        """Look at it once more, in another thread; `take` has what is found. That file is not opened."""
        self._worker.ask(_OWNER, lambda: self._look(being_written))

    def take(self) -> FolderLook | None:
        """What a look has found, once; None while nothing new is known."""
        return self._worker.take(_OWNER)

    def close(self) -> None:
        """Look no more."""
        self._opener.close()
        self._worker.close()

    def _look(self, being_written: Path | None) -> FolderLook:
        try:
            with os.scandir(self.folder) as entries:
                there = [
                    (Path(each.path), each.stat())
                    for each in entries
                    if each.name.lower().endswith(SUFFIX) and each.is_file()
                ]
        except OSError as error:
            return FolderLook(problem=(error.strerror or str(error)).lower())
        there.sort(key=lambda each: (-each[1].st_mtime_ns, each[0].name))
        listed, left_out = there[:MOST_FILES], max(0, len(there) - MOST_FILES)
        self._known = {path: self._known[path] for path, _about in listed if path in self._known}
        files, opened, until = [], 0, time.monotonic() + MOST_S
        for path, about in listed:
            mark = (about.st_mtime_ns, about.st_size)
            known = self._known.get(path)
            if known is not None and known[0] == mark:
                files.append(known[1])
                continue
            plain = RecordingFacts(path, about.st_size, about.st_mtime)
            if path != being_written and opened < AT_ONCE and (not opened or time.monotonic() < until):
                opened += 1
                plain = read_facts(plain, self._opener)
                self._known[path] = (mark, plain)
            files.append(plain)
        is_whole = all(each.is_read or each.path == being_written for each in files)
        return FolderLook(tuple(files), "", left_out, is_whole)


def read_facts(plain: RecordingFacts, opener: RecordingOpener) -> RecordingFacts:
    """The same with what the file says of itself, or why it cannot be read or was not scanned."""
    try:
        with opener.open(plain.path, cache_bytes=CACHE_BYTES, budget=SCAN_BUDGET) as recording:
            words = recording.words
            return RecordingFacts(
                plain.path,
                plain.size_bytes,
                plain.changed_s,
                is_read=True,
                started_ns=recording.start_ns,
                duration_s=recording.duration_s,
                message_count=recording.message_count,
                topics=tuple(recording.topics)[:MOST_TOPICS],
                note=words.get("note", ""),
                is_complete=recording.is_complete,
                is_repaired=words.get("repaired") == "1",
                is_kept=words.get("kept") == "1",
                lost=_lost(recording),
            )
    except RecordingTooLargeError as error:
        why = _("Not scanned: {reason}.").format(reason=error.reason)
        return replace(plain, is_read=True, is_complete=True, not_scanned=why)
    except (NepError, OSError) as error:
        return replace(plain, is_read=True, problem=str(error))


def _lost(recording: Recording) -> int | None:
    try:
        figures = recording.figures()
    except RecordingTooLargeError:  # of a file that was not closed all of them must be read
        return None
    return sum((each.lost or 0) + each.unkept for each in figures.values()) if figures else None


def picture_in(path: Path, fit: Size, opener: RecordingOpener) -> Picture | None:
    """A picture of its fullest topic of pictures, for a view of that size; None where it has none."""
    try:
        with opener.open(path, cache_bytes=CACHE_BYTES, budget=SCAN_BUDGET) as recording:
            topics = [each for each in recording.topics.values() if each.codec == "image"]
            if not topics:
                return None
            topic = max(topics, key=lambda each: each.message_count).name
            middle = (recording.start_ns + recording.end_ns) // 2
            found = recording.newest(middle, (topic,)).get(topic) or recording.after(middle, topic)
            return decode(found.message, 0.0, fit)[0] if found is not None else None
    except (NepError, OSError):
        return None
