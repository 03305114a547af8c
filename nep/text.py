"""Text of somebody else: which letters a name may not have, and how to show a text that has them.

A letter *controls* when it does something instead of being seen: it moves a cursor or clears a screen (C0,
DEL, C1), turns the direction of what is written around it, begins a new line, hides, or is half a letter.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import islice

from nep.i18n import _

__all__ = ["bounded_str", "control_in", "escaped", "harmless", "quotable", "shortened"]

_QUOTED = 200
"""So many letters of somebody's word are in a sentence."""

_MAX_SHOWN_DEPTH = 8
_MAX_INT_BITS = 1_000  # str() of a longer one takes time with the square of its digits, or raises ValueError

_CONTROLS = (
    "\x00-\x1f\x7f-\x9f"  # C0, DEL and C1: cursor, colours, screen, title, clipboard
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u206f"  # the direction of writing
    "\u2028\u2029"  # a new line, a new paragraph
    "\u200b\u2060-\u2065\ufeff\ufff9-\ufffb"  # nothing to be seen: two names would look the same
    "\ud800-\udfff"  # half a letter: no encoding has a form for it
)
_CONTROL = re.compile(f"[{_CONTROLS}]")
_CONTROL_IN_LINES = re.compile(f"(?![\n\t])[{_CONTROLS}]")
_SURROGATE = re.compile("[\ud800-\udfff]")


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


def bounded_str(value: object, max_length: int = _QUOTED) -> str:
    r"""Return `str(value)`, shortened to `max_length` characters, of a value that a stranger may have sent.

    Never raises, whatever the type, size or nesting, and takes time in proportion to `max_length`, not to
    the value. The text can be encoded as UTF-8: half a surrogate pair is written as `\udc80`. An exception
    without words is its class's name.
    """
    text = shortened(value, max_length) if isinstance(value, str) else _rendered(value, max_length)
    return _SURROGATE.sub(_readable, text)


def quotable(value: object) -> str:
    """Return a stranger's word or value as a sentence may quote it: see `bounded_str` and `escaped`."""
    return escaped(bounded_str(value))


def _rendered(value: object, max_length: int) -> str:
    text = ""
    try:
        for piece in _pieces(value, max_length, 0):
            text += piece
            if len(text) > max_length:
                return text[:max_length] + "…"
    except Exception:  # noqa: BLE001 - a container of somebody's own class, or no stack left
        text = ""
    return text or type(value).__name__


def _pieces(value: object, max_length: int, depth: int) -> Iterator[str]:
    if isinstance(value, Mapping | list | tuple | set | frozenset):
        opening, closing = "[]" if isinstance(value, list | tuple) else "{}"
        yield opening
        if depth == _MAX_SHOWN_DEPTH and value:
            yield "…"
        else:
            for number, item in enumerate(islice(value, max_length)):
                yield ", " if number else ""
                yield from _pieces(item, max_length, depth + 1)
                if isinstance(value, Mapping):
                    yield ": "
                    yield from _pieces(value[item], max_length, depth + 1)
        yield closing
    elif isinstance(value, str | bytes | bytearray):
        yield repr(value[: max_length + 1])
    elif type(value) is int and value.bit_length() > _MAX_INT_BITS:
        yield _("a number of {count} digits").format(count=int(value.bit_length() * 0.30103) + 1)
    else:
        yield _str_of(value)


def _str_of(value: object) -> str:
    try:
        text = str(value)
    except BaseException:  # noqa: BLE001 - the words of a class of somebody's own are their code
        text = ""
    return text or type(value).__name__


def _readable(found: re.Match[str]) -> str:
    return ascii(found.group())[1:-1]
