"""Parsers for JSON from the block editor's page. Malformed input results in an empty value."""

from __future__ import annotations

import binascii
import json
from base64 import b64decode

from nep.text import bounded_str


def parse_strings(text: str) -> tuple[str, ...]:
    """Return the strings of a JSON list."""
    return tuple(map(bounded_str, _parse_list(text)))


def parse_string_pairs(text: str) -> tuple[tuple[str, str], ...]:
    """Return the pairs of strings, such as robot and sensor, of a JSON list of lists."""
    found = (each for each in _parse_list(text) if isinstance(each, list) and len(each) == 2)
    return tuple((bounded_str(first), bounded_str(second)) for first, second in found)


def decode_data_url(text: str) -> bytes:
    """Return the decoded bytes of a base64 ``data:`` URL."""
    try:
        return b64decode(text.partition(",")[2].encode("ascii", "replace"))
    except binascii.Error:
        return b""


def _parse_list(text: str) -> list[object]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return []
    return found if isinstance(found, list) else []
