"""Virtual robots of the last session, which are started again at the next start if the user wants that."""

from __future__ import annotations

from contextlib import suppress
from typing import Protocol

from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.robots.virtual_models import virtual_models

MAX_ROBOTS = 8


class RobotStarter(Protocol):
    """Part of the interface of `app.core.robots.launcher.Launcher` that `LastRobots` uses."""

    models_by_name: dict[str, str]

    def start_virtual_robot(self, name: str = ..., model: str = ...) -> None:
        """Start a virtual robot with this name and model."""


class LastRobots:
    """List of the running virtual robots in the settings. Not thread-safe; use it from the main thread."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._saved_models: dict[str, str] = {}

    def start(self, launcher: RobotStarter) -> None:
        """Start the robots of the last session if the setting `restarts_robots` is on.

        At most `MAX_ROBOTS` robots are started. Returns immediately; starting a robot does not move it.
        """
        if not self._settings.restarts_robots:
            return
        for name, model in list(self._settings.virtual_robots.items())[:MAX_ROBOTS]:
            if name and isinstance(model, str) and model in virtual_models():
                launcher.start_virtual_robot(name, model)

    def save(self, launcher: RobotStarter) -> None:
        """Save the names of the running robots if they have changed.

        Called during the session, so that the names survive a crash. The settings report errors
        themselves.
        """
        if launcher.models_by_name != self._saved_models:
            self._saved_models = dict(launcher.models_by_name)
            with suppress(SettingsError):
                self._settings.virtual_robots = dict(self._saved_models)
