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

WHOLE, WORD, INITIALS, INSIDE, SPREAD = 100.0, 80.0, 70.0, 55.0, 40.0
MIN_SPREAD = 0.8  # minimum share of letters that begin a word or follow the previous letter
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


def match(query: str, words: str) -> tuple[float, tuple[Span, ...]] | None:
    """Match a text with a query.

    Args:
        query: Parts separated by spaces, all of which must match, in any order.
        words: Text to search.

    Returns:
        The score and the ranges of matching letters, or None if the text doesn't match.
    """
    lower = words.lower()
    if len(lower) != len(words):  # lower case changes the length of some letters, which would shift positions
        lower = words
    score, spans = 0.0, []
    pieces = query.lower().split()
    for piece in pieces:
        found = _match_piece(piece, lower)
        if found is None:
            return None
        score += found[0]
        spans.extend(found[1])
    return score / max(1, len(pieces)) - LETTER_PENALTY * len(words), _merge(spans)


def _match_piece(piece: str, text: str) -> tuple[float, list[Span]] | None:
    place = text.find(piece)
    if place == 0:
        return WHOLE, [(0, len(piece))]
    first = place
    while place > 0:
        if not text[place - 1].isalnum():
            return WORD - min(10.0, place / 10), [(place, place + len(piece))]
        place = text.find(piece, place + 1)
    if first > 0:
        return INSIDE - min(10.0, first / 10), [(first, first + len(piece))]
    return _match_spread(piece, text)


def _match_spread(piece: str, text: str) -> tuple[float, list[Span]] | None:
    # Matches letters in order, preferably contiguous or at the start of a word.
    places: list[int] = []
    good, at = 0, 0
    for letter in piece:
        if places and at < len(text) and text[at] == letter:
            place, well = at, True
        else:
            place = _word_start(letter, text, at)
            well = place >= 0
            if not well:
                place = text.find(letter, at)
        if place < 0:
            return None
        good += well
        places.append(place)
        at = place + 1
    share = good / len(piece)
    if share < MIN_SPREAD:
        return None
    return SPREAD * share - min(15.0, (places[-1] - places[0]) / 10), [(place, place + 1) for place in places]


def _word_start(letter: str, text: str, start: int) -> int:
    place = text.find(letter, start)
    while place > 0 and text[place - 1].isalnum():
        place = text.find(letter, place + 1)
    return place


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
        self._kinds: dict[str, list[tuple[str, Entry]]] = {}
        for entry in entries:
            self._kinds.setdefault(entry.kind, []).append((entry.text.lower(), entry))

    def find(self, query: str, most: int) -> tuple[list[Match], int]:
        """Search the entries.

        Args:
            query: Query, as for `match`.
            most: Maximum number of matches to return per kind.

        Returns:
            The matches, grouped by kind with the best ones first, and the number of all matches.
        """
        pieces = query.lower().split()
        best: list[list[Match]] = []
        count = 0
        for pairs in self._kinds.values():
            few = [entry for _lower, entry in pairs]
            if len(pairs) > MAX_FUZZY_ENTRIES:
                whole = [pair for pair in pairs if all(piece in pair[0] for piece in pieces)]
                count += len(whole) - min(len(whole), MAX_FUZZY_ENTRIES)
                few = [
                    entry
                    for _lower, entry in heapq.nsmallest(MAX_FUZZY_ENTRIES, whole, key=_by_position(pieces))
                ]
            found = [each for each in (_match_entry(query, entry) for entry in few) if each is not None]
            count += len(found)
            if found:
                best.append(heapq.nlargest(most, found, key=attrgetter("score")))
        best.sort(key=lambda found: (not _matches_initials(query, found), -found[0].score))
        return [each for found in best for each in found], count


def _match_entry(query: str, entry: Entry) -> Match | None:
    fits = match(query, entry.text)
    if fits is None:
        return None
    score, spans = fits
    if is_initials(query, entry.text):
        score = max(score, INITIALS - LETTER_PENALTY * len(entry.text))
    return Match(entry, score - (UNAVAILABLE_PENALTY if entry.reason else 0.0), spans)


def _matches_initials(query: str, found: Sequence[Match]) -> bool:
    return found[0].entry.kind == "command" and is_initials(query, found[0].entry.text)


def is_initials(query: str, words: str) -> bool:
    """Return True if a query consists of initials of a text's words, starting with the first word."""
    wanted = query.lower().strip()
    firsts = [word[0] for word in "".join(c if c.isalnum() else " " for c in words.lower()).split()]
    if len(wanted) < 2 or not firsts or wanted[0] != firsts[0]:
        return False
    left = iter(firsts)
    return all(letter in left for letter in wanted)


def _by_position(pieces: Sequence[str]) -> Callable[[tuple[str, Entry]], tuple[int, int]]:
    # Fast preliminary order, by position of the first part, then by length of the text.
    first = pieces[0] if pieces else ""
    return lambda pair: (pair[0].find(first), len(pair[0]))
