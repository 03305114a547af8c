"""Encoded: a payload that is already encoded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple


class Encoded(NamedTuple):
    """Encoded payload. A publisher sends it unchanged.

        pub.publish(nep.Encoded(jpeg_bytes))

    Attributes:
        data: Bytes in the encoding of the topic's message type.
        extension: Additional header fields with text keys, such as "shape" and "encoding" of an image, or
            None.
    """

    data: bytes | memoryview
    extension: Mapping[str, object] | None = None


new_encoded: Callable[[tuple[bytes | memoryview, Mapping[str, object] | None]], Encoded] = partial(
    tuple.__new__, Encoded
)
"""Fast constructor of `Encoded`, which takes a third of the time. Called for every message."""
