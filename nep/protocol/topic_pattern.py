"""Topic patterns: `/robot/*/camera`. Levels are separated by slashes.

`*` as a whole level matches one non-empty level, `**` any number of levels, as in zenoh's key expressions. A
`*` inside a level (`a*b`) is an ordinary character.
"""

from __future__ import annotations

from collections.abc import Sequence

_ONE, _ANY = "*", "**"


def is_pattern(topic: str) -> bool:
    """Return True if a level of the topic is a wildcard."""
    return "*" in topic and not {_ONE, _ANY}.isdisjoint(topic.split("/"))


def matches(pattern: str, topic: str) -> bool:
    """Return True if a topic matches a pattern. The cost is the product of their numbers of levels."""
    return pattern == topic or levels_match(pattern.split("/"), topic.split("/"))


def levels_match(parts: Sequence[str], levels: Sequence[str]) -> bool:
    """Return True if the levels of a topic match the levels of a pattern. See `matches`."""
    if _ANY not in parts and len(parts) != len(levels):
        return False
    positions = _skip_empty_matches(parts, {0})
    for level in levels:
        after = {each for each in positions if each < len(parts) and parts[each] == _ANY}
        after |= {
            each + 1
            for each in positions - after
            if each < len(parts) and (parts[each] == level or (parts[each] == _ONE and level))
        }
        positions = _skip_empty_matches(parts, after)
        if not positions:
            return False
    return len(parts) in positions


def _skip_empty_matches(parts: Sequence[str], positions: set[int]) -> set[int]:
    # Adds the positions after each reachable `**`, which may match nothing.
    reachable = set(positions)
    for index, part in enumerate(parts):
        if part == _ANY and index in reachable:
            reachable.add(index + 1)
    return reachable
