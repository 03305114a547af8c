"""User settings, stored in one JSON file in the configuration folder."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, TypeVar

import platformdirs

from app.core.storage.atomic_file import make_private, read_regular_file, write_atomically
from app.core.storage.file_lock import locked
from app.errors import SettingsError
from nep.i18n import _
from nep.system.replace_file import replace_file

FORMAT_VERSION = 1
"""Format version, increased when older versions of Studio can't read newer settings.

New keys need no new version. The states of layouts (`app.ui.shell.docking.workbench.STATE_VERSION`) are
part of the format.
"""
_OWN_FILE_NAME = f"settings.format-{FORMAT_VERSION}.json"
MAX_RECENT_FILES = 12
_MAX_TIME_S = 1e12
"""Latest valid time in seconds since 1970.

A damaged file may contain a time that the calendar doesn't support.
"""
T = TypeVar("T")


def home() -> Path:
    """Return Studio's folder: ``$NEP_STUDIO_HOME``, else the system's configuration folder."""
    configured = os.environ.get("NEP_STUDIO_HOME")
    return (
        Path(configured) if configured else Path(platformdirs.user_config_dir("nep-studio", appauthor=False))
    )


def _is_file(path: Path) -> bool:
    # False for names that no file can have.
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def data_home() -> Path:
    """Return the folder for large data: ``$NEP_STUDIO_HOME``, else the system's data folder."""
    configured = os.environ.get("NEP_STUDIO_HOME")
    return Path(configured) if configured else Path(platformdirs.user_data_dir("nep-studio", appauthor=False))


def state_home() -> Path:
    """Return the folder for runtime state: ``$NEP_STUDIO_HOME``, else the system's state folder."""
    configured = os.environ.get("NEP_STUDIO_HOME")
    return (
        Path(configured) if configured else Path(platformdirs.user_state_dir("nep-studio", appauthor=False))
    )


def closed_tabs_folder() -> Path:
    """Return the folder for behaviours whose tabs were closed before they were saved to a file."""
    return home() / "kept"


def saved_language(folder: Path | None = None) -> str:
    """Return the language chosen in the settings, or "". Usable before translations are loaded.

    No file is created or moved.

    Args:
        folder: Folder of the settings; default: `home`.
    """
    settings_folder = folder if folder is not None else home()
    values = _read_values(settings_folder / "settings.json")
    if _format_version(values) > FORMAT_VERSION:
        values = _read_values(settings_folder / _OWN_FILE_NAME) or values
    language = values.get("language")
    return language if isinstance(language, str) else ""


def _read_values(path: Path) -> dict[str, object]:
    # Empty if the file can't be read.
    try:
        values = json.loads(read_regular_file(path))
    except (OSError, ValueError, RecursionError):
        return {}
    return values if isinstance(values, dict) else {}


@dataclass(frozen=True, slots=True)
class RecentFile:
    """File that was recently opened or saved.

    Attributes:
        path: Path of the file.
        name: Display name.
        opened_s: Time of opening or saving, in seconds since 1970.
        exists: False if the file is missing.
    """

    path: Path
    name: str
    opened_s: float
    exists: bool = True


class ListSettings(Protocol):
    """Part of the interface of `Settings` for storing lists."""

    def get(self, key: str, default: list[T]) -> list[T]:
        """Return a stored list, or ``default`` if there is none."""

    def set(self, key: str, value: object) -> None:
        """Store a list."""


class Settings:
    """User settings, by key. A damaged file is renamed to ``settings.damaged.json``.

    A file of a newer Studio in an unknown format is not changed: its readable values are used, and
    changes are stored in ``settings.format-1.json`` next to it.
    """

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        # Reads `settings.json` in `folder` (default: `home`), if it exists.
        self.path = (folder if folder is not None else home()) / "settings.json"
        self.damaged_path: Path | None = None
        self.notice = ""
        """Message for the user about the file that was found, or ""."""
        self.are_new = False
        """True if no settings existed, which means that Studio was started for the first time."""
        self.write_error: str | None = None
        """Reason why the last write failed; None if it succeeded."""
        self._unwritten: dict[str, object] = {}
        self._clock = clock
        make_private(self.path.parent, "settings*.json")
        self._values: dict[str, object] = self._read()

    def get(self, key: str, default: T) -> T:
        """Return the value of a key, or ``default`` if the value is missing or has another type.

        With the default None, a value of any type is returned.
        """
        value = self._values.get(key, default)
        if default is None or isinstance(value, type(default)):
            return value  # type: ignore[return-value]  # checked on the line above
        return default

    def set(self, key: str, value: object) -> None:
        """Set a value and write the file.

        Values of other keys that another instance has written in the meantime are preserved. A value
        that could not be written stays in memory and is written together with the next one.

        Args:
            key: Name of the setting.
            value: Value that can be converted to JSON.

        Raises:
            SettingsError: The file can't be written.
            TypeError: The value can't be converted to JSON. Nothing is changed.
            ValueError: The value can't be converted to JSON. Nothing is changed.
        """
        if key in self._values and self._values[key] == value and self.write_error is None:
            return
        json.dumps(value)
        self._values[key] = self._unwritten[key] = value
        with locked(self.path):
            self._values = self._merged_values()
            self._write()

    def all(self) -> dict[str, object]:
        """Return all values, by key."""
        return dict(self._values)

    @property
    def recent_files(self) -> list[RecentFile]:
        """Recent files that exist, newest first."""
        return [file for file in self.all_recent_files if file.exists]

    @property
    def all_recent_files(self) -> list[RecentFile]:
        """Recent files, newest first, including files that are missing."""
        recent_files = []
        entries: list[object] = self.get("recent", [])
        for entry in entries:
            if isinstance(entry, Mapping) and isinstance(entry.get("path"), str):
                path, opened, name = Path(entry["path"]), entry.get("opened_s", 0), entry.get("name")
                is_time = isinstance(opened, int | float) and abs(opened) <= _MAX_TIME_S
                opened_s = float(opened) if is_time else 0.0
                if not isinstance(name, str) or path.parent != closed_tabs_folder():
                    name = path.stem
                recent_files.append(RecentFile(path, name, opened_s, _is_file(path)))
        return recent_files

    def add_recent(self, path: Path, name: str | None = None) -> None:
        """Add a file at the top of the recent files, or move it there.

        Args:
            path: Path of the file.
            name: Display name; default: the file name without its extension.

        Raises:
            SettingsError: The settings can't be written.
        """
        path = path.resolve()
        self._values = self._merged_values()
        other_files = [file for file in self.all_recent_files if file.path != path]
        self.set_recent([RecentFile(path, name or path.stem, self._clock()), *other_files])

    def rename_recent(self, old: Path, new: Path) -> None:
        """Rename a recent file without changing its position.

        Raises SettingsError if the settings can't be written.
        """
        old, new = old.resolve(), new.resolve()
        self._values = self._merged_values()
        other_files = [file for file in self.all_recent_files if file.path != new]
        renamed = [
            replace(file, path=new, name=new.stem) if file.path == old else file for file in other_files
        ]
        self.set_recent(renamed)

    def set_recent(self, files: Sequence[RecentFile]) -> None:
        """Set the list of recent files, newest first; at most `MAX_RECENT_FILES` are stored.

        Raises SettingsError if the settings can't be written.
        """
        recent = [
            {"path": str(file.path), "name": file.name, "opened_s": file.opened_s}
            for file in files[:MAX_RECENT_FILES]
        ]
        self.set("recent", recent)

    def _read(self) -> dict[str, object]:
        try:
            text = read_regular_file(self.path).decode("utf-8-sig")
        except FileNotFoundError:
            self.are_new = True
            return {}
        except NotADirectoryError:
            return {}
        except (OSError, UnicodeDecodeError):
            return self._rename_damaged_file()
        try:
            values = json.loads(text)
        except (ValueError, RecursionError):
            return self._rename_damaged_file()
        if not isinstance(values, dict):
            return self._rename_damaged_file()
        if _format_version(values) <= FORMAT_VERSION:
            return values
        return (
            self._rename_damaged_file() if self.path == self._own_path() else self._switch_to_own_file(values)
        )

    def _own_path(self) -> Path:
        # Used while a newer Studio has its settings in the usual place.
        return self.path.with_name(_OWN_FILE_NAME)

    def _switch_to_own_file(self, newer_values: dict[str, object]) -> dict[str, object]:
        # The file of a newer Studio stays unchanged; a file of this version is used in addition.
        newer_name = self.path.name
        self.path = self._own_path()
        if self.path.exists():
            return self._read()
        self.notice = _(
            "The settings in “{file}” belong to a newer NEP Studio (format {format}) and are "
            "unchanged. Settings you change here are saved separately."
        ).format(file=newer_name, format=_format_version(newer_values))
        return {name: value for name, value in newer_values.items() if name != "format"}

    def _merged_values(self) -> dict[str, object]:
        # Current file content with unwritten values; the known values if it can't be read.
        try:
            values = json.loads(read_regular_file(self.path))
        except (OSError, ValueError, RecursionError):
            return self._values
        if not isinstance(values, dict):
            return self._values
        if _format_version(values) > FORMAT_VERSION:  # a newer Studio also runs on this computer
            self._switch_to_own_file(values)
            return self._values
        return {**values, **self._unwritten}

    def _rename_damaged_file(self) -> dict[str, object]:
        self.damaged_path = self.path.with_name(f"{self.path.stem}.damaged.json")
        try:
            replace_file(self.path, self.damaged_path)
        except OSError:
            self.damaged_path = None
            return {}
        self.notice = _(
            "The settings couldn't be read, so Studio uses defaults. The old file was kept as “{file}”."
        ).format(file=self.damaged_path.name)
        return {}

    def _write(self) -> None:
        values = {**self._values, "format": FORMAT_VERSION}
        text = json.dumps(values, indent=1, ensure_ascii=False, sort_keys=True)
        # A file name that is not UTF-8 has lone surrogates, which JSON represents by backslash, u and four
        # digits.
        data = text.encode("utf-8", "backslashreplace")
        try:
            write_atomically(self.path, data, durable=False, private=True)
        except OSError as error:
            settings_error = SettingsError(self.path, error.strerror or str(error))
            self.write_error = str(settings_error)
            raise settings_error from error
        self.write_error = None
        self._unwritten.clear()


def _format_version(values: Mapping[str, object]) -> int:
    # 1 for settings from before there were versions.
    version = values.get("format", 1)
    return version if isinstance(version, int) and not isinstance(version, bool) else 1
