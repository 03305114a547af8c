"""What a message is compared with, and how many values differ."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.ui.panels.inspector.diff import MOST as LOOKED_THROUGH
from app.ui.panels.inspector.diff import OFF, Mark, mark_of, parts_of
from app.ui.panels.inspector.values import is_container, size_of
from app.ui.theme.theme import Theme
from app.ui.widgets import Elided, IconButton

MOST = 20_000
Counts = dict[Mark, int]


def count_changes(value: object, base: object, most: int = MOST) -> tuple[Counts, bool]:
    """How many values were changed, added and removed, and whether these are all.

    Of something added or removed only its top counts. At most ``most`` values are looked at, and the first
    ones of long lists.
    """
    counts: Counts = {"changed": 0, "added": 0, "removed": 0}
    if base is OFF:
        return counts, True
    whole = True
    waiting: list[tuple[object, object, Mark]] = [(value, base, mark_of(value, base))]
    looked = 0
    while waiting and looked < most:
        here, before, mark = waiting.pop()
        looked += 1
        if mark == "changed" and is_container(here) and is_container(before):
            parts, _total = parts_of(here, before, mark, most, changes_only=True)
            whole = whole and max(size_of(here), size_of(before)) <= LOOKED_THROUGH
            waiting += [(below, was, how) for _key, below, was, how in parts]
        elif mark:
            counts[mark] += 1
    return counts, whole and not waiting


def changes_words(counts: Counts, whole: bool = True) -> str:
    """``3 changed, 1 added``; ``no difference``; ``at least`` in front when not all was looked through."""
    said = ", ".join(f"{count} {mark}" for mark, count in counts.items() if count)
    if not said:
        return "no difference" if whole else "no difference at the start of long lists"
    return said if whole else f"at least {said}"


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

    def say(self, compared_with: str, counts: Counts, whole: bool) -> None:
        """``Message before: 3 changed, 1 added``."""
        self.words.setText(f"{compared_with}: {changes_words(counts, whole)}")
        self.setAccessibleDescription(self.words.text())
