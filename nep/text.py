"""Functions that make untrusted text safe for names and messages.

A *control character* has an effect instead of a glyph: it moves the cursor or clears the screen (C0, DEL,
C1), changes the text direction, starts a new line, is invisible, or is half a surrogate pair.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import islice

from nep.i18n import _

_MAX_QUOTED_LENGTH = 200
"""Default maximum length of a quoted value in characters."""

_MAX_SHOWN_DEPTH = 8
_MAX_INT_BITS = 1_000  # str() of larger ints takes quadratic time, or raises ValueError

_CONTROL_CHARACTERS = (
    "\x00-\x1f\x7f-\x9f"  # C0, DEL and C1: cursor, colours, screen, title, clipboard
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u206f"  # text direction
    "\u2028\u2029"  # line and paragraph separators
    "\u200b\u2060-\u2065\ufeff\ufff9-\ufffb"  # invisible: two different names would look the same
    "\ud800-\udfff"  # lone surrogates can't be encoded
)
_CONTROL_PATTERN = re.compile(f"[{_CONTROL_CHARACTERS}]")
_CONTROL_EXCEPT_NEWLINES_PATTERN = re.compile(f"(?![\n\t])[{_CONTROL_CHARACTERS}]")
_SURROGATE_PATTERN = re.compile("[\ud800-\udfff]")


def first_control(text: str) -> str:
    r"""Return the first control character of `text`, escaped (`\x1b`), or "" if it has none."""
    match = _CONTROL_PATTERN.search(text)
    return "" if match is None else _escape_match(match)


def escaped(text: str, *, lines: bool = False) -> str:
    r"""Escape the control characters of untrusted text as `\x1b` or `\u202e`. The result is valid UTF-8.

    Args:
        text: The text.
        lines: True to leave newlines and tabs unescaped. Set this only where a forged line can't be
            mistaken for another message.
    """
    return (_CONTROL_EXCEPT_NEWLINES_PATTERN if lines else _CONTROL_PATTERN).sub(_escape_match, text)


def strip_controls(text: str, *, lines: bool = False) -> str:
    """Remove the control characters of untrusted text.

    Args:
        text: The text.
        lines: True to leave newlines and tabs unchanged; otherwise they are replaced by spaces.
    """
    if lines:
        return _CONTROL_EXCEPT_NEWLINES_PATTERN.sub("", text)
    return _CONTROL_PATTERN.sub("", re.sub("[\n\t\u2028\u2029]", " ", text))


def shortened(text: str, max_length: int) -> str:
    """Return `text` if it has at most `max_length` characters, else its beginning followed by its length."""
    if len(text) <= max_length:
        return text
    return _("{beginning}… ({count} characters)").format(beginning=text[:max_length], count=len(text))


def bounded_str(value: object, max_length: int = _MAX_QUOTED_LENGTH) -> str:
    r"""Return `str(value)` of an untrusted value, shortened to `max_length` characters.

    Never raises, whatever the type, size or nesting; the cost depends on `max_length`, not on the value. The
    result is valid UTF-8: lone surrogates are written as `\udc80`. An exception without a message becomes its
    class name.
    """
    text = shortened(value, max_length) if isinstance(value, str) else _render_bounded(value, max_length)
    return _SURROGATE_PATTERN.sub(_escape_match, text)


def quotable(value: object) -> str:
    """Return an untrusted value as text that can be quoted in a message. See `bounded_str` and `escaped`."""
    return escaped(bounded_str(value))


def _render_bounded(value: object, max_length: int) -> str:
    text = ""
    try:
        for piece in _iter_pieces(value, max_length, 0):
            text += piece
            if len(text) > max_length:
                return text[:max_length] + "…"
    except Exception:  # noqa: BLE001 - a container of any class, or stack exhaustion
        text = ""
    return text or type(value).__name__


def _iter_pieces(value: object, max_length: int, depth: int) -> Iterator[str]:
    if isinstance(value, Mapping | list | tuple | set | frozenset):
        opening, closing = "[]" if isinstance(value, list | tuple) else "{}"
        yield opening
        if depth == _MAX_SHOWN_DEPTH and value:
            yield "…"
        else:
            for number, item in enumerate(islice(value, max_length)):
                yield ", " if number else ""
                yield from _iter_pieces(item, max_length, depth + 1)
                if isinstance(value, Mapping):
                    yield ": "
                    yield from _iter_pieces(value[item], max_length, depth + 1)
        yield closing
    elif isinstance(value, str | bytes | bytearray):
        yield repr(value[: max_length + 1])
    elif type(value) is int and value.bit_length() > _MAX_INT_BITS:
        yield _("an integer with {count} digits").format(count=int(value.bit_length() * 0.30103) + 1)
    else:
        yield _safe_str(value)


def _safe_str(value: object) -> str:
    try:
        text = str(value)
    except BaseException:  # noqa: BLE001 - __str__ of any class may raise anything
        text = ""
    return text or type(value).__name__


def _escape_match(match: re.Match[str]) -> str:
    return ascii(match.group())[1:-1]
