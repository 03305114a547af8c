"""Templates for new messages: the newest message of a topic, or an empty message of a type."""

from __future__ import annotations

from collections.abc import Mapping

import orjson

from app.core.run.acting.json_text import MAX_LENGTH, format_json
from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.messages.message import Message
from nep.recordings.formats.schemas import schema_of

_SCALARS: Mapping[str, object] = {"string": "", "boolean": False, "integer": 0, "number": 0.0, "array": []}
_MAX_DEPTH = 10


def is_editable(msg_type: str) -> bool:
    """Return True if messages of this type can be written as text, unlike images and bytes."""
    return codec_for(msg_type).content in {"values", "text"}


def is_plain_text(msg_type: str) -> bool:
    """Return True if messages of this type are plain text instead of JSON."""
    return codec_for(msg_type).content == "text"


def format_message(message: Message) -> str:
    """Return a message as editable text. Raises `NepError` if it can't be written as text."""
    if message.size_bytes > MAX_LENGTH:
        raise NepError(_("The last message is too large to edit by hand."))
    if not is_editable(message.msg_type):
        raise NepError(_("Messages of type {type} can't be edited by hand.").format(type=message.msg_type))
    payload = message.payload
    return payload if isinstance(payload, str) and is_plain_text(message.msg_type) else format_json(payload)


def format_empty_message(msg_type: str) -> str:
    """Return an empty message of a type as editable text; an empty object if the type has no known fields."""
    if is_plain_text(msg_type):
        return ""
    return format_json(_example(orjson.loads(schema_of(msg_type)), 0))


def _example(schema: object, depth: int) -> object:
    if not isinstance(schema, Mapping) or depth > _MAX_DEPTH:
        return None
    kind = schema.get("type")
    if kind == "object":
        fields = schema.get("properties")
        return {str(name): _example(each, depth + 1) for name, each in fields.items()} if fields else {}
    return _SCALARS.get(str(kind))
