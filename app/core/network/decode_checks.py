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
from nep.messages.codecs import CODECS
from nep.messages.message import Message

LARGE_BYTES = 300_000
MAX_CPU_SHARE = 0.07
MAX_BUDGET_S = 1.0
RESERVED_BUDGET_S = 0.5
SUSPECT_TIMEOUT_S = 30.0
CLOCK_READ_INTERVAL_S = 0.0002
"""Minimum decoding time in seconds between two readings of the clock.

Reading the clock takes as long as decoding a small message.
"""
MAX_BATCH, MAX_BATCH_BYTES = 256, 64_000


@dataclass(slots=True)
class CheckResult:
    """Result of the checks of one topic since the last call of `DecodeChecker.pop_results`.

    Attributes:
        checked_count: Number of checked messages.
        bad_count: Number of checked messages that can't be decoded.
        unchecked_count: Number of messages that were not checked for lack of time.
        error: Description of the newest error, or "".
        is_newest_readable: True if the newest message can be decoded.
    """

    checked_count: int = 0
    bad_count: int = 0
    unchecked_count: int = 0
    error: str = ""
    is_newest_readable: bool = True


class DecodeChecker:
    """Check of received messages. `check` runs in the receiving thread, `pop_results` in the main thread."""

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        cpu_clock: Callable[[], float] = time.thread_time,
    ) -> None:
        # `clock` is monotonic seconds; `cpu_clock` is the CPU time of the calling thread in seconds.
        self._clock, self._cpu_clock = clock, cpu_clock
        self._lock = threading.Lock()
        self._results: dict[str, CheckResult] = {}
        self._suspects: dict[str, float] = {}
        self._budget_s = MAX_BUDGET_S
        self._refilled_s = clock()

    def check(self, topic: str, messages: Sequence[Message]) -> None:
        """Check messages of one topic, oldest first. Images and bytes are skipped."""
        codec = CODECS.get(messages[-1].codec) if messages else None
        if codec is None or codec.content not in {"values", "text"}:
            return
        result = CheckResult()
        self._refill_budget()
        self._check(topic, messages, result)
        with self._lock:
            previous = self._results.get(topic)
            if previous is not None:
                result.checked_count += previous.checked_count
                result.bad_count += previous.bad_count
                result.unchecked_count += previous.unchecked_count
                result.error = result.error or previous.error
            self._results[topic] = result

    def pop_results(self) -> dict[str, CheckResult]:
        """Return the results by topic, and clear them."""
        with self._lock:
            results, self._results = self._results, {}
        return results

    def _refill_budget(self) -> None:
        now = self._clock()
        self._budget_s = min(MAX_BUDGET_S, self._budget_s + max(0.0, now - self._refilled_s) * MAX_CPU_SHARE)
        self._refilled_s = now

    def _check(self, topic: str, messages: Sequence[Message], result: CheckResult) -> None:
        newest = messages[-1]
        # the newest is always decoded and stays decoded: panels show it
        result.error = _decode_error(newest, keep_decoded=True)
        result.is_newest_readable = not result.error
        result.checked_count, result.bad_count = 1, int(not result.is_newest_readable)
        now = self._refilled_s
        if result.bad_count:
            self._suspects[topic] = now
        if len(messages) > 1:  # reading the clock takes longer than a single message
            self._check_older(topic, messages, result, now)

    def _check_older(self, topic: str, messages: Sequence[Message], result: CheckResult, now: float) -> None:
        started_s = self._cpu_clock()
        budget_s = self._budget_s - (0.0 if self._is_suspect(topic, now) else RESERVED_BUDGET_S)
        index, batch_size, elapsed_s, older_count = 0, 1, 0.0, len(messages) - 1
        while index < older_count and elapsed_s < budget_s:
            was_error_free, previous_elapsed_s = not result.bad_count, elapsed_s
            end = min(older_count, index + batch_size)
            index = _check_batch(messages, index, end, result)
            if was_error_free and result.bad_count:
                self._suspects[topic] = now
                budget_s = self._budget_s
            elapsed_s = self._cpu_clock() - started_s
            batch_size = (
                min(2 * batch_size, MAX_BATCH)
                if elapsed_s - previous_elapsed_s < CLOCK_READ_INTERVAL_S
                else max(1, batch_size // 2)
            )
        result.unchecked_count = len(messages) - result.checked_count
        self._budget_s -= elapsed_s

    def _is_suspect(self, topic: str, now: float) -> bool:
        last_suspected_s = self._suspects.get(topic)
        if last_suspected_s is not None and now - last_suspected_s > SUSPECT_TIMEOUT_S:
            del self._suspects[topic]
            return False
        return last_suspected_s is not None


def _check_batch(messages: Sequence[Message], index: int, end: int, result: CheckResult) -> int:
    # Returns the index of the first message that was not decoded (fewer are decoded when they are large).
    size_bytes = 0
    while index < end and size_bytes < MAX_BATCH_BYTES:
        message = messages[index]
        problem = _decode_error(message, keep_decoded=False)
        result.checked_count += 1
        if problem:
            result.bad_count += 1
            result.error = result.error or problem
        size_bytes += message.size_bytes
        index += 1
    return index


def _decode_error(message: Message, *, keep_decoded: bool) -> str:
    # "" also for large messages: the panel that shows one decodes it.
    if message.size_bytes > LARGE_BYTES:
        return ""
    try:
        if keep_decoded:
            _ = message.payload
        else:
            message.kind.decode(message.raw, message.extension)
    except NepError as error:
        return str(error)
    return ""
