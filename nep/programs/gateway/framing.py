"""Frame formats of the original NEP, and their conversion to native codecs. Performs no input or output.

Depending on the version and the type of the topic, a frame is *prefixed* (`topic {"a":1}`) or *bare*
(`{"a":1}`). The remaining bytes are data of a native codec, except for images, which are a JPEG in base64.
Conversion removes or adds the prefix; only images and JSON with NaN or infinity are encoded again.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import re
from dataclasses import dataclass
from typing import Literal

from nep.backends.zeromq.legacy import has_prefix
from nep.i18n import _
from nep.messages.codecs import content_of

Framing = Literal["prefixed", "bare"]

PORT_A = 7000
"""Port to which programs up to 0.5.4.5, nep-js and C# send requests."""
PORT_B = 50000
"""Port to which programs since 0.5.4.6 send requests."""

_NON_FINITE = re.compile(rb"\b(?:NaN|Infinity)\b")
_JSON_TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|\s+', re.DOTALL)


def framing_of(port: int, msg_type: str) -> Framing:
    """Return the framing that a program uses.

    Args:
        port: Port to which the program sent its request.
        msg_type: Message type of the topic.
    """
    return "prefixed" if has_prefix("A" if port == PORT_A else "B", msg_type) else "bare"


class FrameError(ValueError):
    """Error for an invalid frame.

    Args:
        message: Description of the problem.
        version: Release of the original NEP that writes such frames, if known.
    """

    def __init__(self, message: str, version: str | None = None) -> None:
        super().__init__(message)
        self.version = version


@dataclass(frozen=True)
class FrameFormat:
    """Frame format of a topic.

    Attributes:
        topic: Name of the topic.
        framing: "prefixed" or "bare".
        codec: Native codec of the payload.
    """

    topic: str
    framing: Framing
    codec: str

    @property
    def prefix(self) -> bytes:
        """Prefix of each frame: the topic and a space, or b"" for bare frames."""
        return f"{self.topic} ".encode() if self.framing == "prefixed" else b""

    def decode_frame(self, frame: bytes) -> bytes:
        """Convert a frame to data of the native codec, with NaN and infinity in JSON replaced.

        Raises `FrameError` if the frame is invalid or of another version's format.
        """
        data = self._strip_prefix(frame)
        if content_of(self.codec) == "image":
            return _decode_base64(data)
        if self.codec == "json" and _NON_FINITE.search(data):
            return _replace_nan(data)
        return data

    def encode_frame(self, data: bytes | memoryview) -> bytes:
        """Convert data of the native codec to a frame."""
        body = base64.b64encode(data) if content_of(self.codec) == "image" else data
        return b"".join((self.prefix, body))

    def matches_filter(self, subscription: bytes) -> bool:
        """Return True if a subscriber with this ZeroMQ filter can read frames of this format."""
        if self.framing == "prefixed":
            return self.prefix.startswith(subscription) or subscription.startswith(self.prefix)
        return not self.is_from_0546(subscription)

    def is_from_0546(self, subscription: bytes) -> bool:
        """Return True if a ZeroMQ filter was set by nep 0.5.4.6.

        That version filters by topic although its frames are bare.
        """
        return self.framing == "bare" and bool(subscription) and self.topic.encode().startswith(subscription)

    def _strip_prefix(self, frame: bytes) -> bytes:
        prefix = f"{self.topic} ".encode()
        if self.framing == "prefixed":
            if frame.startswith(prefix):
                return frame[len(prefix) :]
            if self.codec == "json" and frame.startswith((b"{", b"[", b'"')):
                return frame
            raise FrameError(
                _("A message on “{topic}” doesn't begin with the topic name").format(topic=self.topic)
            )
        if self.codec == "json":
            self._check_version(frame, prefix)
        return frame

    def _check_version(self, frame: bytes, prefix: bytes) -> None:
        if frame.startswith(prefix):
            raise FrameError(
                _("A message on “{topic}” begins with the topic name").format(topic=self.topic),
                version="0.5.4.6",
            )
        if frame[:1] == b'"' and _is_json_in_json(frame):
            raise FrameError(
                _("A message on “{topic}” is JSON encoded twice").format(topic=self.topic), version="0.5.4.7"
            )


def has_replaced_nan(frame: bytes, data: bytes) -> bool:
    """Return True if NaN or infinity was replaced with `null` when a frame was converted.

    Args:
        frame: Frame of the original NEP.
        data: Converted data.
    """
    return _NON_FINITE.search(frame) is not None and data.count(b"null") > frame.count(b"null")


def escape_for_javascript(data: bytes, topic: str) -> bytes:
    r"""Escape occurrences of the topic's name in JSON, for subscribers with nep-js.

    nep-js splits a frame at every occurrence of the topic and parses the second piece, so a payload that
    contains its own topic would crash the program. The topic's first character is written as ``\uXXXX``,
    which JSON readers decode.
    """
    topic_bytes = topic.encode()
    if not topic_bytes or topic_bytes not in data:
        return data
    escaped = "".join(f"\\u{unit:04x}" for unit in _utf16_units(topic[0])).encode()
    topic_start = re.compile(
        rb"\\u[0-9a-fA-F]{4}|\\.|(?P<first>%b(?=%b))"
        % (re.escape(topic[0].encode()), re.escape(topic[1:].encode())),
        re.DOTALL,
    )

    def rewrite(token: re.Match[bytes]) -> bytes:
        text = token.group()
        if text[:1] != b'"':
            return text
        inner = topic_start.sub(lambda match: escaped if match.group("first") else match.group(), text[1:-1])
        return b'"' + inner + b'"'

    return _JSON_TOKEN.sub(rewrite, data)


def escape_for_csharp(data: bytes) -> bytes:
    """Remove or escape white space in JSON, for subscribers with the C# client.

    The C# client splits a frame at spaces and drops everything after the second piece.
    """
    if not any(space in data for space in (b" ", b"\n", b"\t", b"\r")):
        return data
    return _JSON_TOKEN.sub(
        lambda token: token.group().replace(b" ", b"\\u0020") if token.group()[:1] == b'"' else b"", data
    )


def _utf16_units(letter: str) -> tuple[int, ...]:
    encoded = letter.encode("utf-16-be", "surrogatepass")
    return tuple(int.from_bytes(encoded[offset : offset + 2], "big") for offset in range(0, len(encoded), 2))


def _decode_base64(data: bytes) -> bytes:
    try:
        return base64.b64decode(data, validate=True)
    except binascii.Error as error:
        raise FrameError(_("An image isn't base64-encoded")) from error


def _is_json_in_json(frame: bytes) -> bool:
    try:
        text = json.loads(frame)
        return isinstance(text, str) and isinstance(json.loads(text), (dict, list))
    except (ValueError, RecursionError):
        return False


def _replace_nan(data: bytes) -> bytes:
    try:
        value = json.loads(data, parse_constant=lambda _: None, parse_float=_parse_finite)
    except (ValueError, RecursionError):
        return data  # not valid JSON: the subscriber's decoder reports it
    try:
        return json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode()
    except UnicodeEncodeError:  # an unpaired surrogate: JSON can contain it only as an ASCII escape
        return json.dumps(value, separators=(",", ":")).encode()


def _parse_finite(text: str) -> float | None:
    number = float(text)
    return number if math.isfinite(number) else None
