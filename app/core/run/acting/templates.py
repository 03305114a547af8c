"""What a message may look like: as the last one of its topic, or as its type declares."""

from __future__ import annotations

from collections.abc import Mapping

import orjson

from app.core.run.acting.json_text import MOST_LETTERS, pretty
from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.messages.message import Message
from nep.recordings.formats.schemas import schema_of

WRITTEN = frozenset({"json", "msgpack", "string"})
"""The codecs whose messages can be written by hand."""
_SCALARS: Mapping[str, object] = {"string": "", "boolean": False, "integer": 0, "number": 0.0, "array": []}
_DEEPEST = 10


def is_written(msg_type: str) -> bool:
    """Whether messages of this type can be written by hand: no pictures, no bytes."""
    return codec_for(msg_type).name in WRITTEN


def is_plain(msg_type: str) -> bool:
    """Whether such a message is any text, and no JSON."""
    return codec_for(msg_type).name == "string"


def text_of_message(message: Message) -> str:
    """A message as text to begin with. Raises `NepError` for what can't be written by hand."""
    if message.size_bytes > MOST_LETTERS:
        raise NepError(_("The last message is too large to edit by hand."))
    if not is_written(message.msg_type):
        raise NepError(_("Messages of type {type} can't be edited by hand.").format(type=message.msg_type))
    payload = message.payload
    return payload if isinstance(payload, str) and is_plain(message.msg_type) else pretty(payload)


def text_of_type(msg_type: str) -> str:
    """What a type's messages have, each field with nothing in it; an empty map where nothing is declared."""
    if is_plain(msg_type):
        return ""
    return pretty(_example(orjson.loads(schema_of(msg_type)), 0))


def _example(schema: object, depth: int) -> object:
    if not isinstance(schema, Mapping) or depth > _DEEPEST:
        return None
    kind = schema.get("type")
    if kind == "object":
        fields = schema.get("properties")
        return {str(name): _example(each, depth + 1) for name, each in fields.items()} if fields else {}
    return _SCALARS.get(str(kind))
