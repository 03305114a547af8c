"""Messages of every kind, and the attributes that a recording must preserve."""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from nep.messages import image_codec
from nep.messages.message import Message
from nep.recordings.formats.destination import WriterLimits
from nep.recordings.writer import RecordingWriter

START_NS = 1_790_000_000_000_000_000
STEP_NS = 10_000_000


def limits(**changed: float) -> WriterLimits:
    """Return the default limits with changes, without a minimum of free disk space."""
    return replace(WriterLimits(min_free_bytes=0), **changed)


class TestClock:
    """Fake clock that advances by `step_ns` (10 ms by default) at each call."""

    __test__ = False

    def __init__(self, start_ns: int = START_NS, step_ns: int = STEP_NS) -> None:
        self._count = itertools.count(start_ns, step_ns)

    def __call__(self) -> int:
        return next(self._count)


def kept(message: Message) -> tuple[object, ...]:
    """Return everything that a replay must preserve of a message."""
    return (
        message.topic,
        bytes(message.data),
        message.codec,
        message.msg_type,
        message.seq,
        message.stamp_ns,
        message.publisher,
        repr(dict(message.extension)),
    )


def json_message(seq: int, topic: str = "/odom", publisher: int = 7, size: int = 100) -> Message:
    """Return a message with unique data that compresses badly."""
    noise = random.Random(seq).randbytes(size // 2).hex()
    data = f'{{"x":{seq},"noise":"{noise}"}}'.encode()
    return Message(topic, data, "json", "json", stamp_ns=START_NS + seq, seq=seq, publisher=publisher)


def picture(seq: int, encoding: str = "jpeg", topic: str = "/camera") -> Message:
    """Return a small image message as a publisher sends it."""
    frame = np.random.default_rng(seq).integers(0, 255, (12, 16, 3), dtype=np.uint8)
    made = {
        "jpeg": image_codec.encode,
        "png": image_codec.ImageFormat("png").encode,
        "raw": image_codec.raw_image,
    }[encoding](frame)
    return Message(
        topic,
        bytes(made.data),
        "image",
        "image",
        stamp_ns=START_NS + seq,
        seq=seq,
        publisher=9,
        extension=dict(made.extension or {}),
    )


def odd_messages() -> list[Message]:
    """Return messages of every codec, with extreme numbers and with malformed data."""
    whole = {"stamp_ns": 5, "seq": 1, "publisher": 3}
    return [
        json_message(1),
        Message("/list", b"[1,2]", "json", "json", **whole),
        Message("/nan", b'{"x":NaN}', "json", "json", **whole),
        Message("/broken", b'{"x":', "json", "json", **whole),
        Message("/empty", b"", "json", "json", **whole),
        Message("/typed", b'{"x":1.0}', "json", "geometry_msgs/Point", **whole),
        Message("/odom", b'{"of":"another"}', "json", "json", stamp_ns=0, seq=0, publisher=2**64 - 1),
        Message("/last", b"{}", "json", "json", stamp_ns=2**64 - 1, seq=2**64 - 1, publisher=0),
        Message("/original", b"{}", "json", "json"),
        Message("/beside", b"{}", "json", "json", extension={"a": [1, {"b": b"\0"}]}, **whole),
        Message("/text", "¿qué?".encode(), "string", "string", **whole),
        Message("/no_text", b"\xff\xfe", "string", "string", **whole),
        Message("/bytes", bytes(range(256)), "bytes", "bytes", **whole),
        Message("/packed", b"\x81\xa1a\x01", "msgpack", "msgpack", **whole),
        Message("/not_packed", b"\xc1", "msgpack", "msgpack", **whole),
        Message("/future", b"\x00", "codec of tomorrow", "x/Y", **whole),
        picture(1),
        picture(2, "png"),
        picture(3, "raw"),
        Message("/original/camera", bytes(picture(4).data), "image", "image"),
        Message(
            "/depth",
            bytes(24),
            "image",
            "image",
            extension={"shape": [2, 3, 1], "encoding": "32FC1"},
            **whole,
        ),
        Message(
            "/flow", bytes(48), "image", "image", extension={"shape": [2, 3, 2], "encoding": "32FC2"}, **whole
        ),
        Message(
            "/lies", bytes(5), "image", "image", extension={"shape": [-1, 2], "encoding": "bgr8"}, **whole
        ),
        Message("/no_picture", b"\xff\xd8\xff\0", "image", "image", extension={"encoding": 7}, **whole),
    ]


def record(path: Path, parts: Sequence[Sequence[Message]]) -> None:
    """Write a recording with one chunk per part and 10 ms between messages."""
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        for part in parts:
            for message in part:
                writer.post([message])
            assert writer.flush()
