"""Glob patterns of topics on the command line, such as `/*/odom` or `/cam?`. Pure functions.

`*` matches any characters within a level, `?` matches one character, `**` any number of levels.
Subscribers support only wildcards for whole levels (`nep.protocol.topic_pattern`); `widened_pattern`
converts a glob pattern to such a pattern, which may match more topics.
"""

from __future__ import annotations

from collections.abc import Sequence


def is_glob(text: str) -> bool:
    """Return True if a word contains a wildcard."""
    return any(letter in text for letter in "*?")


def widened_pattern(pattern: str) -> str:
    """Return a subscriber's pattern that matches all topics of a glob pattern, and possibly others.

    Topics with an empty level in the middle are not matched; such names are not in use.
    """
    first, *others = ("*" if is_glob(each) and each != "**" else each for each in pattern.split("/"))
    if first == "*":  # also matches the empty level before the first slash
        first = "**"
    return "/".join((first, *others))


def glob_matches(pattern: str, topic: str) -> bool:
    """Return True if a topic matches a glob pattern."""
    parts = pattern.split("/")
    positions = _skip_empty_matches(parts, {0})
    for part in topic.split("/"):
        after = {each for each in positions if each < len(parts) and parts[each] == "**"}
        after |= {
            each + 1 for each in positions - after if each < len(parts) and _level_matches(parts[each], part)
        }
        positions = _skip_empty_matches(parts, after)
    return len(parts) in positions


def _skip_empty_matches(parts: Sequence[str], positions: set[int]) -> set[int]:
    # Adds the positions after each reachable `**`, which may match nothing.
    reachable = set(positions)
    for index in range(len(parts)):
        if index in reachable and parts[index] == "**":
            reachable.add(index + 1)
    return reachable


def _level_matches(pattern: str, part: str) -> bool:
    # Linear backtracking to the last `*` only: a regular expression takes minutes for `*a*a*a*a*a*b`.
    pattern_index = begin = after = 0
    star = -1
    while begin < len(part):
        letter = pattern[pattern_index : pattern_index + 1]
        if letter == "*":
            star, pattern_index, after = pattern_index, pattern_index + 1, begin
        elif letter and letter in {"?", part[begin]}:
            pattern_index, begin = pattern_index + 1, begin + 1
        elif star >= 0:
            after += 1  # let the star match one more character
            pattern_index, begin = star + 1, after
        else:
            return False
    return not pattern[pattern_index:].strip("*")
