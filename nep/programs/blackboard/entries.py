"""Entries: the values of a blackboard by their keys, bounded, each as long as it lives. Pure.

For one thread at a time.
They are a tree of names: whether a key stands above or below others must not take longer the more there are.
"""

from __future__ import annotations

import heapq
import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from nep.errors import BadValueError
from nep.i18n import _
from nep.programs.blackboard.keys import Key, key_matches, key_text, literal_levels
from nep.programs.blackboard.values import is_same, size_of

__all__ = ["AgeBy", "Cause", "Entries", "EntryChange", "StoredEntry"]

AgeBy = Literal["stamp", "arrival"]
"""What an age counts from: when the publisher sent it, or when it came."""
Cause = Literal["new", "changed", "replaced", "removed", "expired", "dropped"]
_ENTRY_BYTES = 600
_NAME_BYTES = 100
_SPARE_ENDS = 1_000


@dataclass(frozen=True)
class StoredEntry:
    """A value. `since` is when its age began, by the blackboard's clock; `expires` when it is forgotten."""

    key: Key
    value: object
    since: float
    age_by: AgeBy = "arrival"
    expires: float = math.inf
    stamp_ns: int | None = None
    publisher: int | None = None
    source: str = ""
    robot: str = ""
    bytes: int = field(init=False)
    """About so much memory does it take."""

    def __post_init__(self) -> None:
        names = _NAME_BYTES * len(self.key) + sum(map(len, self.key))
        object.__setattr__(self, "bytes", _ENTRY_BYTES + names + size_of(self.value))

    def age_s(self, now: float) -> float:
        """0 when the clock has gone back meanwhile."""
        return max(0.0, now - self.since)


class EntryChange(NamedTuple):
    """What became of an entry; it is there no more unless the cause is "new" or "changed"."""

    entry: StoredEntry
    cause: Cause


class _Tree(dict[str, "StoredEntry | _Tree"]):
    """Names that stand behind one."""


class Entries:
    """The newest entry of each key. The oldest are dropped when there are too many, and counted."""

    def __init__(self, max_keys: int, max_bytes: int) -> None:
        self._max_keys = max_keys
        self._max_bytes = max_bytes
        self._tree = _Tree()
        self._by_age: OrderedDict[Key, StoredEntry] = OrderedDict()
        self._ends: list[tuple[float, Key]] = []
        self._end_of: dict[Key, float] = {}
        self.bytes = 0
        self.dropped = 0
        self.outdated = 0

    def __len__(self) -> int:
        return len(self._by_age)

    @property
    def next_end(self) -> float:
        """When it may be time for `expire`; infinite when nothing ends."""
        return self._ends[0][0] if self._ends else math.inf

    def rebuilt(self) -> Entries:
        """A new one, of what this one has by now; another thread was changing it, and will not go on."""
        made = Entries(self._max_keys, self._max_bytes)
        for entry in list(self._by_age.values()):
            made.put(entry, -math.inf)
        made.dropped, made.outdated = self.dropped, self.outdated
        return made

    # ---- reading

    def get(self, key: Key) -> StoredEntry | None:
        """The entry of just this key."""
        return self._by_age.get(key)

    def below(self, key: Key) -> Iterator[StoredEntry]:
        """The entry of this key, or those of longer ones that begin so."""
        found = self._at(key)
        if isinstance(found, StoredEntry):
            yield found
        elif found is not None:
            yield from _all_of(found)

    def matching(self, pattern: Key) -> Iterator[StoredEntry]:
        """Those whose key matches; in the order of the tree."""
        beginning = literal_levels(pattern)
        found = self.below(beginning)
        if pattern == (*beginning, "**"):
            return found
        return (each for each in found if key_matches(pattern, each.key))

    def _at(self, key: Key) -> StoredEntry | _Tree | None:
        found: StoredEntry | _Tree | None = self._tree
        for name in key:
            if not isinstance(found, _Tree):
                return None
            found = found.get(name)
        return found

    # ---- changing

    def put(self, entry: StoredEntry, now: float) -> list[EntryChange]:
        """Keep it, unless a newer one of another publisher is there; what changed by that.

        What stands in its way goes: the values above and below its key. Raises `BadValueError` for one that
        takes more room than there is.
        """
        if entry.bytes > self._max_bytes:
            said = _("it takes {size} bytes, and there is room for {most}")
            raise BadValueError(key_text(entry.key), said.format(size=entry.bytes, most=self._max_bytes))
        before = self.get(entry.key)
        if entry.expires <= now or (before is not None and _is_newer(before, entry, now)):
            self.outdated += 1
            return []
        changes: list[EntryChange] = []
        if before is None:
            for each in self._in_the_way(entry.key):
                self._take(each.key)
                changes.append(EntryChange(each, "replaced"))
            changes.append(EntryChange(entry, "new"))
        else:
            self.bytes -= before.bytes
            if not is_same(before.value, entry.value):
                changes.append(EntryChange(entry, "changed"))
        self._insert(entry)
        while len(self._by_age) > self._max_keys or self.bytes > self._max_bytes:
            changes.append(EntryChange(self._take(next(iter(self._by_age))), "dropped"))
            self.dropped += 1
        return changes

    def has_below(self, key: Key) -> bool:
        """Whether longer keys begin with this one."""
        return isinstance(self._at(key), _Tree)

    def remove(self, key: Key) -> list[EntryChange]:
        """Forget this one and those below it."""
        return [EntryChange(self._take(each.key), "removed") for each in list(self.below(key))]

    def expire(self, now: float) -> list[EntryChange]:
        """Forget those whose time is over."""
        changes = []
        while self._ends and self._ends[0][0] <= now:
            end, key = heapq.heappop(self._ends)
            if self._end_of.get(key) != end:  # an earlier one was noted since
                continue
            del self._end_of[key]
            entry = self.get(key)
            if entry is None or math.isinf(entry.expires):
                continue
            if entry.expires > now:  # it was told anew
                self._note_end(entry)
            else:
                changes.append(EntryChange(self._take(key), "expired"))
        return changes

    def _in_the_way(self, key: Key) -> list[StoredEntry]:
        found: StoredEntry | _Tree = self._tree
        for name in key:
            if isinstance(found, StoredEntry):
                return [found]
            after = found.get(name)
            if after is None:
                return []
            found = after
        return [found] if isinstance(found, StoredEntry) else list(_all_of(found))

    def _insert(self, entry: StoredEntry) -> None:
        at = self._tree
        for name in entry.key[:-1]:
            after = at.setdefault(name, _Tree())
            if isinstance(after, StoredEntry):  # cannot be: those in the way are gone
                raise TypeError(entry.key)
            at = after
        at[entry.key[-1]] = entry
        self._by_age[entry.key] = entry
        self._by_age.move_to_end(entry.key)
        self.bytes += entry.bytes
        if not math.isinf(entry.expires):
            self._note_end(entry)

    def _note_end(self, entry: StoredEntry) -> None:
        """One end for each key, which is looked at again when it comes."""
        if entry.expires >= self._end_of.get(entry.key, math.inf):
            return
        if len(self._ends) > 2 * len(self._by_age) + _SPARE_ENDS:  # of keys that are gone
            self._end_of = {
                each.key: each.expires for each in self._by_age.values() if each.expires < math.inf
            }
            self._ends = [(end, key) for key, end in self._end_of.items()]
            heapq.heapify(self._ends)
            if entry.key in self._end_of:
                return
        self._end_of[entry.key] = entry.expires
        heapq.heappush(self._ends, (entry.expires, entry.key))

    def _take(self, key: Key) -> StoredEntry:
        """Remove it, and names that nothing stands behind any more."""
        entry = self._by_age.pop(key)
        self.bytes -= entry.bytes
        path = [self._tree]
        for name in key[:-1]:
            after = path[-1][name]
            if isinstance(after, StoredEntry):  # cannot be: it would have been replaced
                raise TypeError(key)
            path.append(after)
        for at, name in zip(reversed(path), reversed(key), strict=True):
            del at[name]
            if at:
                break
        return entry


def _is_newer(before: StoredEntry, entry: StoredEntry, now: float) -> bool:
    """Whether `entry` is older than what is there: it was kept for us, or came by a slower way.

    A publisher's own messages come in order, whatever became of its clock; and what is there may be of the
    future, when our own clock went back.
    """
    return entry.age_by == before.age_by == "stamp" and (
        entry.publisher != before.publisher and entry.since < before.since <= now
    )


def _all_of(tree: _Tree) -> Iterator[StoredEntry]:
    for each in tree.values():
        if isinstance(each, StoredEntry):
            yield each
        else:
            yield from _all_of(each)
