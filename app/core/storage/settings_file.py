"""File of the settings: one JSON object in the configuration folder, shared by all instances of Studio."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from app.core.storage.atomic_file import make_private, read_regular_file, write_atomically
from app.core.storage.file_lock import locked
from app.core.storage.folders import home
from app.core.storage.setting import InvalidSettingError, Setting
from app.errors import SettingsError
from nep.i18n import _
from nep.system.replace_file import replace_file

FORMAT_VERSION = 1
"""Format version, increased when older versions of Studio can't read newer settings.

New keys need no new version. The states of layouts (`app.ui.shell.docking.workbench.STATE_VERSION`) are
part of the format.
"""
_OWN_FILE_NAME = f"settings.format-{FORMAT_VERSION}.json"
T = TypeVar("T")

_log = logging.getLogger(__name__)


def read_setting(setting: Setting[T], folder: Path | None = None) -> T:
    """Return a stored setting without creating or moving a file; its default if the file can't be read.

    Args:
        setting: Setting.
        folder: Folder of the settings; default: `home`.
    """
    settings_folder = folder if folder is not None else home()
    values = _read_values(settings_folder / "settings.json")
    if _format_version(values) > FORMAT_VERSION:
        values = _read_values(settings_folder / _OWN_FILE_NAME) or values
    return setting.value_in(values)


def _read_values(path: Path) -> dict[str, object]:
    # Empty if the file can't be read.
    try:
        values = json.loads(read_regular_file(path))
    except (OSError, ValueError, RecursionError):
        return {}
    return values if isinstance(values, dict) else {}


@dataclass(eq=False, slots=True)
class _Subscription:
    # `value`: last value that the callback knows.
    setting: Setting[Any]
    callback: Callable[[Any], object]
    value: object


class SettingsFile:
    """Values of settings, stored in a file. A damaged file is renamed to ``settings.damaged.json``.

    A subclass declares the settings (`app.core.storage.setting`), whose values are its attributes. Setting
    an attribute writes the file. Values of other keys that another instance has written in the meantime, and
    values of unknown keys, are preserved. Use it from the main thread.

    A file of a newer Studio in an unknown format is not changed: its readable values are used, and
    changes are stored in ``settings.format-1.json`` next to it.
    """

    def __init__(self, folder: Path | None = None) -> None:
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
        self._overrides: dict[str, object] = {}
        self._invalid_keys: set[str] = set()
        self._subscriptions: list[_Subscription] = []
        make_private(self.path.parent, "settings*.json")
        self._values: dict[str, object] = self._read()

    @classmethod
    def described(cls) -> tuple[Setting[Any], ...]:
        """Return the descriptions of all settings of this class, in the order of their declaration."""
        return tuple(
            attribute
            for owner in reversed(cls.__mro__)
            for attribute in vars(owner).values()
            if isinstance(attribute, Setting)
        )

    @property
    def invalid_count(self) -> int:
        """Number of settings whose stored value was invalid, so that their default is used."""
        return len(self._invalid_keys)

    def value(self, setting: Setting[T]) -> T:
        """Return the value of a setting: its default if none is stored or the stored value is invalid."""
        stored = self._overrides.get(setting.key, self._values.get(setting.key))
        if stored is None:
            return setting.default
        try:
            return setting.parse(stored)
        except InvalidSettingError:
            if setting.key not in self._invalid_keys:
                self._invalid_keys.add(setting.key)
                _log.warning("%s: the value of “%s” is invalid; using its default", self.path, setting.key)
            return setting.default

    def is_stored(self, setting: Setting[Any]) -> bool:
        """Return True if a valid value of a setting is stored; "" counts as no value."""
        stored = self._values.get(setting.key)
        if stored is None or stored == "":
            return False
        try:
            setting.parse(stored)
        except InvalidSettingError:
            return False
        return True

    def stored_values(self) -> dict[str, object]:
        """Return the values in the file by key, as they are, including invalid and unknown ones."""
        return dict(self._values)

    def set_value(self, setting: Setting[T], value: T) -> None:
        """Set a value, write the file, and notify the callbacks of the setting.

        A value that could not be written stays in memory and is written together with the next one.

        Args:
            setting: Setting.
            value: New value.

        Raises:
            SettingsError: The file can't be written.
            TypeError: The value can't be converted to JSON. Nothing is changed.
            ValueError: The value can't be converted to JSON. Nothing is changed.
        """
        key, stored = setting.key, setting.to_json(value)
        json.dumps(stored)
        self._overrides.pop(key, None)
        try:
            if key not in self._values or self._values[key] != stored or self.write_error is not None:
                self._values[key] = self._unwritten[key] = stored
                self._write_changes()
        finally:
            self._notify()

    def override(self, setting: Setting[T], value: T) -> None:
        """Use another value in this process, without storing it, until the setting is set."""
        self._overrides[setting.key] = setting.to_json(value)
        self._notify()

    def on_change(self, setting: Setting[T], callback: Callable[[T], object]) -> Callable[[], None]:
        """Call a function with the new value whenever a setting changes, also if another instance has set it.

        Args:
            setting: Setting.
            callback: Called in the thread that sets a value.

        Returns:
            Function that removes the callback.
        """
        subscription = _Subscription(setting, callback, self.value(setting))
        self._subscriptions.append(subscription)
        return lambda: self._subscriptions.remove(subscription)

    def _notify(self) -> None:
        for subscription in tuple(self._subscriptions):
            value = self.value(subscription.setting)
            if value != subscription.value and subscription in self._subscriptions:
                subscription.value = value
                subscription.callback(value)

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

    def _reload(self) -> None:
        # Values that another instance has written since.
        self._values = self._merged_values()

    def _write_changes(self) -> None:
        with locked(self.path):
            self._reload()
            self._write()

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
