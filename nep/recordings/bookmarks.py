"""Bookmarks of a recording: named moments.

Bookmarks that are set while recording are stored in the recording, as notes. Bookmarks that are set later are
stored in a JSON file next to the recording, because a recording is never modified.
"""

from __future__ import annotations

import os
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import orjson

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.formats.destination import disk_error
from nep.recordings.reader import Recording
from nep.system.replace_file import replace_file

MAX_BOOKMARKS = 10_000
_MAX_FILE_BYTES = 10_000_000
_MAX_NAME_LENGTH = 200


@dataclass(frozen=True)
class Bookmark:
    """Named moment of a recording.

    Attributes:
        at_ns: Time in ns since 1970.
        name: Name; may be "".
        is_note: True if the bookmark is stored in the recording and so can't be changed.
    """

    at_ns: int
    name: str
    is_note: bool = False


class Bookmarks:
    """Bookmarks of one recording, sorted by time. Changes are saved immediately. Not thread-safe.

    Args:
        recording: Recording, which must stay open.
    """

    def __init__(self, recording: Recording) -> None:
        """Read the bookmarks.

        An unreadable bookmark file counts as empty and is renamed at the next change.
        """
        self._recording = recording
        self.path = recording.path.with_name(f"{recording.path.name}.bookmarks.json")
        """File with the bookmarks that are not notes."""
        self._is_damaged = False
        notes: list[Bookmark] = []
        for at_ns, value in recording.entries("notes"):
            text = value.get("text") if isinstance(value, dict) else None
            if isinstance(text, str) and len(notes) < MAX_BOOKMARKS:
                notes.append(Bookmark(at_ns, text[:_MAX_NAME_LENGTH], is_note=True))
        self._notes = notes
        self._saved = self._read()
        self._sort()

    def _sort(self) -> None:
        self._all = tuple(sorted((*self._notes, *self._saved), key=_at_ns))

    @property
    def all(self) -> Sequence[Bookmark]:
        """All bookmarks, earliest first."""
        return self._all

    def before(self, at_ns: int) -> Bookmark | None:
        """Return the last bookmark before a time in ns since 1970, or None."""
        index = bisect_left(self._all, at_ns, key=_at_ns)
        return self._all[index - 1] if index else None

    def after(self, at_ns: int) -> Bookmark | None:
        """Return the first bookmark after a time in ns since 1970, or None."""
        index = bisect_right(self._all, at_ns, key=_at_ns)
        return self._all[index] if index < len(self._all) else None

    # ---- changes

    def add(self, at_ns: int, name: str = "") -> Bookmark:
        """Add a bookmark and return it.

        Args:
            at_ns: Time in ns since 1970; clamped to the time span of the recording.
            name: Name of the bookmark; long names are truncated.

        Raises:
            RecordingError: There are already `MAX_BOOKMARKS`, or the bookmark can't be saved.
        """
        if len(self._saved) >= MAX_BOOKMARKS:
            reason = _("the recording already has {most} bookmarks, the maximum; delete one first").format(
                most=MAX_BOOKMARKS
            )
            raise RecordingError(str(self._recording.path), reason)
        at_ns = max(self._recording.start_ns, min(at_ns, self._recording.end_ns))
        bookmark = Bookmark(at_ns, name[:_MAX_NAME_LENGTH])
        self._save([*self._saved, bookmark])
        return bookmark

    def rename(self, bookmark: Bookmark, name: str) -> Bookmark:
        """Rename a bookmark and return the new one.

        Raises:
            ValueError: The bookmark is a note or doesn't exist.
            RecordingError: The change can't be saved.
        """
        renamed = replace(bookmark, name=name[:_MAX_NAME_LENGTH])
        saved = list(self._saved)
        saved[self._index_of(bookmark)] = renamed
        self._save(saved)
        return renamed

    def remove(self, bookmark: Bookmark) -> None:
        """Remove a bookmark. Raises the exceptions of `rename`."""
        saved = list(self._saved)
        del saved[self._index_of(bookmark)]
        self._save(saved)

    def _index_of(self, bookmark: Bookmark) -> int:
        if bookmark not in self._saved:
            raise ValueError(
                _("this bookmark can't be changed: it was removed, or added during the recording")
            )
        return self._saved.index(bookmark)

    # ---- on the disk

    def _read(self) -> list[Bookmark]:
        try:
            if self.path.stat().st_size > _MAX_FILE_BYTES:
                raise ValueError("size")
            content = orjson.loads(self.path.read_bytes())
            return [_parse_bookmark(each) for each in content["bookmarks"]][:MAX_BOOKMARKS]
        except FileNotFoundError:
            return []
        except (OSError, ValueError, TypeError, KeyError):
            self._is_damaged = True
            return []

    def _save(self, bookmarks: list[Bookmark]) -> None:
        document = {"bookmarks": [{"at_ns": each.at_ns, "name": each.name} for each in bookmarks]}
        part_file = self.path.with_name(f"{self.path.name}.part")
        try:
            text = orjson.dumps(document, option=orjson.OPT_INDENT_2)
        except TypeError as error:  # a lone surrogate
            raise RecordingError(
                str(self.path), _("the name of a bookmark contains invalid characters")
            ) from error
        try:
            if self._is_damaged:
                replace_file(self.path, self.path.with_name(f"{self.path.name}.damaged"))
                self._is_damaged = False
            with part_file.open("wb") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            replace_file(part_file, self.path)
        except OSError as error:
            with suppress(OSError):
                part_file.unlink(missing_ok=True)
            raise disk_error(self.path, error) from error
        self._saved = bookmarks
        self._sort()


def _parse_bookmark(value: object) -> Bookmark:
    # Raises `ValueError`.
    at_ns = value.get("at_ns") if isinstance(value, dict) else None
    name = value.get("name") if isinstance(value, dict) else None
    if type(at_ns) is not int or not 0 <= at_ns < 2**64 or not isinstance(name, str):
        raise ValueError("no bookmark")
    return Bookmark(at_ns, name[:_MAX_NAME_LENGTH])


def _at_ns(bookmark: Bookmark) -> int:
    return bookmark.at_ns
