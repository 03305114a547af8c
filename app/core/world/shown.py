"""World that the panels show: the live network, or another one instead."""

from __future__ import annotations

from app.core.faults import log_errors
from app.core.world.part import SessionPart
from app.core.world.world import World
from nep.i18n import lazy


class ShownWorld(SessionPart):
    """Choice of the world that the panels show. The live world continues while another one is shown.

    Attributes:
        world: World that is shown.
        revision: Counter that increases when panels must watch their topics again: another world is shown,
            or the world has changed.
    """

    task = lazy("update the replay")

    def __init__(self, live: World) -> None:
        self._live = self.world = live
        self._world_revision, self.revision = live.revision, 0
        self._closing_worlds: list[World] = []

    def show(self, world: World) -> None:
        """Show a world. The previous one is stopped in the background, unless it is the live world."""
        previous = self.world
        if world is previous:
            return
        self.world, self._world_revision = world, world.revision
        self.revision += 1
        if previous is not self._live:
            self._closing_worlds = [each for each in self._closing_worlds if not each.has_ended]
            self._closing_worlds.append(previous)
            previous.request_stop()
        if world is not self._live:
            world.start()

    def tick(self) -> None:
        """Update the world, unless it is the live world, which is a part of the session itself."""
        if self.world is not self._live:
            self.world.tick()
        if self.world.revision != self._world_revision:
            self._world_revision = self.world.revision
            self.revision += 1

    def check(self) -> None:
        """Check the world, unless it is the live world."""
        if self.world is not self._live:
            self.world.check()

    def close(self) -> None:
        """Show the live world, and close all others."""
        self.show(self._live)
        for world in self._closing_worlds:
            with log_errors(f"close {world.name}"):
                world.close()
        self._closing_worlds.clear()
