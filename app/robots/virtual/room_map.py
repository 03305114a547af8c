"""Replicated map of the objects in the shared room: a last-writer-wins register for each object.

Each object has the time of its last change. A participant that changes an object publishes the whole map on
`TOPIC`; receivers merge newer entries. All participants therefore converge to the same room, whatever the
order of messages, and no participant owns the room (ADR 0022).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from app.robots.description.json_access import finite_float
from app.robots.virtual.room import Ball, Box, Marker, Person, Room, Thing

TOPIC = "/room"
ROBOTS_TOPIC = "/room/robots"
KINDS = ("ball", "person", "marker", "table", "shelf")
MAX_OBJECTS = 60
MAX_PER_KIND = 8
MAX_NAME_LENGTH = 40
BALL_COLOURS = ("#e0474c", "#e2b33c", "#4f8fd0", "#4aa564")
PERSON_NAMES = ("Aiko", "Ben", "Chloe", "Dario", "Emma", "Femi", "Gita", "Hugo")
FIRST_MARKER_ID = 7
_MAX_COORDINATE_M = 100.0


@dataclass(frozen=True, slots=True)
class MapEntry:
    """Entry of an object in the map.

    Attributes:
        name: Unique name.
        kind: One of `KINDS`.
        x: Position in m.
        y: Position in m.
        changed_ns: Time of the last change (ns since 1970).
        gone: True if the object was removed.
    """

    name: str
    kind: str
    x: float
    y: float
    changed_ns: int = 0
    gone: bool = False

    @property
    def merge_key(self) -> tuple[int, bool, float, float]:
        """Merge key: of two entries for the same object, the entry with the greater key wins."""
        return self.changed_ns, self.gone, self.x, self.y


def kind_of(thing: Thing) -> str:
    """Return the kind of an object in maps and drawings, such as "ball"."""
    match thing:
        case Ball():
            return "ball"
        case Person():
            return "person"
        case Marker():
            return "marker"
        case _:
            return thing.kind


class RoomMap:
    """Objects of the shared room. Not thread-safe: hold the owner's lock around every call.

    Args:
        start: Room at the start (default: `Room()`).
        clock_ns: Returns the time (ns since 1970).
    """

    def __init__(self, start: Room | None = None, clock_ns: Callable[[], int] = time.time_ns) -> None:
        self.start = start if start is not None else Room()
        self._clock_ns = clock_ns
        first_ns = 0 if self.start == Room() else clock_ns()  # a custom start counts as a change
        self._entries = {
            thing.name: MapEntry(thing.name, kind_of(thing), thing.x, thing.y, first_ns)
            for thing in self.start.things
        }
        self.revision = 0

    # -- local changes ------------------------------------------------------------

    def move(self, name: str, x: float, y: float) -> bool:
        """Move an object, limited to the room; return True if its position has changed."""
        moved_room = self.room().with_moved(name, x, y)
        return self.update_positions(moved_room)

    def update_positions(self, room: Room) -> bool:
        """Update the positions of all objects from a room; return True if any position has changed."""
        has_changed = False
        for thing in room.things:
            entry = self._entries.get(thing.name)
            if entry is not None and not entry.gone and (entry.x, entry.y) != (thing.x, thing.y):
                self._set_entry(replace(entry, x=thing.x, y=thing.y))
                has_changed = True
        return has_changed

    def add(self, kind: str, x: float, y: float) -> str | None:
        """Add an object at a position in m, limited to the room, and return its name.

        Returns None if the kind is unknown or if there are too many objects of this kind.
        """
        existing = {each.name for each in self._entries.values() if not each.gone}
        free_names = [name for name in _names(kind) if name not in existing]
        if not free_names:
            return None
        self._set_entry(MapEntry(free_names[0], kind, x, y))
        self.move(free_names[0], x, y)
        return free_names[0]

    def remove(self, name: str) -> bool:
        """Remove an object; return False if it doesn't exist."""
        entry = self._entries.get(name)
        if entry is None or entry.gone:
            return False
        self._set_entry(replace(entry, gone=True))
        return True

    def reset(self) -> None:
        """Restore the initial room; added objects are removed."""
        start_things = {thing.name: thing for thing in self.start.things}
        for entry in list(self._entries.values()):
            thing = start_things.get(entry.name)
            if thing is None:
                self._set_entry(replace(entry, gone=True))
            else:
                self._set_entry(replace(entry, x=thing.x, y=thing.y, gone=False))

    def _set_entry(self, entry: MapEntry) -> None:
        previous = self._entries.get(entry.name)
        min_changed_ns = previous.changed_ns + 1 if previous is not None else 1
        self._entries[entry.name] = replace(entry, changed_ns=max(self._clock_ns(), min_changed_ns))
        self.revision += 1

    # -- replication ------------------------------------------------------------------------------

    def merge(self, message: Mapping[str, object]) -> bool:
        """Merge newer entries of another participant's map; return True if the map has changed.

        Args:
            message: Payload created by `RoomMap.message`. Invalid entries, entries that change the kind
                of an object, and new objects beyond `MAX_OBJECTS` are ignored.
        """
        raw_entries = message.get("things")
        has_changed = False
        for entry in _parse_entries(
            raw_entries if isinstance(raw_entries, Sequence) and not isinstance(raw_entries, str) else ()
        ):
            existing = self._entries.get(entry.name)
            if existing is None and len(self._entries) >= MAX_OBJECTS:
                continue
            if existing is None or (entry.kind == existing.kind and entry.merge_key > existing.merge_key):
                self._entries[entry.name] = entry
                has_changed = True
        self.revision += has_changed
        return has_changed

    def message(self) -> dict[str, object]:
        """Return the whole map as a payload for publishing and saving."""
        return {"things": [asdict(entry) for entry in self._entries.values()]}

    # -- conversion --------------------------------------------------------------------------------

    def room(self) -> Room:
        """Return the room with all objects at their current positions."""
        balls, people, markers, boxes = [], [], [], []
        for thing in filter(None, map(self._create_thing, self._entries.values())):
            match thing:
                case Ball():
                    balls.append(thing)
                case Person():
                    people.append(thing)
                case Marker():
                    markers.append(thing)
                case Box():
                    boxes.append(thing)
        room = replace(
            self.start, balls=tuple(balls), people=tuple(people), markers=tuple(markers), boxes=tuple(boxes)
        )
        for name in [thing.name for thing in room.things]:
            entry = self._entries[name]
            room = room.with_moved(name, entry.x, entry.y)
        return room

    def _create_thing(self, entry: MapEntry) -> Thing | None:
        if entry.gone:
            return None
        original = self.start.thing(entry.name)
        if original is not None and original.name == entry.name:
            return replace(original, x=entry.x, y=entry.y)
        return _create_added_thing(entry)


def _create_added_thing(entry: MapEntry) -> Thing | None:
    number = _number_in_name(entry.name)
    match entry.kind:
        case "ball":
            return Ball(entry.name, entry.x, entry.y, 0.15, BALL_COLOURS[(number - 1) % len(BALL_COLOURS)])
        case "person":
            index = PERSON_NAMES.index(entry.name) if entry.name in PERSON_NAMES else number
            return Person(entry.name, entry.x, entry.y, 1.24 + 0.1 * (index % 3))
        case "marker":
            return Marker(number % 50, entry.x, entry.y, 1.15, 0.36, None)
        case "table":
            return Box("table", entry.x, entry.y, 0.7, 1.1, 0.72, entry.name)
        case "shelf":
            return Box("shelf", entry.x, entry.y, 1.1, 0.36, 1.35, entry.name)
    return None


def _number_in_name(name: str) -> int:
    suffix = name.rpartition(" ")[2]
    return int(suffix) if suffix.isdecimal() and len(suffix) < 4 else 1


def _names(kind: str) -> Sequence[str]:
    if kind == "person":
        return PERSON_NAMES
    if kind == "marker":
        return [f"marker {number}" for number in range(FIRST_MARKER_ID, FIRST_MARKER_ID + MAX_PER_KIND)]
    return [kind, *(f"{kind} {number}" for number in range(2, MAX_PER_KIND + 1))] if kind in KINDS else []


def _parse_entries(raw_entries: Sequence[object]) -> Iterator[MapEntry]:
    for fields in raw_entries[:MAX_OBJECTS]:
        if not isinstance(fields, Mapping):
            continue
        name, kind, x, y = (fields.get(key) for key in ("name", "kind", "x", "y"))
        changed_ns = fields.get("changed_ns")
        if (
            isinstance(name, str)
            and 0 < len(name) <= MAX_NAME_LENGTH
            and isinstance(kind, str)
            and kind in KINDS
            and _is_coordinate(x)
            and _is_coordinate(y)
            and isinstance(changed_ns, int)
            and 0 <= changed_ns < 1 << 62
        ):
            yield MapEntry(name, kind, float(x), float(y), changed_ns, fields.get("gone") is True)  # type: ignore[arg-type]


def _is_coordinate(value: object) -> bool:
    coordinate = finite_float(value)
    return coordinate is not None and abs(coordinate) < _MAX_COORDINATE_M
