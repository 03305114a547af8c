"""The virtual robots of the last start: they come back at the next one, unless a person does not want it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Protocol

from app.core.robots.launcher import VIRTUAL_ROBOTS
from app.core.storage.settings import Settings
from app.errors import SettingsError

KEPT, COME_BACK = "virtual_robots", "virtual_robots_come_back"
MOST = 8


class StartsRobots(Protocol):
    """What is needed of the launcher."""

    wanted: dict[str, str]

    def start_virtual_robot(self, name: str = ..., model: str = ...) -> None:
        """Start one of that name and model."""


class LastRobots:
    """Keeps in the settings which virtual robots a person works with. One thread uses it (the window's)."""

    def __init__(self, settings: Settings) -> None:
        """The settings keep them; nobody is here yet."""
        self._settings = settings
        self._seen: dict[str, str] = {}

    @property
    def come_back(self) -> bool:
        """Whether they come back at the next start."""
        return self._settings.get(COME_BACK, True)

    def set_come_back(self, wanted: bool) -> None:
        """Choose whether they come back. Raises SettingsError."""
        self._settings.set(COME_BACK, wanted)

    def start(self, launcher: StartsRobots) -> None:
        """Start those that were there when Studio ended; returns at once, and nothing moves."""
        if not self.come_back:
            return
        kept: Mapping[str, object] = self._settings.get(KEPT, {})
        for name, model in list(kept.items())[:MOST]:
            if name and isinstance(model, str) and model in VIRTUAL_ROBOTS:
                launcher.start_virtual_robot(name, model)

    def keep(self, launcher: StartsRobots) -> None:
        """Keep who is here now if somebody came or went since the last time.

        At once and not only at the end: a crash loses nobody. What can't be written is told by the settings.
        """
        if launcher.wanted != self._seen:
            self._seen = dict(launcher.wanted)
            with suppress(SettingsError):
                self._settings.set(KEPT, dict(self._seen))
