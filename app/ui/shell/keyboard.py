"""Keyboard focus of panels: tracking the focused panel, and navigation between panels."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QApplication, QTabBar, QWidget

from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.workbench import Workbench
from app.ui.widgets.keyboard import tab_stops


class PanelFocus(QObject):
    """Moves the focus between panels of the current workbench, and highlights the focused panel's title."""

    def __init__(self, bench: Callable[[], Workbench | None], parent: QObject) -> None:
        # `bench` returns the current workbench, or None.
        super().__init__(parent)
        self._bench = bench
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._on_focus_changed)

    def next(self, step: int) -> None:
        """Focus the next visible panel, or the previous one for -1."""
        bench = self._bench()
        docks = [dock for dock in bench.docks.values() if dock.is_displayed()] if bench is not None else []
        if bench is None or not docks:
            return
        current = self.dock()
        place = docks.index(current) if current in docks else (-1 if step > 0 else 0)
        bench.focus_panel(docks[(place + step) % len(docks)])

    def number(self, number: int) -> None:
        """Focus the open panel with this number, counted from 1."""
        bench = self._bench()
        names = bench.open_names() if bench is not None else ()
        if bench is not None and 0 < number <= len(names):
            bench.focus_panel(bench.docks[names[number - 1]])

    def focus(self, dock: Dock | None) -> None:
        """Bring a panel to the front and focus it."""
        bench = self._bench()
        if bench is not None and dock is not None:
            bench.focus_panel(dock)

    def skip_hidden(self, window: QWidget, *, forward: bool) -> bool:
        """Move the focus by Tab past widgets that aren't really visible. Return False if there are none.

        Such widgets are behind another tab, or are Qt's tab bars, which titles replace.
        """
        focus = QApplication.focusWidget()
        if focus is None:
            return False
        skipped = False
        for stop in tab_stops(window, focus, forward=forward):
            if not isinstance(stop, QTabBar) and not self._is_covered(stop):
                if skipped:
                    reason = Qt.FocusReason.TabFocusReason if forward else Qt.FocusReason.BacktabFocusReason
                    stop.setFocus(reason)
                return skipped
            skipped = True
        return False

    def _is_covered(self, widget: QWidget) -> bool:
        bench = self._bench()
        docks = bench.docks.values() if bench is not None else ()
        return any(dock.isAncestorOf(widget) and not dock.front for dock in docks)

    def dock(self) -> Dock | None:
        """Return the dock that has the focus, or None."""
        focus, bench = QApplication.focusWidget(), self._bench()
        if bench is None or focus is None:
            return None
        return next((dock for dock in bench.docks.values() if _contains(dock, focus)), None)

    def _on_focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        bench = self._bench()
        if new is None or bench is None:
            return
        for dock in bench.docks.values():
            has = _contains(dock, new)
            dock.title.set_active(has)
            if has:
                bench.record_use(dock)


def _contains(dock: Dock, widget: QWidget) -> bool:
    return dock is widget or dock.isAncestorOf(widget)
