"""What Studio needs soon, but not to show itself: done after the first paint, a little at a time."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QWidget

AT_THE_LATEST_MS = 2000  # a window that starts minimised, or behind a locked screen, is not painted

_log = logging.getLogger(__name__)


class DeferredSteps(QObject):
    """Takes one step in each turn of the event loop, so that a click waits for one step at most."""

    def __init__(self, window: QWidget, steps: Iterable[Callable[[], object]]) -> None:
        """Begins with the first paint of ``window``. A step that fails is logged; the others are taken."""
        super().__init__(window)
        self._window, self._steps = window, deque(steps)
        self.began = False
        """Whether the window was painted, or it took too long."""
        self._turn = QTimer(self)
        self._turn.timeout.connect(self._take)
        self._late = QTimer(self)
        self._late.setSingleShot(True)
        self._late.timeout.connect(self._begin)
        self._late.start(AT_THE_LATEST_MS)
        window.installEventFilter(self)

    def put_first(self, steps: Sequence[Callable[[], object]]) -> None:
        """Take these before all others."""
        self._steps.extendleft(reversed(steps))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Paint and watched is self._window:
            self._begin()
        return False

    def _begin(self) -> None:
        if not self.began:
            self.began = True
            self._late.stop()
            self._window.removeEventFilter(self)
            self._turn.start(0)

    def _take(self) -> None:
        if not self._steps:
            self._turn.stop()
            return
        step = self._steps.popleft()
        try:
            step()
        except Exception:  # noqa: BLE001  whatever failed fails again, and is told, where it is used
            _log.exception("a step after the first paint failed")

    @property
    def done(self) -> bool:
        """Whether every step was taken."""
        return not self._steps
