"""Keys with nothing held: the others belong to the text that is typed."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent


def is_plain(event: QKeyEvent) -> bool:
    """Whether nothing is held with a key: Cmd+Down goes to the end of a text on a Mac, Down into the list.

    Arrows of a Mac and keys of a number pad carry a mark of their own, which is nothing that is held.
    """
    return not event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
