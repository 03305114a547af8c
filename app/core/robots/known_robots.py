"""Known robots: names of real robots and the times when they were last connected, stored in the settings."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.robots.description.description import Robot

MAX_ROBOTS = 24


@dataclass(frozen=True, slots=True)
class KnownRobot:
    """Real robot that is or was connected.

    Attributes:
        last_connected_s: Time of the last connection in seconds since 1970.
    """

    name: str
    last_connected_s: float


class KnownRobots:
    """Known real robots, most recently connected first.

    Virtual robots are not stored, because the user can start them at any time.
    """

    def __init__(self, settings: Settings | None = None, clock: Callable[[], float] = time.time) -> None:
        self._settings, self._clock = settings, clock

    @property
    def robots(self) -> tuple[KnownRobot, ...]:
        """All known robots, most recently connected first; invalid entries are skipped."""
        entries = self._settings.known_robots if self._settings is not None else ()
        robots_by_name = {robot.name: robot for robot in map(_parse_robot, entries) if robot is not None}
        return tuple(sorted(robots_by_name.values(), key=lambda robot: -robot.last_connected_s))

    def record(self, robots: Sequence[Robot]) -> None:
        """Save the current time as the time of the last connection of these robots."""
        names = [robot.name for robot in robots if not robot.virtual]
        if names:
            now = self._clock()
            other_robots = [robot for robot in self.robots if robot.name not in names]
            self._save([*(KnownRobot(name, now) for name in names), *other_robots])

    def discard(self, name: str) -> None:
        """Remove a robot from the list. It is added again when it connects."""
        self._save([robot for robot in self.robots if robot.name != name])

    def _save(self, robots: Sequence[KnownRobot]) -> None:
        if self._settings is None:
            return
        entries = [{"name": robot.name, "seen_s": robot.last_connected_s} for robot in robots[:MAX_ROBOTS]]
        # At most an entry of this list is lost. Problems with the file are reported when other settings are
        # saved.
        with contextlib.suppress(SettingsError):
            self._settings.known_robots = entries


def _parse_robot(entry: Mapping[str, object]) -> KnownRobot | None:
    name, last_seen_s = entry.get("name"), entry.get("seen_s")
    if (
        not isinstance(name, str)
        or not name
        or isinstance(last_seen_s, bool)
        or not isinstance(last_seen_s, (int, float))
    ):
        return None
    return KnownRobot(name, float(last_seen_s))
