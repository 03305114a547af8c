"""Blackboard: newest values of topics by key, with their ages."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

from nep.backends.connection import Configuration
from nep.errors import BadValueError, ClosedError, NepError, NoValueError, WaitTimeoutError
from nep.i18n import _
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.timer import Timer
from nep.programs.blackboard.ages import age_start
from nep.programs.blackboard.entries import AgeBy, Cause, Entries, EntryChange, StoredEntry
from nep.programs.blackboard.keys import Key, key_matches, key_text, parse_key
from nep.programs.blackboard.values import deep_copy, leaves
from nep.programs.blackboard.watch import BlackboardWatch, MessageMapping, PerceivedValue
from nep.protocol.topic_pattern import is_pattern
from nep.protocol.wire import check_topic
from nep.system import forks
from nep.system.arguments import (
    check_at_least,
    check_function,
    check_optional_time_limit,
    check_period,
    check_plain_function,
)

if TYPE_CHECKING:
    from typing_extensions import Self


MAX_KEYS = 100_000
MAX_BYTES = 256 * 2**20
_MAX_CHANGES = 10_000
_WAIT_SLICE_S = 0.1
"""Maximum duration of a single wait in seconds, so that a closed node and Ctrl+C on Windows are noticed."""
_IMMEDIATE_DELAY_S = 1e-6
_MIN_TIMER_S = 0.001
_MAX_SUGGESTIONS = 1_000
_MISSING = object()


@dataclass(frozen=True)
class BlackboardEntry:
    """Value of a key at the time of the query.

    Attributes:
        key: Key, such as ``human.1.position``.
        value: Copy of the value.
        age_s: Age in seconds.
        age_by: "stamp" if the age starts at the publisher's time stamp; "arrival" if it starts at the
            arrival, because there is no stamp or the clocks don't agree.
        source: Topic from which the value was received; "" if it was set with `Blackboard.put`.
        robot: Robot that perceived the value; "" if the message names none.
        stamp_ns: Publisher's time stamp (ns since 1970), if any.
        left_s: Seconds until the value expires; infinite if it doesn't expire.
    """

    key: str
    value: object
    age_s: float
    age_by: AgeBy
    source: str
    robot: str
    stamp_ns: int | None
    left_s: float


@dataclass(frozen=True)
class BlackboardChange:
    """Change of a key's value.

    Attributes:
        entry: New entry, or the last one if the key has no value any more.
        cause: "new" or "changed"; or, if the key has no value any more, "expired", "removed", "dropped"
            (memory limit) or "replaced" (by a value of a key above or below).
    """

    entry: BlackboardEntry
    cause: Cause

    @property
    def key(self) -> str:
        """Key that changed."""
        return self.entry.key

    @property
    def value(self) -> object:
        """New value; None if the key has no value any more."""
        return None if self.is_gone else self.entry.value

    @property
    def is_gone(self) -> bool:
        """True if the key has no value any more."""
        return self.cause not in {"new", "changed"}


OnChange = Callable[[BlackboardChange], object]


class _Observer(NamedTuple):
    pattern: Key
    callback: OnChange


class Blackboard:
    """Store of the newest value of each key, from watched topics and from `put`. Thread-safe.

    Watched messages are stored by a thread of the node; only the callbacks of `on_change` need `Node.spin`.
    Values are copied when they are stored and when they are read.

    Args:
        node: Node that subscribes to the watched topics; None for a blackboard without topics.
        max_keys: Maximum number of keys. When it is exceeded, the least recently updated values are dropped
            and counted in `dropped`.
        max_bytes: Approximate memory limit in bytes, enforced in the same way.
        clock: Monotonic clock in seconds.
        wall_clock_ns: Clock in nanoseconds since 1970.

    Example:
        ::

            with nep.node("watcher") as node, nep.Blackboard(node) as board:
                board.watch("/perception/humans", key="human")
                print(board.wait_for("human.1.position"), board.age_s("human.1.position"))
    """

    def __init__(
        self,
        node: Node | None = None,
        *,
        max_keys: int = MAX_KEYS,
        max_bytes: int = MAX_BYTES,
        clock: Callable[[], float] = time.monotonic,
        wall_clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._node = node
        self._clock = check_function("clock", clock)
        self._wall_clock_ns = check_function("wall_clock_ns", wall_clock_ns)
        self._max_bytes = check_at_least("max_bytes", max_bytes, 1)
        self._entries = Entries(check_at_least("max_keys", max_keys, 1), self._max_bytes)
        self._lock = threading.Lock()
        self._updated = threading.Condition(self._lock)
        self._version = 0
        self._is_closed = False
        self._generation = forks.current_generation()
        self._watches: tuple[BlackboardWatch, ...] = ()
        self._ignored_publisher_ids: frozenset[int] = frozenset()
        self._observers: tuple[_Observer, ...] = ()
        self._pending: deque[tuple[_Observer, EntryChange]] = deque()
        self._pending_bytes = 0
        self._timer_at = math.inf
        self.changes_dropped = 0
        """Number of changes that were not passed to callbacks, because the node doesn't spin fast enough."""
        forks.call_in_child(self._close_in_child)

    # ---- writing

    def watch(
        self,
        topic: str,
        msg_type: str = "json",
        configuration: Configuration | None = None,
        *,
        key: str | None = None,
        fields: Sequence[str] | Mapping[str, str] | None = None,
        each: str = "",
        lives_s: float | None = None,
    ) -> BlackboardWatch:
        """Store the messages of a topic or pattern. Each field of a map is stored under its own key.

        Args:
            topic: Topic or pattern.
            msg_type: Message type.
            configuration: Result of `Node.hybrid` or `Node.direct`. Default: the node's master.
            key: Key to store messages under. A name in braces is replaced with that field of the
                message, as in ``human.{id}``. With None, perceptions of RIZE are stored at the root
                (``touched.head``) and other messages under the topic's name.
            fields: Fields to store, or a mapping from fields to other names (default: all fields).
            each: Field that contains a list of items to store one by one; "" stores the message itself.
            lives_s: Seconds after which a value expires unless it is updated; None for no expiry.

        Returns:
            The watch, which counts messages. Close it to stop storing.

        Raises:
            BadKeyError: The key is invalid.
            NepError: The blackboard has no node, or the subscription failed (see `Node.new_sub`).
        """
        node = self._node
        if node is None:
            raise NepError(_("this blackboard has no node; create it with 'nep.Blackboard(node)'"))
        lifetime_s = _lifetime_s(lives_s)
        watch = BlackboardWatch(
            topic,
            MessageMapping(key, fields, each),
            lambda message, values: self._store_message(message, values, lifetime_s),
            is_pattern=is_pattern(check_topic(topic)),
        )
        with self._updated:
            self._check_open()
            self._watches = (*self._watches, watch)
        try:
            watch.attach(node.new_sub(topic, msg_type, configuration, sink=watch.store_messages))
        except BaseException:
            with self._updated:
                self._watches = tuple(other for other in self._watches if other is not watch)
            raise
        return watch

    def ignore(self, publisher: int) -> None:
        """Ignore messages of the publisher with this id."""
        with self._updated:
            self._ignored_publisher_ids |= {publisher}

    def put(self, key: str | tuple[str, ...], value: object, *, lives_s: float | None = None) -> None:
        """Store a value. Each field of a map is stored under its own key.

        Keys below `key` that are not in the map are not changed.

        Args:
            key: Key, or a tuple of its names.
            value: Any value; it is copied.
            lives_s: Seconds after which the value expires; None for no expiry.

        Raises:
            BadKeyError: The key is invalid.
            BadValueError: The value is nested too deeply or too large.
        """
        names, lifetime_s = parse_key(key), _lifetime_s(lives_s)
        with self._updated:
            now = self._clock()
            entries = [
                self._entry(each, leaf, now, lifetime_s)
                for each, leaf in leaves(_copy_value(names, value), names)
            ]
        self._store(entries)

    def remove(self, key: str | tuple[str, ...]) -> int:
        """Remove a key and all keys below it; return the number of removed keys."""
        names = parse_key(key)
        with self._updated:
            self._expire_locked()
            removed = self._entries.remove(names)
            self._queue_changes_locked(removed)
        self._schedule_delivery()
        return len(removed)

    def _store_message(self, message: Message, values: Sequence[PerceivedValue], lifetime_s: float) -> None:
        if message.publisher in self._ignored_publisher_ids:
            return
        since, age_by = age_start(message, self._clock(), self._wall_clock_ns())
        problem: NepError | None = None
        entries: list[StoredEntry] = []
        for value in values:
            try:
                key = parse_key(value.key)
                entries.append(
                    StoredEntry(
                        key,
                        _copy_value(key, value.value),
                        since,
                        age_by,
                        since + lifetime_s,
                        message.stamp_ns,
                        message.publisher,
                        message.topic,
                        value.robot,
                    )
                )
            except NepError as error:
                problem = error
        self._store(entries)
        if problem is not None:
            raise problem

    def _entry(self, key: Key, value: object, now: float, lifetime_s: float) -> StoredEntry:
        return StoredEntry(parse_key(key), value, now, expires_at=now + lifetime_s)

    def _store(self, entries: Sequence[StoredEntry]) -> None:
        problem: BadValueError | None = None
        with self._updated:
            now = self._expire_locked()
            for entry in entries:
                is_empty = isinstance(entry.value, dict) and not entry.value
                if is_empty and self._entries.has_below(entry.key):
                    continue  # an empty map doesn't replace keys below it
                try:
                    self._queue_changes_locked(self._entries.store(entry, now))
                except BadValueError as error:
                    problem = error
            self._version += 1
            self._updated.notify_all()
        self._schedule_delivery()
        if problem is not None:
            raise problem

    # ---- reading

    def get(
        self, key: str | tuple[str, ...], default: object = None, *, max_age_s: float | None = None
    ) -> object:
        """Return the value of a key, or a dict of the values below the key.

        Args:
            key: Key, or a tuple of its names.
            default: Value to return if the key has no value, or only values older than `max_age_s`.
            max_age_s: Maximum age in seconds; None for no limit.
        """
        value = self._value_of(parse_key(key), check_optional_time_limit("max_age_s", max_age_s))
        return default if value is _MISSING else value

    def __getitem__(self, key: str | tuple[str, ...]) -> object:
        names = parse_key(key)
        value = self._value_of(names, None)
        if value is _MISSING:
            with self._updated:
                known_keys = [
                    key_text(each.key)
                    for each in islice(self._entries.entries_matching(("**",)), _MAX_SUGGESTIONS)
                ]
            raise NoValueError(key_text(names), known_keys)
        return value

    def __setitem__(self, key: str | tuple[str, ...], value: object) -> None:
        self.put(key, value)

    def __contains__(self, key: object) -> bool:
        return isinstance(key, str | tuple) and self._value_of(parse_key(key), None) is not _MISSING

    def __len__(self) -> int:
        with self._updated:
            self._expire_locked()
            return len(self._entries)

    def age_s(self, key: str | tuple[str, ...]) -> float:
        """Return the age of a key's value, or of the newest value below the key, in seconds.

        The age is infinite if there is no value.
        """
        names = parse_key(key)
        with self._updated:
            now = self._expire_locked()
            return min((each.age_s(now) for each in self._entries.entries_below(names)), default=math.inf)

    def entry(self, key: str | tuple[str, ...]) -> BlackboardEntry | None:
        """Return the entry of a key, or None. Keys below it are ignored."""
        names = parse_key(key)
        with self._updated:
            now = self._expire_locked()
            stored = self._entries.get(names)
        return None if stored is None else _public_entry(stored, now)

    def keys(self, pattern: str = "**") -> list[str]:
        """Return the sorted keys that match a pattern.

        ``*`` stands for one name, ``**`` for any number of names: ``human.*.position``.
        """
        names = parse_key(pattern)
        with self._updated:
            self._expire_locked()
            entries = list(self._entries.entries_matching(names))
        return sorted(key_text(each.key) for each in entries)

    def snapshot(self, pattern: str = "**") -> dict[str, BlackboardEntry]:
        """Return all entries that match a pattern, by key, all taken at the same moment."""
        names = parse_key(pattern)
        with self._updated:
            now = self._expire_locked()
            entries = list(self._entries.entries_matching(names))
        return {
            each.key: each
            for each in sorted((_public_entry(each, now) for each in entries), key=lambda e: e.key)
        }

    def _value_of(self, key: Key, max_age_s: float | None) -> object:
        limit_s = math.inf if max_age_s is None else max_age_s
        with self._updated:
            now = self._expire_locked()
            entries = [each for each in self._entries.entries_below(key) if each.age_s(now) <= limit_s]
        if not entries:
            return _MISSING
        return _compose(entries, key)

    @property
    def bytes(self) -> int:
        """Approximate memory used by the values, in bytes."""
        return self._entries.bytes

    @property
    def dropped(self) -> int:
        """Number of values dropped because of the limits."""
        return self._entries.dropped

    @property
    def outdated(self) -> int:
        """Number of values rejected because a newer value was stored or because the value had expired."""
        return self._entries.outdated

    # ---- waiting and callbacks

    def wait_for(
        self,
        key: str | tuple[str, ...],
        condition: Callable[[object], object] | None = None,
        timeout_s: float | None = None,
    ) -> object:
        """Wait until a key has a value that fulfils a condition, and return the value.

        Args:
            key: Key, or a tuple of its names.
            condition: Predicate of the value, called in the waiting thread after updates; None accepts any
                value. Values that are replaced quickly may be skipped.
            timeout_s: Time limit in seconds; None for no limit.

        Raises:
            WaitTimeoutError: The time limit has passed.
            ClosedError: The blackboard or its node was closed.
        """
        names, limit_s = parse_key(key), check_optional_time_limit("timeout_s", timeout_s)
        if condition is not None:
            check_function("condition", condition)
        deadline = math.inf if limit_s is None else time.monotonic() + limit_s
        while True:
            version = self._version
            value = self._value_of(names, None)
            if value is not _MISSING and (condition is None or condition(value)):
                return value
            self._check_open()
            remaining_s = min(_WAIT_SLICE_S, deadline - time.monotonic())
            if remaining_s <= 0.0:
                raise WaitTimeoutError(key_text(names), limit_s or 0.0)
            with self._updated:
                if self._version == version:
                    self._updated.wait(remaining_s)

    def on_change(self, pattern: str, callback: OnChange) -> Callable[[], None]:
        """Call `callback` with each `BlackboardChange` of matching keys, in the thread that spins the node.

        The callback is called when a value changes or disappears, not for updates with an equal value.
        Exceptions propagate out of `Node.spin`; the remaining changes are delivered by the next call of
        `spin`. Without a node, call `deliver`.

        Args:
            pattern: Keys, with wildcards as for `keys`.
            callback: Function of one `BlackboardChange`.

        Returns:
            A function that removes the callback.
        """
        observer = _Observer(parse_key(pattern), check_plain_function("callback", callback))
        with self._updated:
            self._observers = (*self._observers, observer)

        def remove_observer() -> None:
            with self._updated:
                self._observers = tuple(each for each in self._observers if each is not observer)

        self._schedule_delivery()
        return remove_observer

    def deliver(self) -> int:
        """Call the callbacks for pending changes in this thread, as `Node.spin` does.

        Returns:
            The number of calls.
        """
        with self._updated:
            self._expire_locked()
            pending_count = len(self._pending)
        call_count = 0
        try:
            while call_count < pending_count:
                with self._updated:
                    if not self._pending:
                        break
                    observer, change = self._pending.popleft()
                    self._pending_bytes -= change.entry.bytes
                    is_registered = any(each is observer for each in self._observers)
                    now = self._clock()
                call_count += 1
                if is_registered:
                    observer.callback(BlackboardChange(_public_entry(change.entry, now), change.cause))
        finally:
            self._schedule_delivery()
        return call_count

    def _expire_locked(self) -> float:
        # Call with the lock held. Returns the current time.
        now = self._clock()
        if self._entries.next_expiry <= now:
            removed = self._entries.expire(now)
            if removed:
                self._queue_changes_locked(removed)
        return now

    def _queue_changes_locked(self, changes: Sequence[EntryChange]) -> None:
        # Call with the lock held. Queues changes for callbacks, up to a limit.
        for change in changes:
            for observer in self._observers:
                if key_matches(observer.pattern, change.entry.key):
                    self._pending.append((observer, change))
                    self._pending_bytes += change.entry.bytes
            while len(self._pending) > _MAX_CHANGES or self._pending_bytes > 2 * self._max_bytes:
                _observer, oldest = self._pending.popleft()
                self._pending_bytes -= oldest.entry.bytes
                self.changes_dropped += 1

    def _schedule_delivery(self) -> None:
        node = self._node
        with self._updated:
            if node is None or not self._observers or self._is_closed:
                return
            now = self._clock()
            due = now if self._pending else self._entries.next_expiry
            if math.isinf(due) or self._timer_at <= due:
                return
            self._timer_at = due
            wait_s = _IMMEDIATE_DELAY_S if self._pending else max(_MIN_TIMER_S, due - now)
        timers: list[Timer] = []

        def call() -> None:
            # The list is empty if the timer fires before it is appended; then it fires again at once.
            for timer in timers:
                timer.cancel()
                with self._updated:
                    self._timer_at = math.inf
                self.deliver()

        with suppress(ClosedError):
            timers.append(node.new_timer(wait_s, call))

    # ---- closing

    def _check_open(self) -> None:
        is_open = not self._is_closed and (self._node is None or not self._node.is_closed)
        if not is_open:
            raise ClosedError(_("the blackboard"), is_forked=self._generation.is_inherited)

    def close(self) -> None:
        """Stop watching and wake waiting threads. Values can still be read and stored. Idempotent."""
        with self._updated:
            self._is_closed = True
            watches, self._watches, self._observers = self._watches, (), ()
            self._pending.clear()
            self._pending_bytes = 0
            self._version += 1
            self._updated.notify_all()
        for watch in watches:
            watch.close()

    def _close_in_child(self) -> None:
        # Values can still be read.
        self._is_closed = True
        if self._lock.locked():  # held by a thread of the parent: the tree may be half-updated
            self._entries = self._entries.rebuilt_copy()
        self._lock = threading.Lock()
        self._updated = threading.Condition(self._lock)
        self._observers = ()
        self._pending = deque()
        forks.call_in_child(self._close_in_child)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Blackboard({len(self._entries)} keys)"


def _lifetime_s(lives_s: object) -> float:
    checked_s = check_optional_time_limit("lives_s", lives_s)
    return math.inf if checked_s is None else check_period("lives_s", checked_s)


def _copy_value(key: Key, value: object) -> object:
    try:
        return deep_copy(value)
    except (ValueError, RecursionError) as error:
        raise BadValueError(key_text(key), _("the value contains itself, or has too many levels")) from error


def _public_entry(entry: StoredEntry, now: float) -> BlackboardEntry:
    return BlackboardEntry(
        key_text(entry.key),
        deep_copy(entry.value),
        entry.age_s(now),
        entry.age_by,
        entry.source,
        entry.robot,
        entry.stamp_ns,
        max(0.0, entry.expires_at - now),
    )


def _compose(entries: Sequence[StoredEntry], key: Key) -> object:
    if entries[0].key == key:
        return deep_copy(entries[0].value)
    result: dict[str, object] = {}
    for entry in entries:
        *names, last_name = entry.key[len(key) :]
        branch = result
        for name in names:
            child = branch.setdefault(name, {})
            if isinstance(child, dict):  # always true: no value is stored above another
                branch = child
        branch[last_name] = deep_copy(entry.value)
    return result
