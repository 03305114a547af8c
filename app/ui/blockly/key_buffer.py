"""Buffer for key presses that arrive before the page is ready for them."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QEvent, QObject

_KEY_EVENTS = (QEvent.Type.KeyPress, QEvent.Type.KeyRelease)
_RELEASE_EVENTS = (QEvent.Type.MouseButtonPress, QEvent.Type.FocusOut)


class KeyBuffer:
    """Buffer for key presses between a command that focuses a field and the page's reply.

    Commands and keys reach the page by different channels, and keys are faster: letters typed immediately
    after *Find a block* would arrive while the page is still busy, and go to its canvas.
    """

    def __init__(self, key_target: Callable[[], QObject | None]) -> None:
        # `key_target` returns the widget that currently receives the page's keys.
        self._get_key_target = key_target
        self._buffered_events: list[QEvent] | None = None

    def start(self) -> None:
        """Start buffering key presses."""
        if self._buffered_events is None:
            self._buffered_events = []

    def buffer_event(self, event: QEvent) -> bool:
        """Buffer a key press or release and return True; return False for other events.

        Also returns False while buffering is off. A click or the loss of focus sends the buffered keys.
        """
        if self._buffered_events is None:
            return False
        if event.type() in _KEY_EVENTS:
            self._buffered_events.append(event.clone())
            return True
        if event.type() in _RELEASE_EVENTS:
            self.release()
        return False

    def release(self) -> None:
        """Stop buffering and send the buffered keys to the page, in the order in which they were pressed."""
        buffered, self._buffered_events = self._buffered_events or [], None
        for event in buffered:
            key_target = self._get_key_target()
            if key_target is not None:
                QCoreApplication.sendEvent(key_target, event)

    def discard_all(self) -> None:
        """Stop buffering and discard the buffered keys, after the page for which they were typed was lost."""
        self._buffered_events = None
