"""What a message is compared with, and how many values differ."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.ui.theme import Theme
from app.ui.tree_difference import OFF, Mark, mark_of, parts_of
from app.ui.tree_values import is_container
from app.ui.widgets import Elided, IconButton

MOST = 20_000


def count_changes(value: object, base: object, most: int = MOST) -> dict[Mark, int]:
    """How many values were changed, added and removed; of something added or removed only its top counts.

    At most ``most`` values are looked at.
    """
    counts: dict[Mark, int] = {"changed": 0, "added": 0, "removed": 0}
    if base is OFF:
        return counts
    waiting: list[tuple[object, object, Mark]] = [(value, base, mark_of(value, base))]
    looked = 0
    while waiting and looked < most:
        here, before, mark = waiting.pop()
        looked += 1
        if mark == "changed" and is_container(here) and is_container(before):
            parts = parts_of(here, before, mark, changes_only=True)
            waiting += [(below, was, how) for _key, below, was, how in parts]
        elif mark:
            counts[mark] += 1
    return counts


def changes_words(counts: dict[Mark, int]) -> str:
    """``3 changed, 1 added``; ``no difference``."""
    said = [f"{count} {mark}" for mark, count in counts.items() if count]
    return ", ".join(said) or "no difference"


class CompareStrip(QWidget):
    """A line above the tree while messages are compared: with what, how they differ, changes only."""

    only_changed = Signal(bool)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._with = ""
        self.words = Elided("small", "textSecondary")
        self.only = IconButton(theme, "filter", "Show changes only", checkable=True, size=24)
        self.only.toggled.connect(self.only_changed)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 3, 8, 3)
        row.setSpacing(6)
        row.addWidget(self.words, 1)
        row.addWidget(self.only)
        self.hide()

    def say(self, compared_with: str, counts: dict[Mark, int]) -> None:
        """``Message before: 3 changed, 1 added``."""
        self.words.setText(f"{compared_with}: {changes_words(counts)}")
        self.setAccessibleDescription(self.words.text())
