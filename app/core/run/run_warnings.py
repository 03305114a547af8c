"""Warnings of a program, shown on its blocks until the next edit or run."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from nep.i18n import ngettext


class RunWarnings:
    """Newest warning of each block. In the Console, the 1st, 10th, 100th, ... occurrence is logged."""

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self.by_block: Mapping[str, str] = {}
        self._counts: dict[tuple[str, str], int] = {}
        self._logged_counts: dict[tuple[str, str], int] = {}
        self._edit_count = 0

    def reset(self) -> None:
        """Clear all warnings at the start of a run."""
        self.by_block = {}
        self._counts, self._logged_counts = {}, {}

    def clear_if_edited(self, edits: int) -> bool:
        """Remove all warnings if there were edits since the newest one; return True if any were removed.

        Args:
            edits: Current number of edits of the behaviour.
        """
        if not self.by_block or edits == self._edit_count:
            return False
        self.by_block = {}
        return True

    def add(self, block: str, message: str, count: int, edits: int = 0) -> None:
        """Add a warning.

        Args:
            block: Id of the block.
            message: Text of the warning.
            count: Number of occurrences in this run.
            edits: Current number of edits of the behaviour.
        """
        self._edit_count = edits
        key = (block, message)
        self._counts[key] = count
        self.by_block = {**self.by_block, block: with_count(message, count)}
        if count >= 10 * self._logged_counts.get(key, 0) or key not in self._logged_counts:
            self._log_count(key)

    def log_final_counts(self) -> None:
        """Log the final number of occurrences of each warning."""
        for key, count in self._counts.items():
            if count != self._logged_counts[key]:
                self._log_count(key)

    def _log_count(self, key: tuple[str, str]) -> None:
        self._logged_counts[key] = self._counts[key]
        self._log(with_count(key[1], self._counts[key]))


def with_count(message: str, count: int) -> str:
    """Append the number of occurrences to a sentence, if there is more than one."""
    if count == 1:
        return message
    return ngettext("{sentence} ({count} time)", "{sentence} ({count} times)", count).format(
        sentence=message, count=count
    )
