"""What a person chose, kept between starts: one JSON file in the user's configuration folder."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, TypeVar

import platformdirs

from app.core.storage.atomic_file import make_private, read_whole, write_atomically
from app.core.storage.file_lock import locked
from app.errors import SettingsError
from nep.i18n import _
from nep.system.replace_file import replace_file

FORMAT = 1
"""Goes up when this version can't understand what the next one keeps; what is only new needs no other number.
The states of layouts (`app.ui.shell.docking.workbench.STATE_VERSION`) are in here, too."""
_OWN_NAME = f"settings.format-{FORMAT}.json"
RECENT_LIMIT = 12
_LATEST_S = 1e12
"""No time is later: a damaged file may have a number that no clock can show."""
T = TypeVar("T")


def home() -> Path:
    """Studio's own folder: ``$NEP_STUDIO_HOME``, else the system's place for configuration."""
    chosen = os.environ.get("NEP_STUDIO_HOME")
    return Path(chosen) if chosen else Path(platformdirs.user_config_dir("nep-studio", appauthor=False))


def _is_file(path: Path) -> bool:
    """Whether it is there; nothing is that has a name which no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def data_home() -> Path:
    """Where Studio keeps what is large: ``$NEP_STUDIO_HOME``, else the system's place for data."""
    chosen = os.environ.get("NEP_STUDIO_HOME")
    return Path(chosen) if chosen else Path(platformdirs.user_data_dir("nep-studio", appauthor=False))


def state_home() -> Path:
    """Where Studio keeps what concerns its own runs: ``$NEP_STUDIO_HOME``, else the system's place."""
    chosen = os.environ.get("NEP_STUDIO_HOME")
    return Path(chosen) if chosen else Path(platformdirs.user_state_dir("nep-studio", appauthor=False))


def kept_folder() -> Path:
    """Where Studio saves behaviours that were closed and had no file yet."""
    return home() / "kept"


def kept_language(folder: Path | None = None) -> str:
    """The language that a person chose, "" for none: for who has no words yet. Nothing is moved or made."""
    place = folder if folder is not None else home()
    values = _values_in(place / "settings.json")
    if _format_of(values) > FORMAT:
        values = _values_in(place / _OWN_NAME) or values
    chosen = values.get("language")
    return chosen if isinstance(chosen, str) else ""


def _values_in(path: Path) -> dict[str, object]:
    """What a file says; nothing when it can't be read."""
    try:
        values = json.loads(read_whole(path))
    except (OSError, ValueError, RecursionError):
        return {}
    return values if isinstance(values, dict) else {}


@dataclass(frozen=True, slots=True)
class RecentFile:
    """A file that was opened or saved, and when (epoch seconds)."""

    path: Path
    name: str
    opened_s: float
    there: bool = True


class ListSettings(Protocol):
    """What is needed of the settings to keep lists there."""

    def get(self, key: str, default: list[T]) -> list[T]:
        """A list that was kept."""

    def set(self, key: str, value: object) -> None:
        """Keep it."""


class Settings:
    """Chosen values by name. A damaged file is kept beside (``settings.damaged.json``), never lost.

    The file of a newer Studio, with a format that is not known here, is left as it is: what can be read of it
    is taken, and what is chosen is kept beside it, in ``settings.format-1.json``.
    """

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        """Read ``settings.json`` in ``folder`` (default: `home`); none yet is fine."""
        self.path = (folder if folder is not None else home()) / "settings.json"
        self.damaged: Path | None = None
        self.notice = ""
        """What a person should know of the file that was found, once, in a sentence; "" for nothing."""
        self.are_new = False
        """Whether nothing was kept here before: Studio starts for the first time."""
        self.not_kept: str | None = None
        """Why the file could not be written last, as a sentence; None when it could."""
        self._unwritten: dict[str, object] = {}
        self._clock = clock
        make_private(self.path.parent, "settings*.json")
        self._values: dict[str, object] = self._read()

    def get(self, key: str, default: T) -> T:
        """The value of ``key``; ``default`` when there is none or it is of another type."""
        value = self._values.get(key, default)
        if default is None or isinstance(value, type(default)):
            return value  # type: ignore[return-value]  # checked on the line above
        return default

    def set(self, key: str, value: object) -> None:
        """Keep ``value`` (anything JSON can say) and write the file. Raises SettingsError.

        Raises TypeError or ValueError for what JSON can't say: not kept, as nothing else could be written
        beside it. What another Studio on this computer has kept meanwhile stays, but for this key. What could
        not be written stays here, and is written with the next value.
        """
        if key in self._values and self._values[key] == value and self.not_kept is None:
            return
        json.dumps(value)
        self._values[key] = self._unwritten[key] = value
        with locked(self.path):
            self._values = self._of_others()
            self._write()

    def all(self) -> dict[str, object]:
        """Every value that is kept, by its name."""
        return dict(self._values)

    @property
    def recent(self) -> list[RecentFile]:
        """Files opened lately, newest first; those that are gone are left out."""
        return [file for file in self.recent_known if file.there]

    @property
    def recent_known(self) -> list[RecentFile]:
        """Files opened lately, newest first; those that are gone say so."""
        found = []
        entries: list[object] = self.get("recent", [])
        for entry in entries:
            if isinstance(entry, Mapping) and isinstance(entry.get("path"), str):
                path, when, name = Path(entry["path"]), entry.get("opened_s", 0), entry.get("name")
                is_time = isinstance(when, int | float) and abs(when) <= _LATEST_S
                opened_s = float(when) if is_time else 0.0
                if not isinstance(name, str) or path.parent != kept_folder():
                    name = path.stem
                found.append(RecentFile(path, name, opened_s, _is_file(path)))
        return found

    def add_recent(self, path: Path, name: str | None = None) -> None:
        """Put ``path`` first among the recent files. Raises SettingsError."""
        path = path.resolve()
        self._values = self._of_others()
        kept = [file for file in self.recent_known if file.path != path]
        self.set_recent([RecentFile(path, name or path.stem, self._clock()), *kept])

    def rename_recent(self, old: Path, new: Path) -> None:
        """A file has another name: it stays where it was among the recent ones. Raises SettingsError."""
        old, new = old.resolve(), new.resolve()
        self._values = self._of_others()
        kept = [file for file in self.recent_known if file.path != new]
        named = [replace(file, path=new, name=new.stem) if file.path == old else file for file in kept]
        self.set_recent(named)

    def set_recent(self, files: Sequence[RecentFile]) -> None:
        """Remember these files and no others, newest first. Raises SettingsError."""
        told = [
            {"path": str(file.path), "name": file.name, "opened_s": file.opened_s}
            for file in files[:RECENT_LIMIT]
        ]
        self.set("recent", told)

    def _read(self) -> dict[str, object]:
        try:
            text = read_whole(self.path).decode("utf-8-sig")
        except FileNotFoundError:
            self.are_new = True
            return {}
        except NotADirectoryError:
            return {}
        except (OSError, UnicodeDecodeError):
            return self._set_aside()
        try:
            values = json.loads(text)
        except (ValueError, RecursionError):
            return self._set_aside()
        if not isinstance(values, dict):
            return self._set_aside()
        if _format_of(values) <= FORMAT:
            return values
        return self._set_aside() if self.path == self._own_path() else self._beside(values)

    def _own_path(self) -> Path:
        """Where the settings are while a newer Studio has its own in their place."""
        return self.path.with_name(_OWN_NAME)

    def _beside(self, newer: dict[str, object]) -> dict[str, object]:
        """Leave the file of a newer Studio alone; from now on there is one of our own beside it."""
        found = self.path.name
        self.path = self._own_path()
        if self.path.exists():
            return self._read()
        self.notice = _(
            "The settings in “{file}” belong to a newer NEP Studio (format {format}) and are "
            "unchanged. Settings you change here are saved separately."
        ).format(file=found, format=_format_of(newer))
        return {name: value for name, value in newer.items() if name != "format"}

    def _of_others(self) -> dict[str, object]:
        """What the file says now, with what is not written yet; what is known here if it can't be read."""
        try:
            values = json.loads(read_whole(self.path))
        except (OSError, ValueError, RecursionError):
            return self._values
        if not isinstance(values, dict):
            return self._values
        if _format_of(values) > FORMAT:  # a newer Studio runs on this computer, too
            self._beside(values)
            return self._values
        return {**values, **self._unwritten}

    def _set_aside(self) -> dict[str, object]:
        self.damaged = self.path.with_name(f"{self.path.stem}.damaged.json")
        try:
            replace_file(self.path, self.damaged)
        except OSError:
            self.damaged = None
            return {}
        self.notice = _(
            "The settings could not be read, so Studio uses defaults. The old file was kept as “{file}”."
        ).format(file=self.damaged.name)
        return {}

    def _write(self) -> None:
        values = {**self._values, "format": FORMAT}
        text = json.dumps(values, indent=1, ensure_ascii=False, sort_keys=True)
        # A file's name that is no UTF-8 has lone surrogates: JSON has them as backslash, u and four digits.
        data = text.encode("utf-8", "backslashreplace")
        try:
            write_atomically(self.path, data, durable=False, private=True)
        except OSError as error:
            failed = SettingsError(self.path, error.strerror or str(error))
            self.not_kept = str(failed)
            raise failed from error
        self.not_kept = None
        self._unwritten.clear()


def _format_of(values: Mapping[str, object]) -> int:
    """The number of the format; 1 for settings that were kept before there were numbers."""
    found = values.get("format", 1)
    return found if isinstance(found, int) and not isinstance(found, bool) else 1
