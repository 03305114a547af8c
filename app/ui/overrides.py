"""What Qt calls in our widgets, layouts and models never raises into Qt.

With PySide 6.11 and Python before 3.12 an error that comes out of such an override, as ``int("x")`` or a
deleted object makes it, ends the process (ADR 0018). So every class below QObject has its overrides guarded:
what goes wrong is told to `sys.excepthook`, and Qt gets an answer that changes nothing.
"""

from __future__ import annotations

import functools
import sys
import traceback
from collections.abc import Callable
from types import FunctionType

from PySide6.QtCore import QModelIndex, QObject, QRectF, QSize, Qt
from PySide6.QtGui import QPixmap

NOTHING: Callable[[], object] = type(None)
ANSWERS: dict[str, Callable[[], object]] = {
    # widgets
    "event": bool,
    "eventFilter": bool,
    "viewportEvent": bool,
    "editorEvent": bool,
    "helpEvent": bool,
    "focusNextPrevChild": bool,
    "sizeHint": QSize,
    "minimumSizeHint": QSize,
    "heightForWidth": lambda: -1,
    "hasHeightForWidth": bool,
    "showPopup": NOTHING,
    "scrollContentsBy": NOTHING,
    "highlightBlock": NOTHING,
    # the page of the block editor; a request that can't be judged is not let through by its override
    "acceptNavigationRequest": bool,
    "javaScriptConsoleMessage": NOTHING,
    "interceptRequest": NOTHING,
    "requestStarted": NOTHING,
    # texts: a picture that can't be read is an empty one
    "loadResource": NOTHING,
    # delegates and views
    "paint": NOTHING,
    "pixmap": QPixmap,
    "scaledPixmap": QPixmap,
    "paintSection": NOTHING,
    "boundingRect": QRectF,
    "drawRow": NOTHING,
    "drawBranches": NOTHING,
    "dataChanged": NOTHING,
    # layouts
    "addItem": NOTHING,
    "count": int,
    "itemAt": NOTHING,
    "takeAt": NOTHING,
    "minimumSize": QSize,
    "setGeometry": NOTHING,
    "expandingDirections": lambda: Qt.Orientation(0),
    # models
    "rowCount": int,
    "columnCount": int,
    "data": NOTHING,
    "headerData": NOTHING,
    "setData": bool,
    "index": QModelIndex,
    "parent": QModelIndex,
    "flags": lambda: Qt.ItemFlag.NoItemFlags,
    "hasChildren": bool,
    "canFetchMore": bool,
    "fetchMore": NOTHING,
}
"""What an override that failed answers, by its name; handlers of events (``...Event``) answer nothing."""


def guard(cls: type) -> type:
    """Guard the overrides that a class defines; the class itself is changed, and given back."""
    for name, made in list(vars(cls).items()):
        answer = ANSWERS.get(name, NOTHING if name.endswith("Event") else None)
        if answer is not None and isinstance(made, FunctionType) and _is_of_qt(cls, name):
            setattr(cls, name, guarded(made, answer))
    return cls


def _is_of_qt(cls: type, name: str) -> bool:
    return any(name in vars(base) for base in cls.__mro__ if base.__module__.startswith("PySide6."))


def guarded(made: Callable[..., object], answer: Callable[[], object]) -> Callable[..., object]:
    """A function that answers ``answer()`` when the one it stands for raises, and tells what was raised."""

    @functools.wraps(made)
    def override(*given: object, **named: object) -> object:
        try:
            return made(*given, **named)
        except (Exception, SystemExit) as error:  # noqa: BLE001  whatever it is, it ends the process if Qt gets it
            sys.excepthook(type(error), error, error.__traceback__)
            traceback.clear_frames(error.__traceback__)  # a painter that is kept would paint for ever
            return answer()

    return override


def guard_all() -> None:
    """Guard every class below QObject that is made from now on, also those of plug-ins."""

    def begin(cls: type, /, **more: object) -> None:
        super(QObject, cls).__init_subclass__(**more)  # type: ignore[misc]  # cls is below QObject
        guard(cls)

    QObject.__init_subclass__ = classmethod(begin)  # type: ignore[assignment, method-assign]  # ADR 0018
