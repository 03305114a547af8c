"""All settings of Studio, with their recent files.

A new setting is one attribute of `Settings`. From its description follow the typed access
(``settings.text_percent``), the validation of the file, the row in the settings sheet (`SheetRow`), and
whether problem reports include the value.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from app.core.storage.folders import closed_tabs_folder, default_pictures_folder, default_recordings_folder
from app.core.storage.setting import (
    ChoiceOption,
    ChoiceSetting,
    EntriesSetting,
    FlagSetting,
    FolderSetting,
    LanguageSetting,
    MappingSetting,
    NumberSetting,
    OptionalFlagSetting,
    SheetRow,
    TextSetting,
    TextsSetting,
)
from app.core.storage.settings_file import SettingsFile
from nep.i18n import lazy, plazy

MAX_RECENT_FILES = 12
_MAX_TIME_S = 1e12
"""Latest valid time in seconds since 1970.

A damaged file may contain a time that the calendar doesn't support.
"""

Mode = Literal["light", "dark", "system"]
Preference = Literal["system", "on", "off"]
_PREFERENCES: tuple[ChoiceOption[Preference], ...] = (
    ChoiceOption("system", lazy("Match system")),
    ChoiceOption("on", lazy("On")),
    ChoiceOption("off", lazy("Off")),
)


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


class Settings(SettingsFile):
    """Settings of Studio. The settings sheet shows those that have a row, in this order.

    See `SettingsFile` for reading, writing, and notifications of changes.
    """

    language = LanguageSetting("language", row=SheetRow(lazy("Language")), is_public=True)
    theme = ChoiceSetting[Mode](
        "theme",
        "system",
        (
            ChoiceOption("light", lazy("Light"), "sun"),
            ChoiceOption("dark", lazy("Dark"), "moon"),
            ChoiceOption("system", lazy("Match system"), "monitor"),
        ),
        row=SheetRow(plazy("colours of the window", "Appearance")),
        is_public=True,
    )
    text_percent = NumberSetting(
        "text_percent", 100, 100, 200, "%", (100, 125, 150, 175, 200),
        row=SheetRow(lazy("Text size")), is_public=True,
    )  # fmt: skip
    contrast = ChoiceSetting[Preference](
        "high_contrast", "system", _PREFERENCES,
        row=SheetRow(lazy("High contrast")), is_public=True, flag=("system", "on"),
    )  # fmt: skip
    motion = ChoiceSetting[Preference](
        "less_motion", "system", _PREFERENCES,
        row=SheetRow(lazy("Reduce motion")), is_public=True, flag=("system", "on"),
    )  # fmt: skip
    restarts_robots = FlagSetting(
        "virtual_robots_come_back", True,
        row=SheetRow(lazy("Virtual robots"), lazy("Reopen at startup")), is_public=True,
    )  # fmt: skip
    is_robot_sound_on = FlagSetting("robots_heard", True, row=SheetRow(lazy("Robot voice")), is_public=True)
    shortcuts = MappingSetting(
        "shortcuts", row=SheetRow(lazy("Keyboard"), lazy("Change shortcuts"), "keyboard"), is_public=True
    )
    pictures_folder = FolderSetting("pictures_folder", default_pictures_folder, row=SheetRow(lazy("Images")))

    # -- choices made elsewhere in the window ----------------------------------------------------------

    resets_robots = FlagSetting("runs_begin_at_start", True)
    """True if virtual robots move to their start position when a behaviour starts."""
    toolbox_pinned = OptionalFlagSetting("toolbox_pinned", is_public=True)
    recordings_folder = FolderSetting("recordings_folder", default_recordings_folder)
    recording = MappingSetting("recording")
    flight_recorder = MappingSetting("flight_recorder")
    networks = MappingSetting("networks")
    """Address of each network that is shown in addition to the native one, by kind."""
    listen_hosts = TextsSetting("listen_at")
    """Addresses on which the master listens for other computers."""
    motion_permissions = TextsSetting("robots.may_move")

    # -- state of the window and of the robots ---------------------------------------------------------

    is_started_before = FlagSetting("begun", False, is_public=True)
    studio_versions = EntriesSetting("studio_versions")
    completed_steps = TextsSetting("first_steps", is_public=True)
    window_geometry = TextSetting("window", is_public=True)
    layout = TextSetting("layout", "start", is_public=True)
    layouts = MappingSetting("layouts")
    selected_layouts = MappingSetting("chosen_layouts")
    palette_entries = TextsSetting("palette_last")
    tabs = MappingSetting("tabs")
    recent_entries = EntriesSetting("recent")
    known_robots = EntriesSetting("robots.known")
    virtual_robots = MappingSetting("virtual_robots")
    """Models of the running virtual robots, by name."""
    room = MappingSetting("room")

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        # Reads `settings.json` in `folder` (default: `home`), if it exists.
        super().__init__(folder)
        self._clock = clock

    @property
    def recent_files(self) -> list[RecentFile]:
        """Recent files that exist, newest first."""
        return [file for file in self.all_recent_files if file.exists]

    @property
    def all_recent_files(self) -> list[RecentFile]:
        """Recent files, newest first, including files that are missing."""
        recent_files = []
        for entry in self.recent_entries:
            stored_path, opened, name = entry.get("path"), entry.get("opened_s", 0), entry.get("name")
            if isinstance(stored_path, str):
                path = Path(stored_path)
                opened_s = 0.0
                if isinstance(opened, int | float) and abs(opened) <= _MAX_TIME_S:
                    opened_s = float(opened)
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
        self._reload()
        other_files = [file for file in self.all_recent_files if file.path != path]
        self.set_recent([RecentFile(path, name or path.stem, self._clock()), *other_files])

    def rename_recent(self, old: Path, new: Path) -> None:
        """Rename a recent file without changing its position.

        Raises SettingsError if the settings can't be written.
        """
        old, new = old.resolve(), new.resolve()
        self._reload()
        other_files = [file for file in self.all_recent_files if file.path != new]
        renamed = [
            replace(file, path=new, name=new.stem) if file.path == old else file for file in other_files
        ]
        self.set_recent(renamed)

    def set_recent(self, files: Sequence[RecentFile]) -> None:
        """Set the list of recent files, newest first; at most `MAX_RECENT_FILES` are stored.

        Raises SettingsError if the settings can't be written.
        """
        self.recent_entries = [
            {"path": str(file.path), "name": file.name, "opened_s": file.opened_s}
            for file in files[:MAX_RECENT_FILES]
        ]


def _is_file(path: Path) -> bool:
    # False for names that no file can have.
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
