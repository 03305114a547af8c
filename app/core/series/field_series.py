"""Series of one topic. The time of each message is determined once; then each field is read."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np

from app.core.messages.reader import LARGE_BYTES
from app.core.network.mailbox import Batch
from app.core.series.field_path import MISSING, FieldPath, kind_of_value
from app.core.series.samples import Samples
from app.core.series.states import States
from nep.errors import NepError
from nep.messages.codecs import content_of

if TYPE_CHECKING:
    from nep.messages.message import Message

MAX_STAMP_NS = 1 << 63
"""Latest valid time stamp (year 2262). Messages with a later time stamp are skipped and counted."""
MIN_SILENCE_S, MIN_SILENCE_INTERVALS = 1.0, 8.0
"""Minimum silence that counts as a gap: seconds, and number of usual intervals."""
MIN_CONSECUTIVE_SILENCES = 3
"""Number of consecutive gaps after which the topic's usual interval is updated to their length."""
MAX_PUBLISHERS = 64
UNREADABLE = object()
"""Placeholder for a message that can't be read."""


class FieldSeries:
    """Values of one field over time: `numbers`, and `states` for text and boolean values.

    Attributes:
        last: Newest value as received.
    """

    def __init__(self, topic: str, path: FieldPath) -> None:
        self.topic, self.path = topic, path
        self.numbers, self.states = Samples(), States()
        self.last: object = MISSING

    @property
    def is_state(self) -> bool:
        """True if the newest value is text or boolean."""
        return kind_of_value(self.last) == "state"

    def add_values(self, times_s: Sequence[float], payloads: Sequence[object], gaps: Sequence[bool]) -> None:
        """Add the values of the field in some messages.

        Args:
            times_s: Time of each message in seconds.
            payloads: Decoded messages; `UNREADABLE` for a message that can't be decoded.
            gaps: True for each message before which messages are missing.
        """
        value_in = self.path.value_in
        times: list[float] = []
        values: list[float] = []
        number_gaps: list[bool] = []
        has_number_gap = has_state_gap = False
        has_states = len(self.states) > 0
        for time_s, payload, is_after_gap in zip(times_s, payloads, gaps, strict=True):
            if is_after_gap:
                has_number_gap = has_state_gap = True
            value = MISSING if payload is UNREADABLE else value_in(payload)
            value_type = type(value)
            if value_type is float or value_type is int:
                times.append(time_s)
                values.append(value if value_type is float else to_float(value))  # type: ignore[arg-type]
                number_gaps.append(has_number_gap)
                has_number_gap = False
                if has_states:
                    self.states.add(time_s, None)
            elif value_type is str or value_type is bool:
                state = value if value_type is str else "true" if value else "false"
                self.states.add(time_s, str(state), gap=has_state_gap)
                has_number_gap, has_state_gap, has_states = True, False, True
            else:
                if has_states:
                    self.states.add(time_s, None)
                has_number_gap = True
            if payload is not UNREADABLE:
                self.last = value
        if times:
            self.numbers.extend(np.array(times), np.array(values), np.array(number_gaps, dtype=bool))
        if has_number_gap:
            self.numbers.break_line()

    def reset(self) -> None:
        """Remove all values."""
        self.numbers.clear()
        self.states.clear()
        self.last = MISSING


def to_float(value: object) -> float:
    """Convert a number to float. Numbers that are too large become infinite and are not drawn."""
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        return inf if value > 0 else -inf  # type: ignore[operator]


class TopicSeries:
    """All series of one topic. Receives the topic's messages from `app.core.series.feed`.

    Attributes:
        lost: Number of messages that did not arrive.
        unreadable_count: Number of messages that can't be decoded or are too large.
        invalid_stamp_count: Number of messages with an invalid time stamp.
        payload: Payload of the newest decoded message; `MISSING` before the first one.
    """

    def __init__(self, topic: str, origin_ns: int) -> None:
        # Times are seconds after `origin_ns`.
        self.topic, self._origin_ns = topic, origin_ns
        self.fields: list[FieldSeries] = []
        self.received = self.lost = self.unreadable_count = self.invalid_stamp_count = 0
        self.payload: object = MISSING
        self._has_gap = False  # messages are missing before the next one
        self._last_seqs: dict[int | None, int] = {}
        self._last_s: float | None = None
        self._usual_interval_s: float | None = None
        self._silence_count = 0  # consecutive

    def add_field(self, field: FieldSeries) -> None:
        """Add a field. Its values are read from the newest message and from all later messages."""
        self.fields.append(field)
        if self.payload is not MISSING and self._last_s is not None:
            field.add_values([self._last_s], [self.payload], [False])

    def process(self, batch: Batch, now_ns: int) -> None:
        """Add the messages received since the last tick."""
        # publishers, because dropped messages also appear as jumps of their sequence numbers
        seen_publishers: set[int | None] = set()
        lost = missing_before_batch = 0
        times: list[float] = []
        payloads: list[object] = []
        gaps: list[bool] = []
        has_gap = self._has_gap or batch.dropped > 0
        for message in batch.messages:
            missing, publisher = self._missing_count(message), message.publisher
            if publisher not in seen_publishers:
                seen_publishers.add(publisher)
                missing_before_batch += missing
            elif missing:
                lost += missing
            time_s = self._time_of(message, now_ns)
            has_gap = has_gap or missing > 0
            if time_s is None:
                self.invalid_stamp_count += 1
                has_gap = True
                continue
            times.append(time_s)
            payloads.append(self._read(message))
            gaps.append(has_gap or self._is_silence(time_s))
            self._last_s = time_s
            has_gap = False
        self._has_gap = has_gap
        self.received += len(batch.messages)
        self.lost += lost + max(batch.dropped, missing_before_batch)
        for field in self.fields:
            field.add_values(times, payloads, gaps)

    def reset(self) -> None:
        """Remove all values. Called when the source seeks to another time."""
        self._last_seqs.clear()
        self._has_gap, self._last_s, self._usual_interval_s, self._silence_count = False, None, None, 0
        self.received = self.lost = self.unreadable_count = self.invalid_stamp_count = 0
        self.payload = MISSING
        for field in self.fields:
            field.reset()

    def _missing_count(self, message: Message) -> int:
        # Number of messages of its publisher missing immediately before this one.
        seq, publisher = message.seq, message.publisher
        if seq is None:
            return 0
        last_seq = self._last_seqs.get(publisher)
        if last_seq is None and len(self._last_seqs) >= MAX_PUBLISHERS:
            self._last_seqs.clear()
        self._last_seqs[publisher] = seq
        # a latched message is repeated; a restarted publisher has lost nothing
        return seq - last_seq - 1 if last_seq is not None and seq > last_seq else 0

    def _time_of(self, message: Message, now_ns: int) -> float | None:
        stamp_ns = message.stamp_ns
        if stamp_ns is None:
            stamp_ns = now_ns
        if not 0 <= stamp_ns < MAX_STAMP_NS:
            return None
        difference = message.kind.clock.difference
        return (stamp_ns + (0 if difference is None else difference.offset_ns) - self._origin_ns) / 1e9

    def _read(self, message: Message) -> object:
        if message.size_bytes > LARGE_BYTES or content_of(message.codec) == "image":
            self.unreadable_count += 1
            return UNREADABLE
        try:
            self.payload = payload = message.payload
        except (NepError, ValueError, RecursionError):
            self.unreadable_count += 1
            return UNREADABLE
        return payload

    def _is_silence(self, time_s: float) -> bool:
        if self._last_s is None:
            return False
        pause_s, usual_interval_s = time_s - self._last_s, self._usual_interval_s
        if usual_interval_s is not None and 0 < pause_s <= MIN_SILENCE_S:  # the usual case
            self._silence_count = 0
            self._usual_interval_s = usual_interval_s + 0.1 * (pause_s - usual_interval_s)
            return False
        if pause_s <= 0 or not isfinite(pause_s):
            return False
        if usual_interval_s is not None and pause_s > max(
            MIN_SILENCE_S, MIN_SILENCE_INTERVALS * usual_interval_s
        ):
            self._silence_count += 1
            if self._silence_count < MIN_CONSECUTIVE_SILENCES:
                return True
            usual_interval_s = None
        self._silence_count = 0
        self._usual_interval_s = (
            pause_s if usual_interval_s is None else usual_interval_s + 0.1 * (pause_s - usual_interval_s)
        )
        return False
