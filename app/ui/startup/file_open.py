"""Files that other programs pass to the window: by drag and drop or, on macOS, by the system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

from PySide6.QtCore import QEvent, QMimeData, QObject
from PySide6.QtGui import QDragMoveEvent, QDropEvent, QFileOpenEvent
from PySide6.QtWidgets import QApplication, QWidget

DROPS = frozenset({QEvent.Type.DragEnter, QEvent.Type.DragMove, QEvent.Type.Drop})


class IncomingFiles(QObject):
    """Opens files that are dropped on a window; ``take`` is called with their paths."""

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
        return super().eventFilter(watched, event)


class Application(QApplication):
    """QApplication that, on macOS, receives the files that the Finder opens.

    Installing a Python event filter on the application raises an error: the filter would also receive events
    of the block editor's browser and crash the process, because PySide queries each receiver for its C++
    type, and Chromium's have none (ADR 0018). This applies to plug-ins as well.
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        super().__init__(list(arguments))
        self._take: Callable[[Sequence[Path]], object] | None = None
        self._waiting: list[Path] = []

    def open_files_with(self, take: Callable[[Sequence[Path]], object]) -> None:
        """Set the function that opens files, and call it for files that have arrived already."""
        self._take = take
        waiting, self._waiting = self._waiting, []
        if waiting:
            take(waiting)

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.FileOpen and (name := cast("QFileOpenEvent", event).file()):
            if self._take is None:
                self._waiting.append(Path(name))
            else:
                self._take([Path(name)])
            return True
        return super().event(event)

    def installEventFilter(self, filter_object: QObject) -> None:
        """Raise TypeError. Filter the events of a window or a widget instead (see the class)."""
        raise TypeError(
            f"{type(filter_object).__name__} can't filter the events of the whole application: the first one "
            "of the block editor's browser would end Studio; filter those of a window or a widget"
        )


def paths_of(dropped: QMimeData) -> list[Path]:
    """Return the paths of the local files in the data of a drag."""
    return [Path(url.toLocalFile()) for url in dropped.urls() if url.isLocalFile()]
