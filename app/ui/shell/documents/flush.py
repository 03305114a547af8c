"""Before the window closes: the newest edit, which the block editor tells a moment late, is taken over."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, QTimer

from app.ui.shell.documents.controller import Flushes

LONGEST_MS = 500


class Leaving(QObject):
    """Waits for the editor, half a second at most: an editor that hangs does not keep the window open."""

    def __init__(self, parent: QObject, editor: Callable[[], object], close: Callable[[], object]) -> None:
        """``close`` closes the window; it is called once, when `ready` had to wait."""
        super().__init__(parent)
        self._editor, self._close = editor, close
        self._asked = self._ready = self._waits = False

    def ready(self) -> bool:
        """Whether the window may close now; if not, it is closed as soon as it may."""
        if not self._asked:
            self._asked, self._ready = True, False
            editor = self._editor()
            if isinstance(editor, Flushes):
                editor.flush(self._go_on)
            else:
                self._ready = True
            self._waits = not self._ready
            if self._waits:
                QTimer.singleShot(LONGEST_MS, self, self._go_on)
        return self._ready

    def stay(self) -> None:
        """The window stays open after all: the next time the editor is asked anew."""
        self._asked = self._ready = self._waits = False

    def _go_on(self) -> None:
        self._ready = True
        if self._waits:
            self._waits = False
            QTimer.singleShot(0, self, self._close)
