"""Probe in the real Studio that reports to the tests which texts and controls are visible, and where.

It changes nothing. Python imports this module at startup when its folder is on PYTHONPATH. Requests and
replies are lines of JSON on two pipes, whose file descriptors are in NEP_E2E_PROBE; child processes don't
inherit them.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from functools import cached_property
from typing import NamedTuple

CELL_ROLE = 0x0100  # Qt.UserRole: the value that a table cell shows
TABLE_ROWS = 200


_looked = [0.0, 0.0]  # elapsed and CPU seconds that the probe itself has used


def _spent() -> tuple[float, float]:
    """Return the elapsed time and this thread's CPU time in seconds, without those of the probe."""
    return time.monotonic() - _looked[0], time.thread_time() - _looked[1]


def _open() -> None:
    told = os.environ.pop("NEP_E2E_PROBE", "")
    if not told:
        return
    ask, answer = (int(number) for number in told.split(","))
    for pipe in (ask, answer):
        os.set_inheritable(pipe, False)
    threading.Thread(target=_serve, args=(ask, answer), name="eyes", daemon=True).start()


def _serve(ask: int, answer: int) -> None:
    lock = threading.Lock()

    def reply(number: int, value: object) -> None:
        data = json.dumps({"to": number, "is": value}, default=str).encode() + b"\n"
        with lock, open(answer, "wb", closefd=False) as stream:
            stream.write(data)

    looker = None
    with open(ask, "rb", closefd=False) as stream:
        for line in stream:
            request = json.loads(line)
            if looker is None:
                looker = _looker(reply)
            if looker is None:
                reply(request["n"], None)
            else:
                looker.asked.emit(line.decode())


def _looker(reply):
    widgets = sys.modules.get("PySide6.QtWidgets")
    application = widgets.QApplication.instance() if hasattr(widgets, "QApplication") else None
    if application is None:
        return None
    from PySide6.QtCore import QObject, Signal

    class Looker(QObject):
        asked = Signal(str)

        def look(self, line: str) -> None:
            request = json.loads(line)
            reactions.watch()
            began_s, began_work_s = time.monotonic(), time.thread_time()
            try:
                if request["do"] == "script":
                    _script(request, reply)
                elif request["do"] == "reactions":
                    reply(request["n"], reactions.told())
                else:
                    reply(request["n"], _widgets(application, _Wanted(**request.get("wanted", {}))))
            except Exception as error:  # noqa: BLE001  the tests are told, Studio goes on
                reply(request["n"], {"error": f"{type(error).__name__}: {error}"})
            _looked[0] += time.monotonic() - began_s
            _looked[1] += time.thread_time() - began_work_s

    looker = Looker()
    looker.asked.connect(looker.look)
    looker.moveToThread(application.thread())
    reactions = _reactions(application)
    return looker


def _reactions(application):
    """Measure the time from each press of a key or button to its result on the screen.

    The time starts when the X server sends the event (its clock is the monotonic one) and ends when
    the window has handled the event and painted the updates; the time of the probe is subtracted. The
    page of the block editor measures its own events (Event Timing API).
    """
    from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt

    inputs = {QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonRelease, QEvent.Type.KeyPress}
    painted = QEvent.Type(QEvent.registerEventType())

    class Painted(QEvent):
        def __init__(self, since_ms: int, what: str) -> None:
            super().__init__(painted)
            self.since_ms, self.what = since_ms, what
            self.seen_s, self.spent = time.monotonic(), _spent()

    class Reactions(QObject):
        def __init__(self) -> None:
            super().__init__()
            self.seen: list[list] = []
            self.watched: list = []

        def watch(self) -> None:
            """Install the filter on the open windows, which receive an event before their widgets."""
            for window in application.topLevelWindows():
                if not any(window is each for each in self.watched):
                    self.watched.append(window)
                    window.installEventFilter(self)

        def eventFilter(self, watched, event) -> bool:
            if event.type() in inputs and event.spontaneous():
                late = Painted(event.timestamp(), event.type().name)
                # Below the priority of repaints, so that this event comes after those of the handler.
                QCoreApplication.postEvent(self, late, Qt.EventPriority.LowEventPriority.value - 1)
            return False

        def customEvent(self, event) -> None:
            looked_s = time.monotonic() - event.seen_s - (_spent()[0] - event.spent[0])
            took_ms = time.monotonic() * 1000 % 2**32 - event.since_ms - looked_s * 1000
            work_ms = (_spent()[1] - event.spent[1]) * 1000
            self.seen.append(["window", event.what, round(took_ms, 1), round(work_ms, 1)])

        def told(self) -> list[list]:
            told, self.seen = self.seen, []
            return told

    reactions = Reactions()
    reactions.moveToThread(application.thread())
    return reactions


def _script(request, reply) -> None:
    """Reply with the result of a read-only script in the page of the block editor."""
    view = _web_view_that_shows()
    if view is None:
        reply(request["n"], None)
        return
    view.page().runJavaScript(f"JSON.stringify({request['script']})", lambda got: reply(request["n"], got))


_known: list = []  # cache of the visible view, because searching takes longer than most scripts


def _web_view_that_shows():
    """Return the visible page, or None."""
    import shiboken6
    from PySide6.QtWidgets import QApplication

    if not (_known and shiboken6.isValid(_known[0]) and _known[0].isVisible()):
        kind = _web_view()
        views = [each for each in QApplication.allWidgets() if kind is not None and isinstance(each, kind)]
        _known[:] = [view for view in views if view.isVisible()][:1]
    return _known[0] if _known else None


def _web_view():
    """Return the class of the block editor's view, or None before the first one is created."""
    return getattr(sys.modules.get("PySide6.QtWebEngineWidgets"), "QWebEngineView", None)


class _Wanted(NamedTuple):
    """Filter for the widgets of a request; without values, every widget matches."""

    kind: str = ""
    named: str = ""  # name or text
    says: str = ""  # words in the name, text or description
    is_menu: bool = False

    def has(self, widget) -> bool:
        if self.kind and type(widget).__name__ != self.kind:
            return False
        if self.is_menu and not _is_menu(widget):
            return False
        if self.named:
            return self.named in (widget.accessibleName(), _text(widget))
        if self.says:
            words = (widget.accessibleName(), _text(widget), widget.accessibleDescription())
            return any(self.says in each for each in words)
        return True


class _Around:
    """Visible part and panel of a widget, computed from its ancestors on demand."""

    def __init__(self, widget, outer: _Around | None) -> None:
        self._widget, self._outer = widget, outer

    @cached_property
    def shown(self):
        """Visible part of the widget as a QRect in screen coordinates."""
        from PySide6.QtCore import QPoint, QRect

        place = QRect(self._widget.mapToGlobal(QPoint(0, 0)), self._widget.size())
        return place if self._outer is None else place & self._outer.shown

    @cached_property
    def panel(self) -> str:
        from PySide6.QtWidgets import QDockWidget

        if isinstance(self._widget, QDockWidget):
            return self._widget.objectName().removeprefix("panel.")
        return "" if self._outer is None else self._outer.panel

    @cached_property
    def is_fresh(self) -> bool:
        """True inside a banner that has just appeared and still lets clicks through to the window."""
        from PySide6.QtCore import Qt

        if type(self._widget).__name__ == "AlertBanner":
            return self._widget.testAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        return self._outer is not None and self._outer.is_fresh


def _widgets(application, wanted: _Wanted) -> list[dict]:
    """Return the visible widgets that match, windows first.

    The window is blocked meanwhile, so this must be fast.
    """
    from PySide6.QtWidgets import QWidget

    seen, focus, kind = [], application.focusWidget(), _web_view()

    def walk(widget, outer: _Around | None) -> None:
        around = _Around(widget, outer)
        if wanted.has(widget):
            seen.append(_tell(widget, around, focus, kind))
        for child in widget.children():
            if isinstance(child, QWidget) and child.isVisible() and not child.isWindow():
                walk(child, around)

    for window in application.topLevelWidgets():
        if window.isVisible():
            walk(window, None)
    return seen


def _is_menu(widget) -> bool:
    from PySide6.QtWidgets import QMenu, QMenuBar

    return isinstance(widget, (QMenu, QMenuBar))


def _tell(widget, around: _Around, focus, web_view) -> dict:
    from PySide6.QtCore import QRect
    from PySide6.QtWidgets import QAbstractItemView, QMenuBar

    shown = around.shown
    told = {
        "kind": type(widget).__name__,
        "name": widget.accessibleName(),
        "description": widget.accessibleDescription(),
        "object": widget.objectName(),
        "text": _text(widget),
        "tip": widget.toolTip(),
        "rect": [shown.x(), shown.y(), shown.width(), shown.height()],
        "enabled": widget.isEnabled(),
        "takes_mouse": not around.is_fresh,
        "focus": widget is focus,
        "checked": bool(getattr(widget, "isChecked", bool)()),
        "in": around.panel,
        "window": widget.isWindow(),
    }
    if web_view is not None and isinstance(widget, web_view):
        told["pid"] = widget.page().renderProcessPid()
    if isinstance(widget, QAbstractItemView):
        told["rows"] = _rows(widget)
    if _is_menu(widget):
        told["menu"] = "bar" if isinstance(widget, QMenuBar) else "popup"
        told["entries"] = [
            {"text": action.text(), "rect": _at(widget, QRect(widget.actionGeometry(action)))}
            for action in widget.actions()
            if action.isVisible() and not action.isSeparator()
        ]
    return told


def _text(widget) -> str:
    for name in ("text", "toPlainText", "title", "words"):
        ask = getattr(widget, name, None)
        if callable(ask):
            try:
                value = ask()
            except TypeError:
                continue
            if isinstance(value, str):
                return value
    return ""


def _rows(view) -> list[dict]:
    """Return the expanded rows of a visible table or tree."""
    from PySide6.QtCore import QAbstractListModel, Qt

    model = view.model()
    rows = []

    def tell(parent) -> None:
        for row in range(min(model.rowCount(parent), TABLE_ROWS)):
            columns = 1 if isinstance(model, QAbstractListModel) else model.columnCount(parent)
            indexes = [model.index(row, column, parent) for column in range(columns)]
            cells = [index.data(CELL_ROLE) for index in indexes]
            rows.append(
                {
                    "texts": [_cell(cell, index) for cell, index in zip(cells, indexes, strict=True)],
                    "spoken": str(indexes[0].data(Qt.ItemDataRole.AccessibleTextRole) or ""),
                    "struck": bool(getattr(cells[0], "is_struck_out", False)),
                    "chip": getattr(cells[0], "chip", None),
                    "rect": _at(view.viewport(), view.visualRect(indexes[0])),
                }
            )
            if getattr(view, "isExpanded", lambda _index: False)(indexes[0]):
                tell(indexes[0])

    tell(view.rootIndex())
    return rows


def _cell(cell, index) -> str:
    text = getattr(cell, "text", None)
    return text if isinstance(text, str) else str(index.data() if index.data() is not None else "")


def _at(widget, rect) -> list[int]:
    corner = widget.mapToGlobal(rect.topLeft())
    return [corner.x(), corner.y(), rect.width(), rect.height()]


_open()
