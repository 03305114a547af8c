"""Room that the virtual robots share. Studio shows, changes and saves it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from app.core.network.mailbox import Batch
from app.core.network.watches import Watch, Watches
from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.robots.virtual.room import Box, Person, Room
from app.robots.virtual.room_map import TOPIC, RoomMap
from nep.errors import NepError
from nep.i18n import lazy
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.protocol.graph_view import GraphView

SAVE_DELAY_S = 1.0
"""Time in seconds without changes after which the room is saved."""
SHARING_FAILED_MESSAGE = lazy("can't share the room of the virtual robots: {error}")


class SessionRoom:
    """Room shared by all virtual robots and all Studios on the network.

    The room is joined when the first robot appears. Not thread-safe; use it from the main thread.
    """

    def __init__(
        self,
        settings: Settings,
        watches: Watches,
        submit: Callable[[str, Callable[[Node], None]], None],
        clock: Callable[[], float] = time.monotonic,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._settings, self._watches, self._submit, self._clock = settings, watches, submit, clock
        self._map = RoomMap(clock_ns=clock_ns)
        self._map.merge(settings.room)
        self._watch: Watch | None = None
        self._publisher: Publisher | None = None
        self._is_opening = False
        self._saved_revision = self._published_revision = self._last_revision = self._map.revision
        self._changed_s = -math.inf
        self._room: tuple[int, Room] = (-1, Room())

    @property
    def revision(self) -> int:
        """Counter that increases with every change."""
        return self._map.revision

    @property
    def room(self) -> Room:
        """Current room."""
        if self._room[0] != self._map.revision:
            self._room = (self._map.revision, self._map.room())
        return self._room[1]

    # -- commands of the user -------------------------------------------------------------------------

    def move(self, name: str, x: float, y: float, robots: Mapping[str, tuple[float, float, float]]) -> bool:
        """Move an object, limited by the walls; return True if its position has changed.

        Nothing is moved if a robot is in the way.

        Args:
            name: Name of the object.
            x: New x coordinate in metres.
            y: New y coordinate in metres.
            robots: Position and radius (x, y, radius) of each robot in metres, by name.
        """
        moved_object = self.room.with_moved(name, x, y).thing(name)
        for pose in robots.values():
            if isinstance(moved_object, (Box, Person)) and _touches(moved_object, *pose):
                return False
        return self._publish() if self._map.move(name, x, y) else False

    def add(self, kind: str, x: float, y: float) -> str | None:
        """Add an object; return its name, or None if there are too many objects of this kind.

        Args:
            kind: Kind of the object.
            x: x coordinate in metres.
            y: y coordinate in metres.
        """
        name = self._map.add(kind, x, y)
        self._publish()
        return name

    def remove(self, name: str) -> bool:
        """Remove an object; return False if it doesn't exist."""
        return self._publish() if self._map.remove(name) else False

    def reset(self) -> None:
        """Reset the room to its initial state."""
        self._map.reset()
        self._publish()

    # -- input from the session -----------------------------------------------------------------------

    def update(self, view: GraphView) -> None:
        """Apply a new graph. The room is joined as soon as a robot has published it."""
        if self._watch is not None or TOPIC not in view.topics:
            return
        self._watch = self._watches.open([TOPIC])

        def open_job(node: Node) -> None:
            self._publisher = node.new_pub(TOPIC, "json", latched=True)

        self._submit(SHARING_FAILED_MESSAGE, open_job)
        self._published_revision = -1  # the robots don't know the saved room

    def add_messages(self, batches: Mapping[str, Batch]) -> None:
        """Apply changes of the room that other programs published."""
        batch = batches.get(TOPIC)
        for message in batch.messages if batch is not None else ():
            try:
                payload = message.payload
            except NepError:
                continue
            if isinstance(payload, Mapping):
                self._map.merge(payload)

    def tick(self) -> None:
        """Publish and save changes. Called at every tick of the session."""
        revision = self._map.revision
        if self._published_revision == -1 and self._publisher is not None:
            self._publish()
        if revision != self._last_revision:
            self._last_revision, self._changed_s = revision, self._clock()
        elif revision != self._saved_revision and self._clock() - self._changed_s >= SAVE_DELAY_S:
            self.save()
            if revision != self._published_revision:
                # later subscribers receive it from here, even if the program that changed it has ended
                self._publish()

    def save(self) -> None:
        """Save the room for the next start; the settings report errors."""
        if self._map.revision != self._saved_revision:
            self._saved_revision = self._map.revision
            with suppress(SettingsError):
                self._settings.room = self._map.message()

    def close(self) -> None:
        """Save the room and close the publisher."""
        self.save()
        if self._publisher is not None:
            self._publisher.close()

    def _publish(self) -> bool:
        self._published_revision = self._map.revision
        if self._publisher is not None:
            with suppress(NepError):
                self._publisher.publish(self._map.message())
        return True


def _touches(obstacle: Box | Person, x: float, y: float, radius: float) -> bool:
    if isinstance(obstacle, Box):
        return obstacle.distance_to(x, y) < radius
    return math.hypot(obstacle.x - x, obstacle.y - y) < obstacle.radius + radius
