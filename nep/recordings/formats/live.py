"""Channels of live topics in the format of recordings, for clients that read them (`nep web --foxglove`)."""

from __future__ import annotations

from nep.messages.codecs import codec_for
from nep.messages.message import Message, arrived, kind_of
from nep.recordings.formats.channels import ChannelDefinition, Encoding, definition_of, encoding_of

__all__ = ["LiveChannels"]

_FORMS = {"json": "json", "msgpack": "msgpack", "string": "text", "image": "picture"}
"""Forms of topics whose first message hasn't arrived."""


class LiveChannels:
    """Definitions and encodings of channels without a recording."""

    def expected(self, topic: str, msg_type: str) -> ChannelDefinition:
        """Return the most likely channel of a topic that has had no message yet."""
        codec = codec_for(msg_type).name
        message = arrived(kind_of(topic, codec, msg_type), b"", None, 0, 0)
        return definition_of(message, Encoding(_FORMS.get(codec, "wrapped"), b"", 0, 0, is_decodable=True))

    def encoded(self, message: Message, log_ns: int) -> tuple[ChannelDefinition, bytes]:
        """Return the channel of a message that arrived at `log_ns`, and its bytes in that channel."""
        encoding = encoding_of(message, log_ns)
        return definition_of(message, encoding), b"".join((encoding.before, message.raw))
