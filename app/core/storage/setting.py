"""Descriptions of settings: key in the file, type, default, valid values, and row in the settings sheet.

A setting is a descriptor of a class of settings (`app.core.storage.settings.Settings`): an instance reads
and writes the value in its file, the class returns the description itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, Protocol, Self, TypeVar, overload

from nep import i18n
from nep.i18n import _

T = TypeVar("T")


class InvalidSettingError(ValueError):
    """Raised when a stored value doesn't match its setting."""


@dataclass(frozen=True, slots=True)
class SheetRow:
    """Row of a setting in the settings sheet.

    Attributes:
        title: Caption of the row, wrapped in `lazy`.
        label: Text of the switch or button, wrapped in `lazy`.
        icon: Icon of the button.
        explanation: Tooltip and accessible description of the control, wrapped in `lazy`.
    """

    title: str
    label: str = ""
    icon: str = ""
    explanation: str = ""


class StoredSettings(Protocol):
    """Part of the interface of `app.core.storage.settings_file.SettingsFile` that settings use."""

    def value(self, setting: Setting[T]) -> T:
        """Return the value of a setting."""

    def set_value(self, setting: Setting[T], value: T) -> None:
        """Set a value and write the file."""


class Setting(ABC, Generic[T]):
    """Description of a setting. Changes take effect immediately unless `active` is set.

    Attributes:
        key: Key in the settings file. Never change it, and don't use the key of a deleted setting again.
        row: Row in the settings sheet, or None.
        is_public: True if problem reports include the value. Values of other settings stay private.
        active: Returns the value that is in effect, if changes take effect at the next start; else None.
    """

    def __init__(
        self,
        key: str,
        default: T,
        *,
        row: SheetRow | None = None,
        is_public: bool = False,
        active: Callable[[], T] | None = None,
    ) -> None:
        self.key, self._default = key, default
        self.row, self.is_public, self.active = row, is_public, active

    @property
    def default(self) -> T:
        """Value if none is stored, or if the stored value is invalid."""
        return self._default

    def parse(self, stored: object) -> T:
        """Convert a value of the file.

        Raises:
            InvalidSettingError: The value is invalid.
        """
        return self._decode(stored)

    def to_json(self, value: T) -> object:
        """Convert a value for the file."""
        return self._encode(value)

    @abstractmethod
    def _decode(self, stored: object) -> T: ...

    def _encode(self, value: T) -> object:
        return value

    def value_in(self, values: Mapping[str, object]) -> T:
        """Return the value among the values of a file; the default if it is missing or invalid."""
        try:
            return self.parse(values[self.key])
        except (KeyError, InvalidSettingError):
            return self.default

    @overload
    def __get__(self, settings: None, owner: type) -> Self: ...
    @overload
    def __get__(self, settings: StoredSettings, owner: type) -> T: ...
    def __get__(self, settings: StoredSettings | None, owner: type) -> Self | T:
        return self if settings is None else settings.value(self)

    def __set__(self, settings: StoredSettings, value: T) -> None:
        settings.set_value(self, value)


class FlagSetting(Setting[bool]):
    """Setting that is True or False."""

    def _decode(self, stored: object) -> bool:
        return _instance(stored, bool)


class OptionalFlagSetting(Setting[bool | None]):
    """Setting that is True, False, or None until the user has chosen."""

    def __init__(self, key: str, *, is_public: bool = False) -> None:
        super().__init__(key, None, is_public=is_public)

    def _decode(self, stored: object) -> bool | None:
        return _instance(stored, bool)


class NumberSetting(Setting[int]):
    """Setting with an integer. A stored value outside the range is replaced by the nearest limit.

    Attributes:
        minimum: Minimum.
        maximum: Maximum.
        unit: Unit, or "".
        choices: Numbers that the settings sheet offers; empty for all.
    """

    def __init__(
        self,
        key: str,
        default: int,
        minimum: int,
        maximum: int,
        unit: str = "",
        choices: Sequence[int] = (),
        *,
        row: SheetRow | None = None,
        is_public: bool = False,
    ) -> None:
        super().__init__(key, default, row=row, is_public=is_public)
        self.minimum, self.maximum, self.unit, self.choices = minimum, maximum, unit, tuple(choices)

    def _decode(self, stored: object) -> int:
        if isinstance(stored, bool):
            raise InvalidSettingError("not a number")
        return self._clamp(_instance(stored, int))

    def _encode(self, value: int) -> object:
        return self._clamp(value)

    def _clamp(self, value: int) -> int:
        return min(max(value, self.minimum), self.maximum)


class TextSetting(Setting[str]):
    """Setting with a text."""

    def __init__(self, key: str, default: str = "", *, is_public: bool = False) -> None:
        super().__init__(key, default, is_public=is_public)

    def _decode(self, stored: object) -> str:
        return _instance(stored, str)


OptionValue = TypeVar("OptionValue", bound=str)


@dataclass(frozen=True, slots=True)
class ChoiceOption(Generic[OptionValue]):
    """Option of a `ChoiceSetting`.

    Attributes:
        value: Value of the setting.
        label: Text in the settings sheet, wrapped in `lazy`.
        icon: Icon in the settings sheet, or None.
    """

    value: OptionValue
    label: str
    icon: str | None = None


class ChoiceSetting(Setting[OptionValue]):
    """Setting with one of several options."""

    def __init__(
        self,
        key: str,
        default: OptionValue,
        options: Sequence[ChoiceOption[OptionValue]],
        *,
        row: SheetRow | None = None,
        is_public: bool = False,
        flag: tuple[OptionValue, OptionValue] | None = None,
        active: Callable[[], OptionValue] | None = None,
    ) -> None:
        # `flag`: options for False and True, which older versions stored.
        super().__init__(key, default, row=row, is_public=is_public, active=active)
        self._options, self._flag = tuple(options), flag

    def options(self) -> Sequence[ChoiceOption[OptionValue]]:
        """Return the options with translated labels, in the order of the settings sheet."""
        return [replace(option, label=_(option.label)) for option in self._options]

    def _decode(self, stored: object) -> OptionValue:
        if isinstance(stored, bool) and self._flag is not None:
            return self._flag[stored]
        for option in self._options:
            if option.value == stored:
                return option.value
        raise InvalidSettingError("not an option")


class LanguageSetting(ChoiceSetting[str]):
    """Setting with the code of a language, "" for the system's. Takes effect at the next start."""

    def __init__(self, key: str, *, row: SheetRow | None = None, is_public: bool = False) -> None:
        super().__init__(key, "", (), row=row, is_public=is_public, active=i18n.language)

    def options(self) -> Sequence[ChoiceOption[str]]:
        """Return the selectable languages by their own names."""
        return [ChoiceOption(code, name) for code, name in i18n.selectable_languages()]

    def _decode(self, stored: object) -> str:
        return _instance(stored, str)


class FolderSetting(Setting[Path]):
    """Setting with a folder, which is stored as a text."""

    def __init__(self, key: str, default_folder: Callable[[], Path], *, row: SheetRow | None = None) -> None:
        super().__init__(key, Path(), row=row)
        self._default_folder = default_folder

    @property
    def default(self) -> Path:
        """Default folder, which depends on the environment."""
        return self._default_folder()

    def _decode(self, stored: object) -> Path:
        return Path(_instance(stored, str)) if stored != "" else self.default

    def _encode(self, value: Path) -> object:
        return str(value)


class TextsSetting(Setting[tuple[str, ...]]):
    """Setting with a list of texts. Other entries of a stored list are skipped."""

    def __init__(self, key: str, *, is_public: bool = False) -> None:
        super().__init__(key, (), is_public=is_public)

    def _decode(self, stored: object) -> tuple[str, ...]:
        return tuple(each for each in _instance(stored, list) if isinstance(each, str))

    def _encode(self, value: tuple[str, ...]) -> object:
        return list(value)


class EntriesSetting(Setting[Sequence[Mapping[str, object]]]):
    """Setting with a list of objects, which its user validates. Other stored entries are skipped."""

    def __init__(self, key: str) -> None:
        super().__init__(key, ())

    def _decode(self, stored: object) -> Sequence[Mapping[str, object]]:
        return tuple(each for each in _instance(stored, list) if isinstance(each, dict))

    def _encode(self, value: Sequence[Mapping[str, object]]) -> object:
        return [dict(each) for each in value]


class MappingSetting(Setting[Mapping[str, object]]):
    """Setting with values by name, which its user validates."""

    def __init__(self, key: str, *, row: SheetRow | None = None, is_public: bool = False) -> None:
        super().__init__(key, {}, row=row, is_public=is_public)

    def _decode(self, stored: object) -> Mapping[str, object]:
        return dict(_instance(stored, dict))

    def _encode(self, value: Mapping[str, object]) -> object:
        return dict(value)


def _instance(stored: object, kind: type[T]) -> T:
    if not isinstance(stored, kind):
        raise InvalidSettingError(f"not of the type {kind.__name__}")
    return stored
