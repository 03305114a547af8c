"""Warnings of a program at its blocks, shown until the next run or edit."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from nep.i18n import ngettext


class RunWarnings:
    """Newest warning of each block. The Console shows its 1st, 10th, 100th, … occurrence."""

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self.by_block: Mapping[str, str] = {}
        self._counts: dict[tuple[str, str], int] = {}
        self._logged_counts: dict[tuple[str, str], int] = {}
        self._edits = 0

    def begin(self) -> None:
        """Clear everything for a new run."""
        self.by_block = {}
        self._counts, self._logged_counts = {}, {}

    def clear_if_edited(self, edits: int) -> bool:
        """Remove the warnings if there were edits since the newest one; return whether any were removed."""
        if not self.by_block or edits == self._edits:
            return False
        self.by_block = {}
        return True

    def add(self, block: str, sentence: str, count: int, edits: int = 0) -> None:
        """Add a warning with its number of occurrences in this run, at the behaviour's edit count."""
        self._edits = edits
        key = (block, sentence)
        self._counts[key] = count
        self.by_block = {**self.by_block, block: counted(sentence, count)}
        if count >= 10 * self._logged_counts.get(key, 0) or key not in self._logged_counts:
            self._log_count(key)

    def end(self) -> None:
        """Log the final counts."""
        for key, count in self._counts.items():
            if count != self._logged_counts[key]:
                self._log_count(key)

    def _log_count(self, key: tuple[str, str]) -> None:
        self._logged_counts[key] = self._counts[key]
        self._log(counted(key[1], self._counts[key]))


def counted(sentence: str, count: int) -> str:
    """Return the sentence with its count if it occurred more than once."""
    if count == 1:
        return sentence
    return ngettext("{sentence} ({count} time)", "{sentence} ({count} times)", count).format(
        sentence=sentence, count=count
    )
