"""Names for a program: what people call things, as names that Python takes."""

from __future__ import annotations

import builtins
import keyword
import re
import unicodedata

_GAPS = re.compile(r"\W+")


class Names:
    """Hands out names; each one once."""

    def __init__(self, taken: frozenset[str]) -> None:
        """`taken` are names that the program has already, besides Python's own."""
        self._taken = {*taken, *keyword.kwlist, *keyword.softkwlist, *dir(builtins)}
        self._next: dict[str, int] = {}  # the number to go on with: 4000 scripts may have one name

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
        name = stem = plain.lower() if plain.isascii() else plain
        number = self._next.get(stem, 2)
        while name in self._taken:
            name, number = f"{stem}_{number}", number + 1
        self._next[stem] = number
        self._taken.add(name)
        return name
