"""Where the things of the shared room are: a map that everybody changes and merges, the last writer wins.

Each thing has the time (ns since 1970) of its last change. Who changes something publishes the whole map on
`TOPIC`; who hears one takes over what is newer. So all have the same room, in whatever order messages come,
and nobody owns it (ADR 0022).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from app.robots.description.json_access import finite
from app.robots.virtual.room import Ball, Box, Marker, Person, Room, Thing

TOPIC = "/room"
ROBOTS_TOPIC = "/room/robots"
KINDS = ("ball", "person", "marker", "table", "shelf")
MOST = 60
MOST_OF_A_KIND = 8
LONGEST_NAME = 40
COLOURS = ("#e0474c", "#e2b33c", "#4f8fd0", "#4aa564")
PEOPLE = ("Aiko", "Ben", "Chloe", "Dario", "Emma", "Femi", "Gita", "Hugo")
FIRST_MARKER = 7
_FARTHEST = 100.0


@dataclass(frozen=True, slots=True)
class ThingPlace:
    """One thing as the map has it: its kind, its place (m), whether it was taken away, and when (ns)."""

    name: str
    kind: str
    x: float
    y: float
    changed_ns: int = 0
    gone: bool = False

    @property
    def order(self) -> tuple[int, bool, float, float]:
        """Of two that say something of the same thing, the greater one is believed."""
        return self.changed_ns, self.gone, self.x, self.y


def kind_of(thing: Thing) -> str:
    """Its kind, as maps and drawings name it."""
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
    """The things of the room. The owner holds a lock around every call."""

    def __init__(self, start: Room | None = None, clock_ns: Callable[[], int] = time.time_ns) -> None:
        """The room is ``start`` until somebody changes it; ``clock_ns`` tells ns since 1970."""
        self.start = start if start is not None else Room()
        self._clock_ns = clock_ns
        first_ns = 0 if self.start == Room() else clock_ns()  # another start than usual is a change, too
        self._things = {
            thing.name: ThingPlace(thing.name, kind_of(thing), thing.x, thing.y, first_ns)
            for thing in self.start.things
        }
        self.revision = 0

    # -- what a person or a robot changes ---------------------------------------------------------

    def move(self, name: str, x: float, y: float) -> bool:
        """A thing is elsewhere now, inside the walls; False when nothing has changed."""
        moved = self.room().moved(name, x, y)
        return self.follow(moved)

    def follow(self, room: Room) -> bool:
        """Take over the places of all things in a room; False when they are where they were."""
        changed = False
        for thing in room.things:
            known = self._things.get(thing.name)
            if known is not None and not known.gone and (known.x, known.y) != (thing.x, thing.y):
                self._put(replace(known, x=thing.x, y=thing.y))
                changed = True
        return changed

    def add(self, kind: str, x: float, y: float) -> str | None:
        """Put one more thing of a kind there; its name, or None when there are enough of them."""
        there = {each.name for each in self._things.values() if not each.gone}
        free = [name for name in _names(kind) if name not in there]
        if not free:
            return None
        self._put(ThingPlace(free[0], kind, x, y))
        self.move(free[0], x, y)
        return free[0]

    def remove(self, name: str) -> bool:
        """Take a thing away; False when it is not there."""
        known = self._things.get(name)
        if known is None or known.gone:
            return False
        self._put(replace(known, gone=True))
        return True

    def put_back(self) -> None:
        """Everything is where it was at the start; what was added goes."""
        first = {thing.name: thing for thing in self.start.things}
        for known in list(self._things.values()):
            thing = first.get(known.name)
            if thing is None:
                self._put(replace(known, gone=True))
            else:
                self._put(replace(known, x=thing.x, y=thing.y, gone=False))

    def _put(self, thing: ThingPlace) -> None:
        before = self._things.get(thing.name)
        newest = before.changed_ns + 1 if before is not None else 1
        self._things[thing.name] = replace(thing, changed_ns=max(self._clock_ns(), newest))
        self.revision += 1

    # -- what others say --------------------------------------------------------------------------

    def merge(self, message: Mapping[str, object]) -> bool:
        """Take over what is newer in somebody's map; False when nothing is. What is damaged is left out."""
        told = message.get("things")
        changed = False
        for thing in _parsed(told if isinstance(told, Sequence) and not isinstance(told, str) else ()):
            known = self._things.get(thing.name)
            if known is None and len(self._things) >= MOST:
                continue
            if known is None or (thing.kind == known.kind and thing.order > known.order):
                self._things[thing.name] = thing
                changed = True
        self.revision += changed
        return changed

    def message(self) -> dict[str, object]:
        """The whole map, as it is published and kept."""
        return {"things": [asdict(thing) for thing in self._things.values()]}

    # -- what it means ----------------------------------------------------------------------------

    def room(self) -> Room:
        """The room with every thing in its place."""
        balls, people, markers, boxes = [], [], [], []
        for made in filter(None, map(self._made, self._things.values())):
            match made:
                case Ball():
                    balls.append(made)
                case Person():
                    people.append(made)
                case Marker():
                    markers.append(made)
                case Box():
                    boxes.append(made)
        empty = replace(
            self.start, balls=tuple(balls), people=tuple(people), markers=tuple(markers), boxes=tuple(boxes)
        )
        for name in [thing.name for thing in empty.things]:
            placed = self._things[name]
            empty = empty.moved(name, placed.x, placed.y)
        return empty

    def _made(self, placed: ThingPlace) -> Thing | None:
        if placed.gone:
            return None
        like = self.start.thing(placed.name)
        if like is not None and like.name == placed.name:
            return replace(like, x=placed.x, y=placed.y)
        return _new(placed)


def _new(placed: ThingPlace) -> Thing | None:
    number = _number(placed.name)
    match placed.kind:
        case "ball":
            return Ball(placed.name, placed.x, placed.y, 0.15, COLOURS[(number - 1) % len(COLOURS)])
        case "person":
            at = PEOPLE.index(placed.name) if placed.name in PEOPLE else number
            return Person(placed.name, placed.x, placed.y, 1.24 + 0.1 * (at % 3))
        case "marker":
            return Marker(number % 50, placed.x, placed.y, 1.15, 0.36, None)
        case "table":
            return Box("table", placed.x, placed.y, 0.7, 1.1, 0.72, placed.name)
        case "shelf":
            return Box("shelf", placed.x, placed.y, 1.1, 0.36, 1.35, placed.name)
    return None


def _number(name: str) -> int:
    last = name.rpartition(" ")[2]
    return int(last) if last.isdecimal() and len(last) < 4 else 1


def _names(kind: str) -> Sequence[str]:
    """The names that things of a kind have, in the order in which they are given."""
    if kind == "person":
        return PEOPLE
    if kind == "marker":
        return [f"marker {number}" for number in range(FIRST_MARKER, FIRST_MARKER + MOST_OF_A_KIND)]
    return [kind, *(f"{kind} {number}" for number in range(2, MOST_OF_A_KIND + 1))] if kind in KINDS else []


def _parsed(told: Sequence[object]) -> Iterator[ThingPlace]:
    for one in told[:MOST]:
        if not isinstance(one, Mapping):
            continue
        name, kind, x, y = (one.get(key) for key in ("name", "kind", "x", "y"))
        changed_ns = one.get("changed_ns")
        if (
            isinstance(name, str)
            and 0 < len(name) <= LONGEST_NAME
            and isinstance(kind, str)
            and kind in KINDS
            and _is_place(x)
            and _is_place(y)
            and isinstance(changed_ns, int)
            and 0 <= changed_ns < 1 << 62
        ):
            yield ThingPlace(name, kind, float(x), float(y), changed_ns, one.get("gone") is True)  # type: ignore[arg-type]


def _is_place(value: object) -> bool:
    place = finite(value)
    return place is not None and abs(place) < _FARTHEST
