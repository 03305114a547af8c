"""The frames of direct connections: how the original NEP writes one datum into one part. Pure functions.

Up to 0.5.4.5 (generation A) the topic stands in front (`topic {"a":1}`), from 0.5.4.8 on (B) it does not, but
for `dictionary`; `image` always has it, `images`, `bytes` and `msgpack` never. Pictures are base64.
"""

from __future__ import annotations

import base64
import binascii

from nep.errors import WireError

__all__ = ["from_frame", "has_prefix", "to_frame"]

_ALWAYS = frozenset({"dictionary", "image"})
_NEVER = frozenset({"bytes", "msgpack", "images"})
_JSON_BEGINS = frozenset(b'{["-0123456789tfnNI')


def has_prefix(generation: str, msg_type: str) -> bool:
    """Whether a program of this generation writes the topic in front."""
    return msg_type in _ALWAYS or (generation == "A" and msg_type not in _NEVER)


def to_frame(topic: str, generation: str, msg_type: str, codec: str, data: bytes | memoryview) -> bytes:
    """The frame that says `data`, which are bytes of the native codec."""
    body = base64.b64encode(data) if codec == "image" else bytes(data)
    return topic.encode() + b" " + body if has_prefix(generation, msg_type) else body


def from_frame(topic: str, msg_type: str, codec: str, frame: bytes) -> bytes | None:
    """The datum in `frame`, of either generation; None when it belongs to another topic of the same port.

    Raises `WireError` for a picture that is not base64.
    """
    prefix = topic.encode() + b" "
    if msg_type in _NEVER and codec != "image":
        return frame
    if frame.startswith(prefix):
        frame = frame[len(prefix) :]
    elif (codec == "json" and frame[:1] and frame[0] not in _JSON_BEGINS) or (
        codec == "image" and b" " in frame[:300]
    ):
        return None
    if codec != "image":
        return frame
    try:
        return base64.b64decode(frame, validate=True)
    except binascii.Error as error:
        raise WireError("a picture is not base64", len(frame)) from error
