"""NaN and infinity in JSON, which has neither: they are sent as `null`, and never silently.

The original NEP up to 0.5.4.5 raised `ValueError`, 0.5.4.8 sends the bare word `NaN`, which no strict reader
takes. A sensor that has no value for a moment must not end its robot's program, and its readers must be able
to read on: so `null` is sent, counted, and told in the program's log.
"""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass

from nep.errors import EncodeError
from nep.messages.codecs import JSON, MSGPACK
from nep.messages.encoded import Encoded

__all__ = ["NullTeller", "nan_in"]

AGAIN_S = 10.0
"""A topic that goes on sending them is told of so seldom."""
_logger = logging.getLogger("nep")
_DEEPEST = 100
_PACKED_NAN = re.compile(rb"\xcb[\x7f\xff][\xf0-\xff]")
"""NaN or infinity as msgpack has it; now and then something else."""


class NullTeller:
    """Encodes JSON for one publisher. `count` messages had NaN or infinity, which were sent as `null`."""

    def __init__(self, topic: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.count = 0
        self._topic = topic
        self._clock = clock
        self._told_at = -math.inf

    def encode(self, payload: object) -> Encoded:
        """The payload as JSON. Raises `EncodeError`."""
        made = JSON.encode(payload)
        data = made.data
        # From the end: in half the time of `in`, whose skipping trips over commas and digits.
        if (
            type(data) is bytes
            and data.rfind(b"null") >= 0
            and _may_have_nan(payload)
            and (where := nan_in(payload)) is not None
        ):
            self.count += 1
            now = self._clock()
            if now - self._told_at >= AGAIN_S:
                self._told_at = now
                _logger.warning(
                    "'%s' sends NaN or infinity as null, because JSON has neither: at %s, message %d of "
                    "this kind; publish None there, or use the type 'msgpack'",
                    self._topic,
                    where or "its only value",
                    self.count,
                )
        return made


def _may_have_nan(payload: object) -> bool:
    """Whether it is worth looking: mostly `null` is None. msgpack takes a tenth of a look at each value."""
    try:
        return _PACKED_NAN.search(MSGPACK.encode(payload).data) is not None
    except EncodeError:
        return True


def nan_in(value: object, path: str = "", depth: int = _DEEPEST) -> str | None:
    """Where the first NaN or infinity is, such as "pose.x" or "joints[3]"; None when there is none."""
    if isinstance(value, float):
        return None if math.isfinite(value) else path
    if value is None or isinstance(value, str | bytes | int) or depth <= 0:
        return None
    if isinstance(value, Mapping):
        parts = ((f"{path}.{key}" if path else str(key), each) for key, each in value.items())
    elif isinstance(value, Sequence):
        parts = ((f"{path}[{number}]", each) for number, each in enumerate(value))
    elif is_dataclass(value) and not isinstance(value, type):
        names = (each.name for each in fields(value))
        parts = ((f"{path}.{name}" if path else name, getattr(value, name, None)) for name in names)
    else:
        to_list = getattr(value, "tolist", None)  # numpy
        return nan_in(to_list(), path, depth - 1) if callable(to_list) else None
    for where, each in parts:
        found = nan_in(each, where, depth - 1)
        if found is not None:
            return found
    return None
