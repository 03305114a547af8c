"""Access to decoded values for the inspector: keys, one-line texts, search and clipboard."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING

from app.core.messages.lazy_json import LazyList, LazyObject
from app.ui.text.numbers import size_text
from nep.i18n import _, ngettext

if TYPE_CHECKING:
    from nep.messages.message import Message

MAX_TEXT_LENGTH = 400
MAX_SEARCHED_VALUES = 20_000


def is_container(value: object) -> bool:
    """Return True for objects and lists, False for text and bytes."""
    if isinstance(value, Mapping):
        return True
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview))


def as_container(value: object) -> object:
    """Return an object or list unchanged, and any other message as an object with the key ``value``."""
    return value if is_container(value) else {"value": value}


def keys_of(value: object, count: int) -> list[str | int]:
    """Return the first `count` keys of an object or indexes of a list; empty for all other values."""
    if isinstance(value, Mapping):
        return [key if isinstance(key, str) else str(key) for key in islice(value, count)]
    if is_container(value):
        return list(range(min(count, len(value))))  # type: ignore[arg-type]
    return []


def values_of(value: object, count: int) -> list[object]:
    """Return the first `count` values of an object or list; empty for all other values."""
    if isinstance(value, Mapping):
        return list(islice(value.values(), count))
    return list(islice(value, count)) if is_container(value) else []  # type: ignore[call-overload]


def size_of(value: object) -> int:
    """Return the number of children of an object or list; 0 for all other values."""
    return len(value) if is_container(value) else 0  # type: ignore[arg-type]


def value_text(value: object) -> str:
    """Format a value as one line.

    Texts are quoted and shortened to `MAX_TEXT_LENGTH` characters. Objects and lists are shown as their
    size, and binary data as its first bytes and its size.
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{{len(value)}}}" if value else "{}"
    if isinstance(value, (bytes, bytearray, memoryview)):
        start = bytes(value[:16]).hex(" ")
        size = ngettext("({count} byte)", "({count} bytes)", len(value)).format(count=len(value))
        return f"{start}{' …' if len(value) > 16 else ''}  {size}"
    if isinstance(value, str):
        text = value if len(value) <= MAX_TEXT_LENGTH else f"{value[:MAX_TEXT_LENGTH]}…"
        return '"' + text.replace("\n", "⏎").replace("\r", "").replace("\t", "⇥") + '"'
    if is_container(value):
        return f"[{size_of(value)}]" if size_of(value) else "[]"
    return repr(value) if isinstance(value, float) else str(value)


def search(value: object, text: str, limit: int = MAX_SEARCHED_VALUES) -> Iterator[tuple[str | int, ...]]:
    """Yield the paths of keys and values that contain a text, in tree order.

    Args:
        value: Decoded message.
        text: Text to find; case is ignored.
        limit: Maximum number of values to check.
    """
    folded_text = text.casefold()
    waiting: list[tuple[tuple[str | int, ...], object]] = [((), value)]
    for _each in range(limit):
        if not waiting:
            return
        path, node = waiting.pop()
        if path and (
            folded_text in str(path[-1]).casefold()
            or (not is_container(node) and folded_text in value_text(node).casefold())
        ):
            yield path
        children = zip(keys_of(node, limit), values_of(node, limit), strict=False)
        waiting.extend(((*path, key), below) for key, below in reversed(list(children)))


def clipboard_text(value: object) -> str:
    """Format a value for the clipboard: text unchanged, binary data in hexadecimal, and others as JSON."""
    if isinstance(value, str):
        return value
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex(" ")
    if isinstance(value, (LazyList, LazyObject)):
        return str(value.text, "utf-8", "replace")
    return json.dumps(value, indent=2, ensure_ascii=False, default=str)


def image_summary(message: Message) -> Mapping[str, object]:
    """Return encoding, shape and size of an image; its pixels are decoded only if the message has no shape.

    Raises `NepError` if the pixels can't be decoded.
    """
    shape = message.extension.get("shape")
    if shape is None:
        shape = list(getattr(message.payload, "shape", ()))
    height, width, *depth = (
        [*shape, 0, 0][: max(2, len(shape))] if isinstance(shape, (list, tuple)) else (0, 0)
    )
    return {
        "encoding": message.extension.get("encoding", _("not reported")),
        "width": width,
        "height": height,
        "channels": depth[0] if depth else 1,
        "size": size_text(message.size_bytes),
    }
