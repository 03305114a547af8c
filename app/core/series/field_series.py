"""The series of one topic: each message is placed in time once, then each field is looked up in it."""

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

if TYPE_CHECKING:
    from nep.messages.message import Message

LATEST_STAMP_NS = 1 << 63
"""Later stamps (the year 2262) are none: such a message has no place in time, and is counted."""
SILENCE_S, SILENCES = 1.0, 8.0
"""A silence is a gap when it is longer than a second and than eight usual pauses."""
SILENCES_IN_A_ROW = 3
"""After so many silences that is how often the topic comes now: each message as a gap would be no line."""
MOST_PUBLISHERS = 64
UNREAD = object()
"""What stands for a message that can't be read."""


class FieldSeries:
    """What one field was: `numbers`, and `states` where it was text or yes or no.

    ``last`` is its newest value as it came, ``missing`` counts messages that had no such value.
    """

    def __init__(self, topic: str, path: FieldPath) -> None:
        """Nothing has come yet."""
        self.topic, self.path = topic, path
        self.numbers, self.states = Samples(), States()
        self.last: object = MISSING
        self.missing = 0

    @property
    def is_state(self) -> bool:
        """Whether its newest value is a text, or yes or no."""
        return kind_of_value(self.last) == "state"

    def take(self, times_s: Sequence[float], payloads: Sequence[object], gaps: Sequence[bool]) -> None:
        """Look the field up in messages that came at these times; ``gaps``: something is missing before."""
        find = self.path.value_in
        times: list[float] = []
        values: list[float] = []
        marks: list[bool] = []
        number_gap = state_gap = False
        has_states = len(self.states) > 0
        for time_s, payload, gap in zip(times_s, payloads, gaps, strict=True):
            if gap:
                number_gap = state_gap = True
            value = MISSING if payload is UNREAD else find(payload)
            kind = type(value)
            if kind is float or kind is int:
                times.append(time_s)
                values.append(value if kind is float else number_of(value))  # type: ignore[arg-type]
                marks.append(number_gap)
                number_gap = False
                if has_states:
                    self.states.add(time_s, None)
            elif kind is str or kind is bool:
                word = value if kind is str else "true" if value else "false"
                self.states.add(time_s, str(word), gap=state_gap)
                number_gap, state_gap, has_states = True, False, True
            else:
                self.missing += 1
                if has_states:
                    self.states.add(time_s, None)
                number_gap = True
            if payload is not UNREAD:
                self.last = value
        if times:
            self.numbers.extend(np.array(times), np.array(values), np.array(marks, dtype=bool))
        if number_gap:
            self.numbers.break_line()

    def rewind(self) -> None:
        """Begin anew."""
        self.numbers.clear()
        self.states.clear()
        self.last = MISSING
        self.missing = 0


def number_of(value: object) -> float:
    """A number as the plot has it; one that is too large for it is infinite, which is not drawn."""
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        return inf if value > 0 else -inf  # type: ignore[operator]


class TopicSeries:
    """All series that are picked from one topic; takes its messages (`app.core.series.feed`).

    ``lost`` counts messages that did not get here, ``unread`` those that can't be read or are too large,
    ``unplaced`` those whose stamp is no time. ``payload`` is the newest message's.
    """

    def __init__(self, topic: str, origin_ns: int) -> None:
        """Its times are seconds after ``origin_ns``."""
        self.topic, self._origin_ns = topic, origin_ns
        self.fields: list[FieldSeries] = []
        self.received = self.lost = self.unread = self.unplaced = 0
        self.payload: object = MISSING
        self._gap = False  # something is missing before whatever comes next
        self._seqs: dict[int | None, int] = {}
        self._last_s: float | None = None
        self._usual_s: float | None = None
        self._silences = 0  # in a row

    def join(self, field: FieldSeries) -> None:
        """One more field is looked up from now on, in the newest message too."""
        self.fields.append(field)
        if self.payload is not MISSING and self._last_s is not None:
            field.take([self._last_s], [self.payload], [False])

    def take(self, batch: Batch, now_ns: int) -> None:
        """Take over what arrived."""
        seen: set[int | None] = set()  # publishers: what was dropped are jumps of their first numbers, too
        lost = first_jumps = 0
        times: list[float] = []
        payloads: list[object] = []
        gaps: list[bool] = []
        pending = self._gap or batch.dropped > 0
        for message in batch.messages:
            jump, publisher = self._missed(message), message.publisher
            if publisher not in seen:
                seen.add(publisher)
                first_jumps += jump
            elif jump:
                lost += jump
            time_s = self._time_of(message, now_ns)
            pending = pending or jump > 0
            if time_s is None:
                self.unplaced += 1
                pending = True
                continue
            times.append(time_s)
            payloads.append(self._read(message))
            gaps.append(pending or self._is_silence(time_s))
            self._last_s = time_s
            pending = False
        self._gap = pending
        self.received += len(batch.messages)
        self.lost += lost + max(batch.dropped, first_jumps)
        for field in self.fields:
            field.take(times, payloads, gaps)

    def rewind(self) -> None:
        """Forget what came: the next message is of another time."""
        self._seqs.clear()
        self._gap, self._last_s, self._usual_s, self._silences = False, None, None, 0
        self.received = self.lost = self.unread = self.unplaced = 0
        self.payload = MISSING
        for field in self.fields:
            field.rewind()

    def _missed(self, message: Message) -> int:
        """How many messages of its publisher are missing right before this one."""
        seq, publisher = message.seq, message.publisher
        if seq is None:
            return 0
        before = self._seqs.get(publisher)
        if before is None and len(self._seqs) >= MOST_PUBLISHERS:
            self._seqs.clear()
        self._seqs[publisher] = seq
        # one that is latched comes again; one that begins anew has lost nothing
        return seq - before - 1 if before is not None and seq > before else 0

    def _time_of(self, message: Message, now_ns: int) -> float | None:
        stamp_ns = message.stamp_ns
        if stamp_ns is None:
            stamp_ns = now_ns
        if not 0 <= stamp_ns < LATEST_STAMP_NS:
            return None
        known = message.kind.clock.difference
        return (stamp_ns + (0 if known is None else known.add_ns) - self._origin_ns) / 1e9

    def _read(self, message: Message) -> object:
        if message.size_bytes > LARGE_BYTES or message.codec == "image":
            self.unread += 1
            return UNREAD
        try:
            self.payload = payload = message.payload
        except (NepError, ValueError, RecursionError):
            self.unread += 1
            return UNREAD
        return payload

    def _is_silence(self, time_s: float) -> bool:
        if self._last_s is None:
            return False
        pause_s, usual_s = time_s - self._last_s, self._usual_s
        if usual_s is not None and 0 < pause_s <= SILENCE_S:  # nearly always
            self._silences = 0
            self._usual_s = usual_s + 0.1 * (pause_s - usual_s)
            return False
        if pause_s <= 0 or not isfinite(pause_s):
            return False
        if usual_s is not None and pause_s > max(SILENCE_S, SILENCES * usual_s):
            self._silences += 1
            if self._silences < SILENCES_IN_A_ROW:
                return True
            usual_s = None
        self._silences = 0
        self._usual_s = pause_s if usual_s is None else usual_s + 0.1 * (pause_s - usual_s)
        return False
