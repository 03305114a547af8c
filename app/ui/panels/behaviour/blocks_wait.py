"""Words in the place of the blocks while their page is not there yet."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.ui.widgets import label

WORDS = "Getting the blocks ready."
PATIENCE_S = 0.5


class BlocksWait:
    """Says in the middle of ``place`` that the blocks are on their way.

    Only after half a second: a page that is quick is not announced, so nothing flickers.
    """

    def __init__(self, place: QWidget, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock`` gives seconds."""
        self._place, self._clock = place, clock
        self._since: float | None = None
        self.words = label(WORDS, "bodyLarge", role="textSecondary", wrap=True)
        self.words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.words.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.words.setParent(place)
        self.words.hide()

    def tell(self, *, ready: bool) -> None:
        """Whether the page is there now; call it with every refresh."""
        now = self._clock()
        if ready:
            self._since = None
        elif self._since is None:
            self._since = now
        late = self._since is not None and now - self._since >= PATIENCE_S
        if late:
            self.words.setGeometry(self._place.rect())
            self.words.raise_()
        if late != self.words.isVisibleTo(self._place):
            self.words.setVisible(late)
