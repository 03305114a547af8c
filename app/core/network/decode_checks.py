"""Whether messages can be read at all, found out where they arrive and not in the window.

Every message of a watched topic is tried, with bounded work: at most 7 % of the time, and a second of
work in advance for a burst. Half of that advance is kept for topics on which something bad was found, so that
their count is exact when it matters. What comes faster is not tried but counted as such.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from nep.errors import NepError
from nep.messages.message import Message

READABLE = frozenset({"json", "string", "msgpack"})
LARGE_BYTES = 300_000
SHARE = 0.07
ADVANCE_S = 1.0
RESERVE_S = 0.5
SUSPECT_S = 30.0
LOOK_S = 0.0002
"""The clock of work takes as long as trying a message: it is looked at this often."""
SOME, SOME_BYTES = 256, 64_000


@dataclass(slots=True)
class Checked:
    """What was found on one topic since it was asked last.

    ``bad`` of the ``checked`` messages can't be read, ``unchecked`` came too fast to be tried. ``sentence``
    says what is wrong with the newest bad one; ``last_good`` whether the newest message can be read.
    """

    checked: int = 0
    bad: int = 0
    unchecked: int = 0
    sentence: str = ""
    last_good: bool = True


class Checks:
    """Tries messages in the source's thread (`look`); the window's thread takes what was found (`take`)."""

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        work: Callable[[], float] = time.thread_time,
    ) -> None:
        """``clock`` gives seconds that pass, ``work`` those that the calling thread has worked."""
        self._clock, self._work = clock, work
        self._lock = threading.Lock()
        self._found: dict[str, Checked] = {}
        self._suspects: dict[str, float] = {}
        self._advance_s = ADVANCE_S
        self._refilled = clock()

    def look(self, topic: str, messages: Sequence[Message]) -> None:
        """Try the messages of one topic, oldest first. Pictures and bytes are taken as they are."""
        if not messages or messages[-1].codec not in READABLE:
            return
        found = Checked()
        self._refill()
        self._try(topic, messages, found)
        with self._lock:
            old = self._found.get(topic)
            if old is not None:
                found.checked += old.checked
                found.bad += old.bad
                found.unchecked += old.unchecked
                found.sentence = found.sentence or old.sentence
            self._found[topic] = found

    def take(self) -> dict[str, Checked]:
        """What was found by topic since the last time."""
        with self._lock:
            found, self._found = self._found, {}
        return found

    def _refill(self) -> None:
        now = self._clock()
        self._advance_s = min(ADVANCE_S, self._advance_s + max(0.0, now - self._refilled) * SHARE)
        self._refilled = now

    def _try(self, topic: str, messages: Sequence[Message], found: Checked) -> None:
        newest = messages[-1]
        found.sentence = _problem(newest, keep=True)  # always, and it stays decoded: panels show this one
        found.last_good = not found.sentence
        found.checked, found.bad = 1, int(not found.last_good)
        now = self._refilled
        if found.bad:
            self._suspects[topic] = now
        if len(messages) > 1:  # else there is no clock to be read, which takes longer than the message
            self._try_older(topic, messages, found, now)

    def _try_older(self, topic: str, messages: Sequence[Message], found: Checked, now: float) -> None:
        began = self._work()
        left = self._advance_s - (0.0 if self._is_suspect(topic, now) else RESERVE_S)
        place, some, worked, older = 0, 1, 0.0, len(messages) - 1
        while place < older and worked < left:
            was_well, before = not found.bad, worked
            end = min(older, place + some)
            place = _try_some(messages, place, end, found)
            if was_well and found.bad:
                self._suspects[topic] = now
                left = self._advance_s
            worked = self._work() - began
            some = min(2 * some, SOME) if worked - before < LOOK_S else max(1, some // 2)
        found.unchecked = len(messages) - found.checked
        self._advance_s -= worked

    def _is_suspect(self, topic: str, now: float) -> bool:
        seen = self._suspects.get(topic)
        if seen is not None and now - seen > SUSPECT_S:
            del self._suspects[topic]
            return False
        return seen is not None


def _try_some(messages: Sequence[Message], place: int, end: int, found: Checked) -> int:
    """Try these messages, or less when they are large; the place of the first that was not tried."""
    size_bytes = 0
    while place < end and size_bytes < SOME_BYTES:
        message = messages[place]
        problem = _problem(message, keep=False)
        found.checked += 1
        if problem:
            found.bad += 1
            found.sentence = found.sentence or problem
        size_bytes += message.size_bytes
        place += 1
    return place


def _problem(message: Message, *, keep: bool) -> str:
    """What is wrong with a message; nothing when it can be read. A large one is left to who shows it."""
    if message.size_bytes > LARGE_BYTES:
        return ""
    try:
        if keep:
            _ = message.payload
        else:
            message.kind.decode(message.raw, message.extension)
    except NepError as error:
        return str(error)
    return ""
