"""Keys that a person presses before the page is ready for them, kept until it is."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QEvent, QObject

_KEYS = (QEvent.Type.KeyPress, QEvent.Type.KeyRelease)
_ELSEWHERE = (QEvent.Type.MouseButtonPress, QEvent.Type.FocusOut)


class HeldKeys:
    """Keeps the keys from the page between a command that gives a field the keyboard and the page's answer.

    Commands and keys go to the page by different ways, and the keys are faster: letters that are typed right
    after *Find a block* would arrive while the page still makes a new behaviour, and go to its canvas.
    """

    def __init__(self, keyboard: Callable[[], QObject | None]) -> None:
        """``keyboard`` is the widget that gets the keys of the page now."""
        self._keyboard = keyboard
        self._kept: list[QEvent] | None = None

    def hold(self) -> None:
        """Keep all keys from now on."""
        if self._kept is None:
            self._kept = []

    def keeps(self, event: QEvent) -> bool:
        """Whether this event of the page's keyboard is kept. Who goes elsewhere lets go what was."""
        if self._kept is None:
            return False
        if event.type() in _KEYS:
            self._kept.append(event.clone())
            return True
        if event.type() in _ELSEWHERE:
            self.let_go()
        return False

    def let_go(self) -> None:
        """Give the page what was kept, in its order."""
        kept, self._kept = self._kept or [], None
        for event in kept:
            keyboard = self._keyboard()
            if keyboard is not None:
                QCoreApplication.sendEvent(keyboard, event)

    def forget(self) -> None:
        """The page is gone: what was typed for it meant what is gone with it."""
        self._kept = None
