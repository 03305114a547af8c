"""Bounded store of blackboard entries by key, with expiry. Performs no I/O. Not thread-safe.

Entries form a tree of names, so that finding the keys above and below another key takes constant time.
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
from nep.programs.blackboard.keys import Key, key_matches, key_text, literal_prefix
from nep.programs.blackboard.values import is_same, size_of

AgeBy = Literal["stamp", "arrival"]
"""Moment from which an age is counted: the publisher's time stamp or the arrival."""
Cause = Literal["new", "changed", "replaced", "removed", "expired", "dropped"]
_ENTRY_BYTES = 600
_NAME_BYTES = 100
_MAX_STALE_EXPIRIES = 1_000


@dataclass(frozen=True)
class StoredEntry:
    """Stored value of a key.

    Attributes:
        key: Key of the value.
        value: Copy of the value.
        age_start: Time at which the value's age starts (blackboard's clock).
        age_by: Source of `age_start`, as in `BlackboardEntry.age_by`.
        expires_at: Time at which the value expires (blackboard's clock); infinite for no expiry.
        stamp_ns: Publisher's time stamp (ns since 1970), if any.
        publisher: Id of the publisher, if any.
        source: Topic from which the value was received, or "".
        robot: Robot that perceived the value, or "".
    """

    key: Key
    value: object
    age_start: float
    age_by: AgeBy = "arrival"
    expires_at: float = math.inf
    stamp_ns: int | None = None
    publisher: int | None = None
    source: str = ""
    robot: str = ""
    bytes: int = field(init=False)
    """Approximate memory use of the entry in bytes."""

    def __post_init__(self) -> None:
        key_bytes = _NAME_BYTES * len(self.key) + sum(map(len, self.key))
        object.__setattr__(self, "bytes", _ENTRY_BYTES + key_bytes + size_of(self.value))

    def age_s(self, now: float) -> float:
        """Return the age in seconds at `now`.

        The age is 0 if it starts in the future because a clock was set back.
        """
        return max(0.0, now - self.age_start)


class EntryChange(NamedTuple):
    """Change of an entry. The key has no value any more unless `cause` is "new" or "changed"."""

    entry: StoredEntry
    cause: Cause


class _Tree(dict[str, "StoredEntry | _Tree"]):
    """Tree of entries: maps each name to an entry or to the subtree below it."""


class Entries:
    """Newest entry of each key.

    Args:
        max_keys: Maximum number of keys. When it is exceeded, the least recently updated entries are
            dropped and counted.
        max_bytes: Maximum memory use in bytes, enforced in the same way.
    """

    def __init__(self, max_keys: int, max_bytes: int) -> None:
        self._max_keys = max_keys
        self._max_bytes = max_bytes
        self._tree = _Tree()
        self._entries_by_key: OrderedDict[Key, StoredEntry] = OrderedDict()
        """Entries by key; the least recently updated entry is the first."""
        self._expiry_heap: list[tuple[float, Key]] = []
        self._expiry_of: dict[Key, float] = {}
        self.bytes = 0
        self.dropped = 0
        self.outdated = 0

    def __len__(self) -> int:
        return len(self._entries_by_key)

    @property
    def next_expiry(self) -> float:
        """Time at which the next entry expires and `expire` must be called; infinite if no entry expires."""
        return self._expiry_heap[0][0] if self._expiry_heap else math.inf

    def rebuilt_copy(self) -> Entries:
        """Return a copy with a new tree, because a fork may have interrupted an update of the tree."""
        copy = Entries(self._max_keys, self._max_bytes)
        for entry in list(self._entries_by_key.values()):
            copy.store(entry, -math.inf)
        copy.dropped, copy.outdated = self.dropped, self.outdated
        return copy

    # ---- reading

    def get(self, key: Key) -> StoredEntry | None:
        """Return the entry of a key, or None. Keys below it are ignored."""
        return self._entries_by_key.get(key)

    def entries_below(self, key: Key) -> Iterator[StoredEntry]:
        """Yield the entry of a key, or the entries of all keys below it."""
        subtree = self._find(key)
        if isinstance(subtree, StoredEntry):
            yield subtree
        elif subtree is not None:
            yield from _entries_in(subtree)

    def entries_matching(self, pattern: Key) -> Iterator[StoredEntry]:
        """Yield the entries whose keys match a pattern, in tree order."""
        prefix = literal_prefix(pattern)
        entries = self.entries_below(prefix)
        if pattern == (*prefix, "**"):
            return entries
        return (each for each in entries if key_matches(pattern, each.key))

    def _find(self, key: Key) -> StoredEntry | _Tree | None:
        subtree: StoredEntry | _Tree | None = self._tree
        for name in key:
            if not isinstance(subtree, _Tree):
                return None
            subtree = subtree.get(name)
        return subtree

    # ---- changing

    def store(self, entry: StoredEntry, now: float) -> list[EntryChange]:
        """Store an entry and return the changes.

        An entry that has expired, or is older than another publisher's entry for the key, is not stored.
        Entries of keys above and below are replaced. Raises `BadValueError` if the entry exceeds the memory
        limit.
        """
        if entry.bytes > self._max_bytes:
            template = _("the value needs {size} bytes, but at most {most} are allowed")
            raise BadValueError(key_text(entry.key), template.format(size=entry.bytes, most=self._max_bytes))
        stored = self.get(entry.key)
        if entry.expires_at <= now or (stored is not None and _is_newer(stored, entry, now)):
            self.outdated += 1
            return []
        changes: list[EntryChange] = []
        if stored is None:
            for conflict in self._conflicting_entries(entry.key):
                self._pop(conflict.key)
                changes.append(EntryChange(conflict, "replaced"))
            changes.append(EntryChange(entry, "new"))
        else:
            self.bytes -= stored.bytes
            if not is_same(stored.value, entry.value):
                changes.append(EntryChange(entry, "changed"))
        self._insert(entry)
        while len(self._entries_by_key) > self._max_keys or self.bytes > self._max_bytes:
            changes.append(EntryChange(self._pop(next(iter(self._entries_by_key))), "dropped"))
            self.dropped += 1
        return changes

    def has_below(self, key: Key) -> bool:
        """Return True if there are entries below a key, not counting the key itself."""
        return isinstance(self._find(key), _Tree)

    def remove(self, key: Key) -> list[EntryChange]:
        """Remove the entries of a key and of all keys below it; return the changes."""
        return [EntryChange(self._pop(each.key), "removed") for each in list(self.entries_below(key))]

    def expire(self, now: float) -> list[EntryChange]:
        """Remove expired entries; return the changes."""
        changes = []
        while self._expiry_heap and self._expiry_heap[0][0] <= now:
            expires_at, key = heapq.heappop(self._expiry_heap)
            if self._expiry_of.get(key) != expires_at:  # superseded by an earlier expiry
                continue
            del self._expiry_of[key]
            entry = self.get(key)
            if entry is None or math.isinf(entry.expires_at):
                continue
            if entry.expires_at > now:  # the entry was updated in the meantime
                self._add_expiry(entry)
            else:
                changes.append(EntryChange(self._pop(key), "expired"))
        return changes

    def _conflicting_entries(self, key: Key) -> list[StoredEntry]:
        subtree: StoredEntry | _Tree = self._tree
        for name in key:
            if isinstance(subtree, StoredEntry):
                return [subtree]
            child = subtree.get(name)
            if child is None:
                return []
            subtree = child
        return [subtree] if isinstance(subtree, StoredEntry) else list(_entries_in(subtree))

    def _insert(self, entry: StoredEntry) -> None:
        branch = self._tree
        for name in entry.key[:-1]:
            child = branch.setdefault(name, _Tree())
            if isinstance(child, StoredEntry):  # unreachable: conflicting entries were removed
                raise TypeError(entry.key)
            branch = child
        branch[entry.key[-1]] = entry
        self._entries_by_key[entry.key] = entry
        self._entries_by_key.move_to_end(entry.key)
        self.bytes += entry.bytes
        if not math.isinf(entry.expires_at):
            self._add_expiry(entry)

    def _add_expiry(self, entry: StoredEntry) -> None:
        if entry.expires_at >= self._expiry_of.get(entry.key, math.inf):
            return
        if (
            len(self._expiry_heap) > 2 * len(self._entries_by_key) + _MAX_STALE_EXPIRIES
        ):  # drop stale heap entries of deleted keys
            self._expiry_of = {
                each.key: each.expires_at
                for each in self._entries_by_key.values()
                if each.expires_at < math.inf
            }
            self._expiry_heap = [(expires_at, key) for key, expires_at in self._expiry_of.items()]
            heapq.heapify(self._expiry_heap)
            if entry.key in self._expiry_of:
                return
        self._expiry_of[entry.key] = entry.expires_at
        heapq.heappush(self._expiry_heap, (entry.expires_at, entry.key))

    def _pop(self, key: Key) -> StoredEntry:
        entry = self._entries_by_key.pop(key)
        self.bytes -= entry.bytes
        path = [self._tree]
        for name in key[:-1]:
            child = path[-1][name]
            if isinstance(child, StoredEntry):  # unreachable: it would have been replaced
                raise TypeError(key)
            path.append(child)
        for branch, name in zip(reversed(path), reversed(key), strict=True):
            del branch[name]
            if branch:
                break
        return entry


def _is_newer(stored: StoredEntry, entry: StoredEntry, now: float) -> bool:
    # True if `stored` is newer: `entry` was latched or took a slower path. Messages of one publisher arrive
    # in order, whatever its clock does; `stored` may be in the future if our clock was set back.
    return entry.age_by == stored.age_by == "stamp" and (
        entry.publisher != stored.publisher and entry.age_start < stored.age_start <= now
    )


def _entries_in(tree: _Tree) -> Iterator[StoredEntry]:
    for child in tree.values():
        if isinstance(child, StoredEntry):
            yield child
        else:
            yield from _entries_in(child)
