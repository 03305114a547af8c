"""Files that come from outside: dropped on the window, or opened by the system (double click on macOS)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

from PySide6.QtCore import QEvent, QMimeData, QObject
from PySide6.QtGui import QDragMoveEvent, QDropEvent, QFileOpenEvent
from PySide6.QtWidgets import QWidget

DROPS = frozenset({QEvent.Type.DragEnter, QEvent.Type.DragMove, QEvent.Type.Drop})


class IncomingFiles(QObject):
    """Opens files that are dropped on a window; ``take`` gets their paths."""

    def __init__(self, window: QWidget, take: Callable[[Sequence[Path]], object]) -> None:
        super().__init__(window)
        self._take = take
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind in DROPS:
            dropped = cast("QDropEvent | QDragMoveEvent", event)
            paths = paths_of(dropped.mimeData())
            if not paths:
                return False
            dropped.acceptProposedAction()
            if kind == QEvent.Type.Drop:
                self._take(paths)
            return True
        if kind == QEvent.Type.FileOpen:
            file = cast("QFileOpenEvent", event).file()
            if file:
                self._take([Path(file)])
                return True
        return super().eventFilter(watched, event)


def paths_of(dropped: QMimeData) -> list[Path]:
    """The files of this computer in what is dragged."""
    return [Path(url.toLocalFile()) for url in dropped.urls() if url.isLocalFile()]
