"""Topics with wildcards: `/robot/*/camera`. Levels are what stands between slashes.

`*` as a whole level is any one level that is not empty, `**` any number of levels or none, as in the key
expressions of zenoh. A `*` inside a level, as in `a*b`, is a letter as any other.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["is_pattern", "levels_match", "matches"]

_ONE, _ANY = "*", "**"


def is_pattern(topic: str) -> bool:
    """Whether a level of it is a wildcard."""
    return "*" in topic and not {_ONE, _ANY}.isdisjoint(topic.split("/"))


def matches(pattern: str, topic: str) -> bool:
    """Whether a topic matches. Takes no longer than both have levels, multiplied."""
    return pattern == topic or levels_match(pattern.split("/"), topic.split("/"))


def levels_match(parts: Sequence[str], levels: Sequence[str]) -> bool:
    """As `matches`, when both are split into levels already."""
    if _ANY not in parts and len(parts) != len(levels):
        return False
    at = _with_none(parts, {0})
    for level in levels:
        after = {each for each in at if each < len(parts) and parts[each] == _ANY}
        after |= {
            each + 1
            for each in at - after
            if each < len(parts) and (parts[each] == level or (parts[each] == _ONE and level))
        }
        at = _with_none(parts, after)
        if not at:
            return False
    return len(parts) in at


def _with_none(parts: Sequence[str], at: set[int]) -> set[int]:
    """These places in a pattern, and those behind each `**` there, which may be nothing."""
    found = set(at)
    for each, part in enumerate(parts):
        if part == _ANY and each in found:
            found.add(each + 1)
    return found
