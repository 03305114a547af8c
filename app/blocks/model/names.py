"""Names for a program: what people call things, as names that Python takes, each given out once."""

from __future__ import annotations

import builtins
import keyword
import re
import unicodedata
from collections.abc import Iterable

_GAPS = re.compile(r"\W+")


class Unique:
    """Hands out each text once: one that is taken gets a number behind it, from 2 on."""

    def __init__(self, before_number: str, taken: Iterable[str] = ()) -> None:
        """`before_number` stands between text and number; `taken` are given out already."""
        self._before_number = before_number
        self._taken = set(taken)
        self._next: dict[str, int] = {}  # the number to go on with: 4000 scripts may have one name

    def of(self, text: str) -> str:
        """The text, or the first of its numbers that nobody has."""
        made, number = text, self._next.get(text, 2)
        while made in self._taken:
            made, number = f"{text}{self._before_number}{number}", number + 1
        self._next[text] = number
        self._taken.add(made)
        return made


class Names:
    """Hands out names; each one once."""

    def __init__(self, taken: frozenset[str]) -> None:
        """`taken` are names that the program has already, besides Python's own."""
        self._unique = Unique("_", {*taken, *keyword.kwlist, *keyword.softkwlist, *dir(builtins)})

    def new(self, words: str, otherwise: str) -> str:
        """A name that reads like `words`, such as ``when_started_2``.

        `otherwise` when nothing is left of them.
        """
        # Python compares names in this form: two that look different must not become one.
        plain = _GAPS.sub("_", unicodedata.normalize("NFKC", words)).strip("_")[:60]
        if not plain.isidentifier():
            longer = f"{otherwise}_{plain}"
            plain = longer if plain and longer.isidentifier() else otherwise
        plain = unicodedata.normalize("NFKC", plain)
        return self._unique.of(plain.lower() if plain.isascii() else plain)
