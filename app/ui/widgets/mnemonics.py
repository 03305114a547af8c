"""Automatic mnemonics for menu entries in the current language.

Translators need not define mnemonics: each entry gets a unique letter of its text, preferably the first
letter of a word.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence


def strip_mnemonic(text: str) -> str:
    """Return the text of a menu entry without its mnemonic marker and shortcut."""
    return re.sub("&(.)", r"\1", text.partition("\t")[0])


def mnemonic_positions(texts: Sequence[str]) -> list[int]:
    """Return the position of the mnemonic letter in each text, or -1 for none; letters are unique.

    First letters of texts take precedence, then first letters of other words, then any letter.
    """
    positions, used_keys = [-1] * len(texts), set[str]()
    for find_positions in (_first_position, _word_positions, _all_positions):
        for number, text in enumerate(texts):
            free = (
                position
                for position in find_positions(text)
                if (key := key_of(text[position])) and key not in used_keys
            )
            position = next(free, -1) if positions[number] < 0 else -1
            if position >= 0:
                positions[number] = position
                used_keys.add(key_of(text[position]))
    return positions


def key_of(letter: str) -> str:
    """Return the upper-case key that types a letter, without its accent; "" if there is none."""
    base = unicodedata.normalize("NFD", letter)[:1].upper()
    return base if base.isascii() and base.isalpha() else ""


def with_mnemonics(texts: Sequence[str]) -> list[str]:
    """Return the texts with "&" before their mnemonic letters.

    Accented letters aren't used, because Alt can't be combined with them.
    """
    ascii_texts = [re.sub(r"[^\x00-\x7f]", "\N{BULLET}", text) for text in texts]
    return [
        text if position < 0 else f"{text[:position]}&{text[position:]}"
        for text, position in zip(texts, mnemonic_positions(ascii_texts), strict=True)
    ]


def _first_position(text: str) -> Iterator[int]:
    if text:
        yield 0


def _word_positions(text: str) -> Iterator[int]:
    return (match.start() for match in re.finditer(r"\b\w", text))


def _all_positions(text: str) -> Iterator[int]:
    return iter(range(len(text)))
