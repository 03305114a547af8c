"""Check in the receiving thread whether messages can be decoded.

Every message of a watched topic is decoded while that takes at most 7 % of the time; up to 1 s of
unused time is saved for bursts. Half of the time is reserved for topics with earlier errors, so that
their errors are counted exactly. Messages beyond these limits are counted as unchecked.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from nep.errors import NepError
from nep.messages.message import Message

CHECKED_CODECS = frozenset({"json", "string", "msgpack"})
LARGE_BYTES = 300_000
MAX_CPU_SHARE = 0.07
MAX_BUDGET_S = 1.0
RESERVED_BUDGET_S = 0.5
SUSPECT_TIMEOUT_S = 30.0
CLOCK_READ_INTERVAL_S = 0.0002
"""Minimum decoding time in seconds between two readings of the clock.

Reading the clock takes as long as decoding a small message.
"""
SOME, SOME_BYTES = 256, 64_000


@dataclass(slots=True)
class CheckResult:
    """Result of the checks of one topic since the last call of `DecodeChecker.pop_results`.

    Attributes:
        checked: Number of checked messages.
        bad_count: Number of checked messages that can't be decoded.
        unchecked_count: Number of messages that were not checked for lack of time.
        error: Description of the newest error, or "".
        is_newest_readable: True if the newest message can be decoded.
    """

    checked: int = 0
    bad_count: int = 0
    unchecked_count: int = 0
    error: str = ""
    is_newest_readable: bool = True


class DecodeChecker:
    """Check of received messages. `check` runs in the receiving thread, `pop_results` in the main thread."""

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        work: Callable[[], float] = time.thread_time,
    ) -> None:
        # `clock` is monotonic seconds; `work` is the CPU time of the calling thread in seconds.
        self._clock, self._work = clock, work
        self._lock = threading.Lock()
        self._found: dict[str, CheckResult] = {}
        self._suspects: dict[str, float] = {}
        self._advance_s = MAX_BUDGET_S
        self._refilled = clock()

    def check(self, topic: str, messages: Sequence[Message]) -> None:
        """Check messages of one topic, oldest first. Images and bytes are skipped."""
        if not messages or messages[-1].codec not in CHECKED_CODECS:
            return
        found = CheckResult()
        self._refill_budget()
        self._check(topic, messages, found)
        with self._lock:
            old = self._found.get(topic)
            if old is not None:
                found.checked += old.checked
                found.bad_count += old.bad_count
                found.unchecked_count += old.unchecked_count
                found.error = found.error or old.error
            self._found[topic] = found

    def pop_results(self) -> dict[str, CheckResult]:
        """Return the results by topic, and clear them."""
        with self._lock:
            found, self._found = self._found, {}
        return found

    def _refill_budget(self) -> None:
        now = self._clock()
        self._advance_s = min(MAX_BUDGET_S, self._advance_s + max(0.0, now - self._refilled) * MAX_CPU_SHARE)
        self._refilled = now

    def _check(self, topic: str, messages: Sequence[Message], found: CheckResult) -> None:
        newest = messages[-1]
        # the newest is always decoded and stays decoded: panels show it
        found.error = _decode_error(newest, keep=True)
        found.is_newest_readable = not found.error
        found.checked, found.bad_count = 1, int(not found.is_newest_readable)
        now = self._refilled
        if found.bad_count:
            self._suspects[topic] = now
        if len(messages) > 1:  # reading the clock takes longer than a single message
            self._check_older(topic, messages, found, now)

    def _check_older(self, topic: str, messages: Sequence[Message], found: CheckResult, now: float) -> None:
        began = self._work()
        left = self._advance_s - (0.0 if self._is_suspect(topic, now) else RESERVED_BUDGET_S)
        place, some, worked, older = 0, 1, 0.0, len(messages) - 1
        while place < older and worked < left:
            was_well, before = not found.bad_count, worked
            end = min(older, place + some)
            place = _check_batch(messages, place, end, found)
            if was_well and found.bad_count:
                self._suspects[topic] = now
                left = self._advance_s
            worked = self._work() - began
            some = min(2 * some, SOME) if worked - before < CLOCK_READ_INTERVAL_S else max(1, some // 2)
        found.unchecked_count = len(messages) - found.checked
        self._advance_s -= worked

    def _is_suspect(self, topic: str, now: float) -> bool:
        seen = self._suspects.get(topic)
        if seen is not None and now - seen > SUSPECT_TIMEOUT_S:
            del self._suspects[topic]
            return False
        return seen is not None


def _check_batch(messages: Sequence[Message], place: int, end: int, found: CheckResult) -> int:
    # Returns the index of the first message that was not decoded (fewer are decoded when they are large).
    size_bytes = 0
    while place < end and size_bytes < SOME_BYTES:
        message = messages[place]
        problem = _decode_error(message, keep=False)
        found.checked += 1
        if problem:
            found.bad_count += 1
            found.error = found.error or problem
        size_bytes += message.size_bytes
        place += 1
    return place


def _decode_error(message: Message, *, keep: bool) -> str:
    # "" also for large messages: the panel that shows one decodes it.
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
