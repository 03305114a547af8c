"""Generation of unique Python names from texts of the user."""

from __future__ import annotations

import builtins
import keyword
import re
import unicodedata
from collections.abc import Iterable

_NON_WORD_CHARACTERS = re.compile(r"\W+")


class UniqueTexts:
    """Generator of unique texts: a number is appended to duplicates, starting with 2.

    Args:
        before_number: Separator between text and number.
        used_texts: Texts that must not be returned.
    """

    def __init__(self, before_number: str, used_texts: Iterable[str] = ()) -> None:
        self._before_number = before_number
        self._used_texts = set(used_texts)
        self._next_numbers: dict[str, int] = {}  # next number to try: 4000 scripts may share a name

    def make_unique(self, text: str) -> str:
        """Return the text, or the text with the first unused number if it is not unique."""
        candidate, number = text, self._next_numbers.get(text, 2)
        while candidate in self._used_texts:
            candidate, number = f"{text}{self._before_number}{number}", number + 1
        self._next_numbers[text] = number
        self._used_texts.add(candidate)
        return candidate


class PythonNames:
    """Generator of unique Python names that are neither keywords nor names of builtins.

    Args:
        reserved_names: Names that must not be returned.
    """

    def __init__(self, reserved_names: frozenset[str]) -> None:
        self._unique = UniqueTexts(
            "_", {*reserved_names, *keyword.kwlist, *keyword.softkwlist, *dir(builtins)}
        )

    def new_name(self, text: str, fallback: str) -> str:
        """Return a new name derived from a text, such as ``when_started_2``.

        Args:
            text: Text.
            fallback: Name to use if the text contains no valid character, and prefix if it starts with a
                digit.
        """
        # Python normalizes names to NFKC: different names must stay different.
        python_name = _NON_WORD_CHARACTERS.sub("_", unicodedata.normalize("NFKC", text)).strip("_")[:60]
        if not python_name.isidentifier():
            prefixed_name = f"{fallback}_{python_name}"
            python_name = prefixed_name if python_name and prefixed_name.isidentifier() else fallback
        python_name = unicodedata.normalize("NFKC", python_name)
        return self._unique.make_unique(python_name.lower() if python_name.isascii() else python_name)
