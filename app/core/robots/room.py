"""Studio's part in the room of the virtual robots: it shows it, lets people change it, and keeps it."""

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

KEPT = "room"
QUIET_S = 1.0
"""A room in which nothing has moved for so long is kept in the settings."""
NO_ROOM = lazy("can't share the room of the virtual robots: {error}")


class SessionRoom:
    """The room as all virtual robots and Studios on this network have it. One thread uses it (the window's).

    It is joined when the first robot is there; without one nobody needs it.
    """

    def __init__(
        self,
        settings: Settings,
        watches: Watches,
        submit: Callable[[str, Callable[[Node], None]], None],
        clock: Callable[[], float] = time.monotonic,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """``settings`` keep the room between starts; ``submit`` does something in the source's thread."""
        self._settings, self._watches, self._submit, self._clock = settings, watches, submit, clock
        self._map = RoomMap(clock_ns=clock_ns)
        self._map.merge(settings.get(KEPT, {}))
        self._watch: Watch | None = None
        self._publisher: Publisher | None = None
        self._is_opening = False
        self._kept = self._published = self._seen = self._map.revision
        self._changed_s = -math.inf
        self._room: tuple[int, Room] = (-1, Room())

    @property
    def revision(self) -> int:
        """Grows with every change."""
        return self._map.revision

    @property
    def room(self) -> Room:
        """The room as it is now."""
        if self._room[0] != self._map.revision:
            self._room = (self._map.revision, self._map.room())
        return self._room[1]

    # -- what a person does ------------------------------------------------------------------------

    def move(self, name: str, x: float, y: float, robots: Mapping[str, tuple[float, float, float]]) -> bool:
        """Put a thing there, inside the walls; False when a robot (x, y, radius) is in the way."""
        moved = self.room.moved(name, x, y).thing(name)
        for there in robots.values():
            if isinstance(moved, (Box, Person)) and _touches(moved, *there):
                return False
        return self._tell() if self._map.move(name, x, y) else False

    def add(self, kind: str, x: float, y: float) -> str | None:
        """Put one more thing there; its name, or None when there are enough of them."""
        name = self._map.add(kind, x, y)
        self._tell()
        return name

    def remove(self, name: str) -> bool:
        """Take a thing away; False when it is not there."""
        return self._tell() if self._map.remove(name) else False

    def put_back(self) -> None:
        """Everything is where it was at first; what was added goes."""
        self._map.put_back()
        self._tell()

    # -- what the session tells --------------------------------------------------------------------

    def update(self, view: GraphView) -> None:
        """Take over a new graph: the room is joined when there is somebody in it."""
        if self._watch is not None or TOPIC not in view.topics:
            return
        self._watch = self._watches.open([TOPIC])

        def open_it(node: Node) -> None:
            self._publisher = node.new_pub(TOPIC, "json", latched=True)

        self._submit(NO_ROOM, open_it)
        self._published = -1  # what was kept is news for the robots

    def add_messages(self, batches: Mapping[str, Batch]) -> None:
        """Take over what others say of the room."""
        batch = batches.get(TOPIC)
        for message in batch.messages if batch is not None else ():
            try:
                told = message.payload
            except NepError:
                continue
            if isinstance(told, Mapping):
                self._map.merge(told)

    def tick(self) -> None:
        """Say and keep what is new; called with every tick of the session."""
        revision = self._map.revision
        if self._published == -1 and self._publisher is not None:
            self._tell()
        if revision != self._seen:
            self._seen, self._changed_s = revision, self._clock()
        elif revision != self._kept and self._clock() - self._changed_s >= QUIET_S:
            self.keep()
            if revision != self._published:
                self._tell()  # who comes later hears it from here, also when who changed it has gone

    def keep(self) -> None:
        """Keep the room for the next start; what can't be written is told by the settings."""
        if self._map.revision != self._kept:
            self._kept = self._map.revision
            with suppress(SettingsError):
                self._settings.set(KEPT, self._map.message())

    def close(self) -> None:
        """Keep the room and leave its topic."""
        self.keep()
        if self._publisher is not None:
            self._publisher.close()

    def _tell(self) -> bool:
        self._published = self._map.revision
        if self._publisher is not None:
            with suppress(NepError):
                self._publisher.publish(self._map.message())
        return True


def _touches(thing: Box | Person, x: float, y: float, radius: float) -> bool:
    if isinstance(thing, Box):
        return thing.distance_to(x, y) < radius
    return math.hypot(thing.x - x, thing.y - y) < thing.radius + radius
