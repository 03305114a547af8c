r"""Blackboard keys: names separated by dots, as in `human.1.position`. Performs no input or output.

A dot or backslash within a name is escaped with a backslash: `file.a\.txt` has two names.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from nep.errors import BadKeyError
from nep.i18n import _
from nep.protocol.topic_pattern import levels_match

Key = tuple[str, ...]
MAX_LEVELS = 32
_MAX_CHARACTERS = 1_000
_MAX_KEY_TEXT_LENGTH = 2 * _MAX_CHARACTERS + MAX_LEVELS
"""Maximum length of a key as text, with every character escaped and the dots included."""
_SPECIAL_CHARACTER = re.compile(r"([.\\])")
_NAME = re.compile(r"((?:[^.\\]|\\.|\\$)*)(?:\.|$)", re.DOTALL)
_ESCAPE_SEQUENCE = re.compile(r"\\(.)", re.DOTALL)
_WILDCARDS = frozenset({"*", "**"})


def parse_key(key: str | Sequence[str]) -> Key:
    """Split a key at its dots and return the names. A tuple of names is validated and returned unchanged.

    Raises `BadKeyError` if the key is neither a string nor a tuple of strings, is empty, or exceeds a
    limit.
    """
    if isinstance(key, str):
        if len(key) > _MAX_KEY_TEXT_LENGTH:  # splitting it would take long
            raise _too_long_error(key)
        names = tuple(key.split(".")) if "\\" not in key else _split_names(key)
    elif isinstance(key, tuple) and all(isinstance(each, str) for each in key):
        names = key
    else:
        raise BadKeyError(str(type(key).__name__), _("use a string such as 'human.1.position'"))
    if not names or names == ("",):
        raise BadKeyError("", _("the key is empty; use a name such as 'human.1.position'"))
    if len(names) > MAX_LEVELS:
        raise BadKeyError(key_text(names), _("use at most {most} names").format(most=MAX_LEVELS))
    if sum(map(len, names)) > _MAX_CHARACTERS:
        raise _too_long_error(key_text(names))
    try:
        "".join(names).encode()
    except UnicodeEncodeError:
        raise BadKeyError(key_text(names), _("the text contains an unpaired surrogate")) from None
    return names


def _too_long_error(key: str) -> BadKeyError:
    return BadKeyError(key, _("use at most {most} characters").format(most=_MAX_CHARACTERS))


def _split_names(text: str) -> Key:
    names, position = [], 0
    while True:
        match = _NAME.match(text, position)
        if match is None:  # unreachable: the pattern matches the empty text
            raise BadKeyError(text, _("use a string such as 'human.1.position'"))
        names.append(_ESCAPE_SEQUENCE.sub(r"\1", match[1]))
        if not text[match.end(1) :]:
            return tuple(names)
        position = match.end()


def key_text(names: Key) -> str:
    """Join names into a key as text; the inverse of `parse_key`."""
    return ".".join(
        _SPECIAL_CHARACTER.sub(r"\\\1", name) if "." in name or "\\" in name else name for name in names
    )


def topic_to_key(topic: str) -> Key:
    """Convert a topic to a key: `/perception/humans` becomes `perception.humans`."""
    return tuple(level for level in topic.split("/") if level) or ("topic",)


def key_matches(pattern: Key, key: Key) -> bool:
    """Return True if a key matches a pattern.

    In the pattern, `*` matches one non-empty name and `**` any number of names.
    """
    return levels_match(pattern, key)


def literal_prefix(pattern: Key) -> Key:
    """Return the names of a pattern before its first wildcard; all names if it has none."""
    for index, name in enumerate(pattern):
        if name in _WILDCARDS:
            return pattern[:index]
    return pattern
