"""Parsers for JSON from the block editor's page, which return an empty value for malformed input."""

from __future__ import annotations

import binascii
import json
from base64 import b64decode

from nep.text import bounded_str


def parse_strings(text: str) -> tuple[str, ...]:
    """Parse a JSON list of strings."""
    return tuple(map(bounded_str, _parse_list(text)))


def parse_string_pairs(text: str) -> tuple[tuple[str, str], ...]:
    """Parse a JSON list of string pairs, such as robot and sensor; other items are dropped."""
    pairs = (each for each in _parse_list(text) if isinstance(each, list) and len(each) == 2)
    return tuple((bounded_str(first), bounded_str(second)) for first, second in pairs)


def decode_data_url(text: str) -> bytes:
    """Decode a base64 ``data:`` URL; return empty bytes if it is malformed."""
    try:
        return b64decode(text.partition(",")[2].encode("ascii", "replace"))
    except binascii.Error:
        return b""


def _parse_list(text: str) -> list[object]:
    try:
        items = json.loads(text)
    except (ValueError, RecursionError):
        return []
    return items if isinstance(items, list) else []
