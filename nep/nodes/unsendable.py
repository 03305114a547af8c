"""Payloads that cannot become bytes: refused, counted, logged rarely and told in the graph, never raised.

Whether a payload can be sent shows only when it is encoded, and it is encoded only when somebody listens. If
that raised, a program would run until somebody looks at its topic: see docs/adr/0013-watching.md.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence

from nep.errors import EncodeError, WireError
from nep.messages.encoded import Encoded
from nep.protocol.wire import extension_part
from nep.system.log_rarely import is_told
from nep.text import escaped, shortened

__all__ = ["Unsendable", "place_of"]

_logger = logging.getLogger("nep")

_LOOK_S = 1.0
"""So often at most a payload is tried out that nobody wants; and a fiftieth of the time at most."""
_SHARE = 50
_LOOKED_AT = 10_000
_DEEPEST = 50
_LONGEST = 300


class Unsendable:
    """For one publisher. `encode` is its codec's; `report` tells the graph, "" when all is well again."""

    def __init__(
        self,
        topic: str,
        encode: Callable[[object], Encoded],
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.count = 0
        """How many were refused."""
        self.problem = ""
        """Why the newest was; empty when it could be sent."""
        self._topic = topic
        self._encode = encode
        self._report = report
        self._clock = clock
        self._look_at = clock()
        self._place_at = clock()
        self._known = ("", "")

    def try_out(self, payload: object) -> bool:
        """Whether a payload that nobody wants could be sent. It is looked at now and then only."""
        started = self._clock()
        if started < self._look_at:
            return True
        try:
            check_sendable(payload) if isinstance(payload, Encoded) else self._encode(payload)
        except Exception as error:  # noqa: BLE001 - a payload may be of any class, which may raise anything
            self.add(payload, error)
        else:
            self.cure()
        ended = self._clock()
        self._look_at = ended + max(_LOOK_S, _SHARE * (ended - started))
        return not self.problem

    def add(self, payload: object, error: Exception) -> None:
        """`payload` cannot be sent because of `error`."""
        self.count += 1
        said = _said(error)
        now = self._clock()
        if self._known[0] != said and (now >= self._place_at or not self._known[0]):
            self._place_at = now + _LOOK_S  # looking for the place may take long
            place = _place_of(payload, self._encode)
            self._known = (said, f"{said}; it is at '{place}'" if place else said)
        sentence = self._known[1] if self._known[0] == said else said
        if is_told(self.count):
            _logger.warning(
                "a message on '%s' cannot be sent (%d so far): %s", self._topic, self.count, sentence
            )
        if sentence != self.problem:
            self.problem = sentence
            self._report(sentence)

    def cure(self) -> None:
        """A payload could be sent."""
        if self.problem:
            self.problem = ""
            self._report("")


def _said(error: Exception) -> str:
    try:
        said = str(error)
    except Exception:  # noqa: BLE001 - its class is the payload's own
        said = ""
    if not isinstance(error, EncodeError | WireError):
        said = f"{type(error).__name__}: {said}"
    return escaped(shortened(said, _LONGEST))


def check_sendable(payload: Encoded) -> None:
    """Raises `WireError` for an extension that has no form on the wire."""
    if payload.extension:
        extension_part(payload.extension)


def _place_of(payload: object, encode: Callable[[object], Encoded]) -> str:
    try:
        return "" if isinstance(payload, Encoded) else escaped(shortened(place_of(payload, encode), _LONGEST))
    except Exception:  # noqa: BLE001 - its keys may be of any class
        return ""


def place_of(payload: object, encode: Callable[[object], Encoded]) -> str:
    """Where in `payload` the first value is that cannot be encoded, such as "pose.x" or "joints[3]".

    Empty when that is the whole, or is not found among ten thousand values.
    """
    path, value, left = "", payload, _LOOKED_AT
    for _ in range(_DEEPEST):
        for step, part in _parts(value):
            left -= 1
            if left <= 0:
                return path
            if not _can(part, encode):
                path, value = path + step, part
                break
        else:
            break
    return path.removeprefix(".")


def _can(value: object, encode: Callable[[object], Encoded]) -> bool:
    try:
        encode(value)
    except Exception:  # noqa: BLE001 - see `Unsendable.try_out`
        return False
    return True


def _parts(value: object) -> list[tuple[str, object]]:
    if isinstance(value, Mapping):
        return [(f".{str(key)[:100]}", part) for key, part in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray | memoryview):
        return [(f"[{number}]", part) for number, part in enumerate(value[:_LOOKED_AT])]
    return []
