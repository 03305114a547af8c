"""Deferred startup steps, which are run one at a time after the first paint."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QWidget

MAX_DELAY_MS = 2000  # a window that starts minimised, or behind a locked screen, is not painted

_log = logging.getLogger(__name__)


class DeferredSteps(QObject):
    """Runner for startup steps that begins after the first paint of a window, or after `MAX_DELAY_MS`.

    One step is run per iteration of the event loop, so that a click waits for at most one step.
    """

    def __init__(self, window: QWidget, steps: Iterable[Callable[[], object]]) -> None:
        # Starts after the first paint of `window`. An exception in a step is logged, and the next step
        # follows.
        super().__init__(window)
        self._window, self._steps = window, deque(steps)
        self.has_started = False
        """True once the window was painted or the time limit has passed."""
        self._idle_timer = QTimer(self)
        self._idle_timer.timeout.connect(self._run_step)
        self._deadline_timer = QTimer(self)
        self._deadline_timer.setSingleShot(True)
        self._deadline_timer.timeout.connect(self._start)
        self._deadline_timer.start(MAX_DELAY_MS)
        window.installEventFilter(self)

    def prepend(self, steps: Sequence[Callable[[], object]]) -> None:
        """Insert steps before all pending ones."""
        self._steps.extendleft(reversed(steps))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Paint and watched is self._window:
            self._start()
        return False

    def _start(self) -> None:
        if not self.has_started:
            self.has_started = True
            self._deadline_timer.stop()
            self._window.removeEventFilter(self)
            self._idle_timer.start(0)

    def _run_step(self) -> None:
        if not self._steps:
            self._idle_timer.stop()
            return
        step = self._steps.popleft()
        try:
            step()
        except Exception:  # noqa: BLE001  the failure is repeated and reported at the first use
            _log.exception("a deferred step failed")

    @property
    def is_done(self) -> bool:
        """True if no step is pending."""
        return not self._steps
