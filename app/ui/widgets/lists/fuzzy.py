"""Fuzzy search of the command palette, with scores and the positions of matching letters.

A contiguous match scores higher than separate letters, and the start of a word higher than its middle.
Letters at arbitrary positions don't match, because users wouldn't understand the result. A query that
consists of the initials of a command matches that command best.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter

TEXT_START_SCORE, WORD_START_SCORE, INITIALS_SCORE, SUBSTRING_SCORE, SCATTERED_SCORE = (
    100.0,
    80.0,
    70.0,
    55.0,
    40.0,
)
MIN_STRONG_SHARE = 0.8  # minimum share of letters that begin a word or follow the previous letter
LETTER_PENALTY = 0.05
MAX_FUZZY_ENTRIES = 400  # maximum number of entries of a kind that are matched letter by letter
UNAVAILABLE_PENALTY = 5.0  # penalty of entries that are unavailable now
Span = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Entry:
    """Entry of the command palette.

    Attributes:
        id: Kind and name, such as "command:file.save", "panel:topics", "topic:/faces" or
            "robot:Pepper".
        text: Text to search.
        icon: Name of the icon.
        note: Text on the right.
        key: Shortcut.
        reason: Reason why the entry is unavailable, or "".
    """

    id: str
    text: str
    icon: str = ""
    note: str = ""
    key: str = ""
    reason: str = ""

    @property
    def kind(self) -> str:
        """Kind of the entry, such as "command", "panel", "topic", "robot", "layout", "file" or "example"."""
        return self.id.partition(":")[0]

    @property
    def name(self) -> str:
        """Name of the entry: the part of the id after the kind."""
        return self.id.partition(":")[2]


@dataclass(frozen=True, slots=True)
class Match:
    """Entry that matches a query.

    Attributes:
        entry: Entry.
        score: Score, higher for a better match.
        spans: Ranges of matching letters, as (start, end).
    """

    entry: Entry
    score: float = 0.0
    spans: tuple[Span, ...] = ()


def match(query: str, text: str) -> tuple[float, tuple[Span, ...]] | None:
    """Match a text with a query.

    Args:
        query: Parts separated by spaces, all of which must match, in any order.
        text: Text to search.

    Returns:
        The score and the ranges of matching letters, or None if the text doesn't match.
    """
    lower = text.lower()
    if len(lower) != len(text):  # lower case changes the length of some letters, which would shift positions
        lower = text
    score, spans = 0.0, []
    pieces = query.lower().split()
    for piece in pieces:
        result = _match_piece(piece, lower)
        if result is None:
            return None
        score += result[0]
        spans.extend(result[1])
    return score / max(1, len(pieces)) - LETTER_PENALTY * len(text), _merge(spans)


def _match_piece(piece: str, text: str) -> tuple[float, list[Span]] | None:
    index = text.find(piece)
    if index == 0:
        return TEXT_START_SCORE, [(0, len(piece))]
    first = index
    while index > 0:
        if not text[index - 1].isalnum():
            return WORD_START_SCORE - min(10.0, index / 10), [(index, index + len(piece))]
        index = text.find(piece, index + 1)
    if first > 0:
        return SUBSTRING_SCORE - min(10.0, first / 10), [(first, first + len(piece))]
    return _match_scattered(piece, text)


def _match_scattered(piece: str, text: str) -> tuple[float, list[Span]] | None:
    # Matches letters in order, preferably contiguous or at the start of a word.
    positions: list[int] = []
    strong_hits, start = 0, 0
    for letter in piece:
        if positions and start < len(text) and text[start] == letter:
            position, is_strong = start, True
        else:
            position = _word_start(letter, text, start)
            is_strong = position >= 0
            if not is_strong:
                position = text.find(letter, start)
        if position < 0:
            return None
        strong_hits += is_strong
        positions.append(position)
        start = position + 1
    share = strong_hits / len(piece)
    if share < MIN_STRONG_SHARE:
        return None
    return SCATTERED_SCORE * share - min(15.0, (positions[-1] - positions[0]) / 10), [
        (position, position + 1) for position in positions
    ]


def _word_start(letter: str, text: str, start: int) -> int:
    index = text.find(letter, start)
    while index > 0 and text[index - 1].isalnum():
        index = text.find(letter, index + 1)
    return index


def _merge(spans: Iterable[Span]) -> tuple[Span, ...]:
    # Merges adjacent spans.
    merged: list[Span] = []
    for begin, end in sorted(spans):
        if merged and begin <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((begin, end))
    return tuple(merged)


class Finder:
    """Search index of entries.

    For kinds with many entries only contiguous matches are found, to keep the search fast.
    """

    def __init__(self, entries: Sequence[Entry]) -> None:
        # Entries with equal scores keep their order.
        self.entries = entries
        self._entries_by_kind: dict[str, list[tuple[str, Entry]]] = {}
        for entry in entries:
            self._entries_by_kind.setdefault(entry.kind, []).append((entry.text.lower(), entry))

    def find(self, query: str, limit: int) -> tuple[list[Match], int]:
        """Search the entries.

        Args:
            query: Query, as for `match`.
            limit: Maximum number of matches to return per kind.

        Returns:
            The matches, grouped by kind with the best ones first, and the number of all matches.
        """
        pieces = query.lower().split()
        best: list[list[Match]] = []
        count = 0
        for pairs in self._entries_by_kind.values():
            candidates = [entry for _lower, entry in pairs]
            if len(pairs) > MAX_FUZZY_ENTRIES:
                exact_pairs = [pair for pair in pairs if all(piece in pair[0] for piece in pieces)]
                count += len(exact_pairs) - min(len(exact_pairs), MAX_FUZZY_ENTRIES)
                candidates = [
                    entry
                    for _lower, entry in heapq.nsmallest(
                        MAX_FUZZY_ENTRIES, exact_pairs, key=_by_position(pieces)
                    )
                ]
            results = (_match_entry(query, entry) for entry in candidates)
            matches = [each for each in results if each is not None]
            count += len(matches)
            if matches:
                best.append(heapq.nlargest(limit, matches, key=attrgetter("score")))
        best.sort(key=lambda matches: (not _matches_initials(query, matches), -matches[0].score))
        return [each for matches in best for each in matches], count


def _match_entry(query: str, entry: Entry) -> Match | None:
    result = match(query, entry.text)
    if result is None:
        return None
    score, spans = result
    if is_initials(query, entry.text):
        score = max(score, INITIALS_SCORE - LETTER_PENALTY * len(entry.text))
    return Match(entry, score - (UNAVAILABLE_PENALTY if entry.reason else 0.0), spans)


def _matches_initials(query: str, matches: Sequence[Match]) -> bool:
    return matches[0].entry.kind == "command" and is_initials(query, matches[0].entry.text)


def is_initials(query: str, text: str) -> bool:
    """Return True if a query consists of initials of a text's words, starting with the first word."""
    initials = query.lower().strip()
    first_letters = [word[0] for word in "".join(c if c.isalnum() else " " for c in text.lower()).split()]
    if len(initials) < 2 or not first_letters or initials[0] != first_letters[0]:
        return False
    remaining = iter(first_letters)
    return all(letter in remaining for letter in initials)


def _by_position(pieces: Sequence[str]) -> Callable[[tuple[str, Entry]], tuple[int, int]]:
    # Fast preliminary order, by position of the first part, then by length of the text.
    first = pieces[0] if pieces else ""
    return lambda pair: (pair[0].find(first), len(pair[0]))
