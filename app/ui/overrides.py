"""Guards against exceptions that propagate from overridden Qt methods into Qt.

With PySide 6.11 and Python before 3.12 such an exception ends the process (ADR 0018). Therefore the
overrides of all QObject subclasses are wrapped: an exception is passed to `sys.excepthook`, and Qt gets
a neutral return value.
"""

from __future__ import annotations

import functools
import sys
import traceback
from collections.abc import Callable
from types import FunctionType

from PySide6.QtCore import QModelIndex, QObject, QRectF, QSize, Qt
from PySide6.QtGui import QPixmap

RETURN_NONE: Callable[[], object] = type(None)
NEUTRAL_RESULTS: dict[str, Callable[[], object]] = {
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
    "showPopup": RETURN_NONE,
    "scrollContentsBy": RETURN_NONE,
    "highlightBlock": RETURN_NONE,
    # block editor page; the override of interceptRequest itself blocks requests that it can't check
    "acceptNavigationRequest": bool,
    "javaScriptConsoleMessage": RETURN_NONE,
    "interceptRequest": RETURN_NONE,
    "requestStarted": RETURN_NONE,
    # texts; a failed image is empty
    "loadResource": RETURN_NONE,
    # delegates and views
    "paint": RETURN_NONE,
    "initStyleOption": RETURN_NONE,
    "pixmap": QPixmap,
    "scaledPixmap": QPixmap,
    "paintSection": RETURN_NONE,
    "boundingRect": QRectF,
    "drawRow": RETURN_NONE,
    "drawBranches": RETURN_NONE,
    "dataChanged": RETURN_NONE,
    "addItem": RETURN_NONE,
    "count": int,
    "itemAt": RETURN_NONE,
    "takeAt": RETURN_NONE,
    "minimumSize": QSize,
    "setGeometry": RETURN_NONE,
    "expandingDirections": lambda: Qt.Orientation(0),
    "rowCount": int,
    "columnCount": int,
    "data": RETURN_NONE,
    "headerData": RETURN_NONE,
    "setData": bool,
    "index": QModelIndex,
    "parent": QModelIndex,
    "flags": lambda: Qt.ItemFlag.NoItemFlags,
    "hasChildren": bool,
    "canFetchMore": bool,
    "fetchMore": RETURN_NONE,
}
"""Factories of the value that Qt gets from a failed override, by method name.

Failed event handlers (``...Event``) return None.
"""


def guard(cls: type) -> type:
    """Wrap the Qt overrides that a class defines, and return the class.

    The class is modified in place; the function can be used as a decorator.
    """
    for name, method in list(vars(cls).items()):
        result_factory = NEUTRAL_RESULTS.get(name, RETURN_NONE if name.endswith("Event") else None)
        if result_factory is not None and isinstance(method, FunctionType) and _is_qt_override(cls, name):
            setattr(cls, name, guard_function(method, result_factory))
    return cls


def _is_qt_override(cls: type, name: str) -> bool:
    return any(name in vars(base) for base in cls.__mro__ if base.__module__.startswith("PySide6."))


def guard_function(
    method: Callable[..., object], result_factory: Callable[[], object]
) -> Callable[..., object]:
    """Return a wrapper that reports an exception and then returns a neutral value.

    Args:
        method: Method to wrap.
        result_factory: Factory of the neutral return value.
    """

    @functools.wraps(method)
    def override(*args: object, **kwargs: object) -> object:
        try:
            return method(*args, **kwargs)
        except (Exception, SystemExit) as error:  # noqa: BLE001  whatever it is, it ends the process if Qt gets it
            sys.excepthook(type(error), error, error.__traceback__)
            traceback.clear_frames(error.__traceback__)  # a live frame keeps its QPainter active
            return result_factory()

    return override


def guard_all() -> None:
    """Guard all QObject subclasses that are defined after this call, including those of plug-ins."""

    def init_subclass(cls: type, /, **kwargs: object) -> None:
        super(QObject, cls).__init_subclass__(**kwargs)  # type: ignore[misc]  # cls is below QObject
        guard(cls)

    QObject.__init_subclass__ = classmethod(init_subclass)  # type: ignore[assignment, method-assign]  # ADR 0018
