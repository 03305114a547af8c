"""Text of somebody else: which letters a name may not have, and how to show a text that has them.

A letter *controls* when it does something instead of being seen: it moves a cursor or clears a screen (C0,
DEL, C1), turns the direction of what is written around it, begins a new line, hides, or is half a letter.
"""

from __future__ import annotations

import re

from nep.i18n import _

__all__ = ["control_in", "escaped", "harmless", "quotable", "shortened"]

_QUOTED = 200
"""So many letters of somebody's word are in a sentence."""

_CONTROLS = (
    "\x00-\x1f\x7f-\x9f"  # C0, DEL and C1: cursor, colours, screen, title, clipboard
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u206f"  # the direction of writing
    "\u2028\u2029"  # a new line, a new paragraph
    "\u200b\u2060-\u2065\ufeff\ufff9-\ufffb"  # nothing to be seen: two names would look the same
    "\ud800-\udfff"  # half a letter: no encoding has a form for it
)
_CONTROL = re.compile(f"[{_CONTROLS}]")
_CONTROL_IN_LINES = re.compile(f"(?![\n\t])[{_CONTROLS}]")


def control_in(text: str) -> str:
    r"""The first letter of `text` that controls, as one can read it (`\x1b`); "" when there is none."""
    found = _CONTROL.search(text)
    return "" if found is None else _readable(found)


def escaped(text: str, *, lines: bool = False) -> str:
    r"""`text` with each letter that controls written as `\x1b` or `\u202e`. Can always be encoded as UTF-8.

    With `lines` new lines and tabs stay: for a text of several lines, where nobody can forge one.
    """
    return (_CONTROL_IN_LINES if lines else _CONTROL).sub(_readable, text)


def harmless(text: str, *, lines: bool = False) -> str:
    """`text` without the letters that control, for sentences of somebody else between our own.

    New lines and tabs become spaces, or stay with `lines`.
    """
    if lines:
        return _CONTROL_IN_LINES.sub("", text)
    return _CONTROL.sub("", re.sub("[\n\t\u2028\u2029]", " ", text))


def shortened(text: str, most: int) -> str:
    """`text` as it is, or its first `most` letters and how many there are."""
    if len(text) <= most:
        return text
    return _("{beginning}… ({count} characters)").format(beginning=text[:most], count=len(text))


def quotable(text: str) -> str:
    """Somebody's word as a sentence may have it, however long and whatever is in it."""
    return escaped(shortened(text, _QUOTED))


def _readable(found: re.Match[str]) -> str:
    return ascii(found.group())[1:-1]
