"""The letters that choose entries of menus, found anew in whatever language the entries are.

A translator need not think of them: each entry gets a letter of its own words that none of its neighbours
has, the first of a word where that is free.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence


def plain_words(text: str) -> str:
    """An entry's words as they are read: without the sign before a letter, and without its key."""
    return re.sub("&(.)", r"\1", text.partition("\t")[0])


def letters_of(texts: Sequence[str]) -> list[int]:
    """For each text the place of its letter, no letter twice; -1 for one that is left without any.

    First come the beginnings of texts, then those of their other words, then any letter.
    """
    found, taken = [-1] * len(texts), set[str]()
    for places in (_beginning, _beginnings, _all):
        for number, text in enumerate(texts):
            free = (place for place in places(text) if (key := key_of(text[place])) and key not in taken)
            place = next(free, -1) if found[number] < 0 else -1
            if place >= 0:
                found[number] = place
                taken.add(key_of(text[place]))
    return found


def key_of(letter: str) -> str:
    """The key that types a letter, or the one below its accent; "" for what no letter key types."""
    base = unicodedata.normalize("NFD", letter)[:1].upper()
    return base if base.isascii() and base.isalpha() else ""


def marked(texts: Sequence[str]) -> list[str]:
    """The texts with Qt's sign before their letter; an accent would need more than one key with Alt."""
    bare = [re.sub(r"[^\x00-\x7f]", "\N{BULLET}", text) for text in texts]
    return [
        text if place < 0 else f"{text[:place]}&{text[place:]}"
        for text, place in zip(texts, letters_of(bare), strict=True)
    ]


def _beginning(text: str) -> Iterator[int]:
    if text:
        yield 0


def _beginnings(text: str) -> Iterator[int]:
    return (found.start() for found in re.finditer(r"\b\w", text))


def _all(text: str) -> Iterator[int]:
    return iter(range(len(text)))
