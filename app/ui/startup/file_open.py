"""Files that are passed to the window: by drag and drop or, on macOS, by the Finder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

from PySide6.QtCore import QEvent, QMimeData, QObject
from PySide6.QtGui import QDragMoveEvent, QDropEvent, QFileOpenEvent
from PySide6.QtWidgets import QApplication, QWidget

DROP_EVENTS = frozenset({QEvent.Type.DragEnter, QEvent.Type.DragMove, QEvent.Type.Drop})


class FileDropFilter(QObject):
    """Event filter that accepts files dropped on a window.

    Args:
        window: Window on which files can be dropped.
        handler: Called with the paths of dropped files.
    """

    def __init__(self, window: QWidget, handler: Callable[[Sequence[Path]], object]) -> None:
        super().__init__(window)
        self._handler = handler
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind in DROP_EVENTS:
            drop_event = cast("QDropEvent | QDragMoveEvent", event)
            paths = paths_of(drop_event.mimeData())
            if not paths:
                return False
            drop_event.acceptProposedAction()
            if kind == QEvent.Type.Drop:
                self._handler(paths)
            return True
        return super().eventFilter(watched, event)


class Application(QApplication):
    """QApplication that receives the files opened by the Finder on macOS.

    Python event filters on the application are rejected, also those of plug-ins: they would receive
    events of the block editor's browser and crash the process, because PySide queries the C++ type of
    each receiver, which Chromium's objects lack (ADR 0018).
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        super().__init__(list(arguments))
        self._handler: Callable[[Sequence[Path]], object] | None = None
        self._pending_paths: list[Path] = []

    def set_file_opener(self, handler: Callable[[Sequence[Path]], object]) -> None:
        """Set the function that opens files, and call it with the files that have arrived before.

        Args:
            handler: Called with the paths.
        """
        self._handler = handler
        paths, self._pending_paths = self._pending_paths, []
        if paths:
            handler(paths)

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.FileOpen and (name := cast("QFileOpenEvent", event).file()):
            if self._handler is None:
                self._pending_paths.append(Path(name))
            else:
                self._handler([Path(name)])
            return True
        return super().event(event)

    def installEventFilter(self, filter_object: QObject) -> None:
        """Raise TypeError, because event filters on the application are not supported.

        Install the filter on a window or a widget instead.
        """
        raise TypeError(
            f"{type(filter_object).__name__} can't filter the events of the whole application: the first one "
            "of the block editor's browser would end Studio; filter those of a window or a widget"
        )


def paths_of(mime_data: QMimeData) -> list[Path]:
    """Return the paths of local files in drag-and-drop data."""
    return [Path(url.toLocalFile()) for url in mime_data.urls() if url.isLocalFile()]
