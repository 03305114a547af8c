r"""Keys of a blackboard: names between dots, as in `human.1.position`. Pure.

A dot or a backslash that belongs to a name has a backslash before it: `file.a\.txt` has two names.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from nep.errors import BadKeyError
from nep.i18n import _
from nep.protocol.topic_pattern import levels_match

__all__ = ["MOST_LEVELS", "Key", "key_matches", "key_of_topic", "key_text", "literal_levels", "parse_key"]

Key = tuple[str, ...]
MOST_LEVELS = 32
_MOST_LETTERS = 1_000
_LONGEST = 2 * _MOST_LETTERS + MOST_LEVELS
"""A key as it is written: a backslash before each letter, and the dots."""
_SPECIAL = re.compile(r"([.\\])")
_NAME = re.compile(r"((?:[^.\\]|\\.|\\$)*)(?:\.|$)", re.DOTALL)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_WILD = frozenset({"*", "**"})


def parse_key(key: str | Sequence[str]) -> Key:
    """The names of a key; a tuple of names is taken as it is. Raises `BadKeyError`."""
    if isinstance(key, str):
        if len(key) > _LONGEST:  # it takes time to find out how many names that are
            raise _too_long(key)
        names = tuple(key.split(".")) if "\\" not in key else _names(key)
    elif isinstance(key, tuple) and all(isinstance(each, str) for each in key):
        names = key
    else:
        raise BadKeyError(str(type(key).__name__), _("give a text such as 'human.1.position'"))
    if not names or names == ("",):
        raise BadKeyError("", _("it is empty; give a name such as 'human.1.position'"))
    if len(names) > MOST_LEVELS:
        raise BadKeyError(key_text(names), _("use {most} names at most").format(most=MOST_LEVELS))
    if sum(map(len, names)) > _MOST_LETTERS:
        raise _too_long(key_text(names))
    try:
        "".join(names).encode()
    except UnicodeEncodeError:
        raise BadKeyError(key_text(names), _("it holds half of a surrogate pair")) from None
    return names


def _too_long(key: str) -> BadKeyError:
    return BadKeyError(key, _("use {most} letters at most").format(most=_MOST_LETTERS))


def _names(text: str) -> Key:
    found, at = [], 0
    while True:
        match = _NAME.match(text, at)
        if match is None:  # cannot be: the pattern matches the empty text, too
            raise BadKeyError(text, _("give a text such as 'human.1.position'"))
        found.append(_ESCAPE.sub(r"\1", match[1]))
        if not text[match.end(1) :]:
            return tuple(found)
        at = match.end()


def key_text(names: Key) -> str:
    """A key as it is written; `parse_key` gives the same names again."""
    return ".".join(_SPECIAL.sub(r"\\\1", name) if "." in name or "\\" in name else name for name in names)


def key_of_topic(topic: str) -> Key:
    """`/perception/humans` as a key: `perception.humans`."""
    return tuple(level for level in topic.split("/") if level) or ("topic",)


def key_matches(pattern: Key, key: Key) -> bool:
    """Whether a key matches: `*` is any one name that is not empty, `**` any number of names or none."""
    return levels_match(pattern, key)


def literal_levels(pattern: Key) -> Key:
    """The names before the first wildcard."""
    for number, name in enumerate(pattern):
        if name in _WILD:
            return pattern[:number]
    return pattern
