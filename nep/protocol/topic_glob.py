"""Patterns of topics as people type them, such as `/*/odom` or `/cam?`. Pure.

`*` is any letters between slashes, `?` is one, `**` is any parts or none. Subscribers know wildcards for
whole levels only (`nep.protocol.topic_pattern`): `widened` makes of a pattern one that hears no less.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["glob_matches", "is_glob", "widened"]


def is_glob(word: str) -> bool:
    """Whether there is a wildcard in it."""
    return any(letter in word for letter in "*?")


def widened(pattern: str) -> str:
    """The pattern for a subscriber that hears all topics that match, and maybe others.

    Only topics with nothing between two slashes in their middle, which nobody has, may be missing.
    """
    first, *others = ("*" if is_glob(each) and each != "**" else each for each in pattern.split("/"))
    if first == "*":  # which is nothing before the first slash, too
        first = "**"
    return "/".join((first, *others))


def glob_matches(pattern: str, topic: str) -> bool:
    """Whether a topic matches: `*` is any letters between slashes, `?` is one, `**` is any parts or none."""
    parts = pattern.split("/")
    at = _with_empty(parts, {0})
    for part in topic.split("/"):
        after = {each for each in at if each < len(parts) and parts[each] == "**"}
        after |= {each + 1 for each in at - after if each < len(parts) and _is_part(parts[each], part)}
        at = _with_empty(parts, after)
    return len(parts) in at


def _with_empty(parts: Sequence[str], at: set[int]) -> set[int]:
    """The places in a pattern, and those behind each `**` there, which may stand for nothing."""
    found = set(at)
    for each in range(len(parts)):
        if each in found and parts[each] == "**":
            found.add(each + 1)
    return found


def _is_part(pattern: str, part: str) -> bool:
    """From left to right, back to the last `*` alone: an expression takes minutes for `*a*a*a*a*a*b`."""
    at = begin = after = 0
    star = -1
    while begin < len(part):
        letter = pattern[at : at + 1]
        if letter == "*":
            star, at, after = at, at + 1, begin
        elif letter and letter in {"?", part[begin]}:
            at, begin = at + 1, begin + 1
        elif star >= 0:
            after += 1  # the star stands for one letter more
            at, begin = star + 1, after
        else:
            return False
    return not pattern[at:].strip("*")
