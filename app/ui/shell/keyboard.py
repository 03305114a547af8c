"""Keyboard navigation between panels, and tracking of the focused panel."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QApplication, QTabBar, QWidget

from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.workbench import Workbench
from app.ui.widgets.keyboard import tab_stops


class PanelFocus(QObject):
    """Controller that moves the focus between panels and highlights the title of the focused one."""

    def __init__(self, bench: Callable[[], Workbench | None], parent: QObject) -> None:
        # `bench` returns the current workbench, or None.
        super().__init__(parent)
        self._bench = bench
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._on_focus_changed)

    def focus_next(self, step: int) -> None:
        """Focus another visible panel by its offset from the focused one, wrapping around.

        Args:
            step: 1 for the next panel, -1 for the previous one.
        """
        bench = self._bench()
        docks = [dock for dock in bench.docks.values() if dock.is_displayed()] if bench is not None else []
        if bench is None or not docks:
            return
        current = self.focused_dock()
        index = docks.index(current) if current in docks else (-1 if step > 0 else 0)
        bench.focus_panel(docks[(index + step) % len(docks)])

    def focus_at(self, number: int) -> None:
        """Focus the open panel at a position, counted from 1 in the order of creation.

        Has no effect if there is no panel at this position.
        """
        bench = self._bench()
        names = bench.open_names() if bench is not None else ()
        if bench is not None and 0 < number <= len(names):
            bench.focus_panel(bench.docks[names[number - 1]])

    def focus(self, dock: Dock | None) -> None:
        """Bring a panel to the front and focus it; None has no effect."""
        bench = self._bench()
        if bench is not None and dock is not None:
            bench.focus_panel(dock)

    def skip_hidden(self, window: QWidget, *, forward: bool) -> bool:
        """Move the focus by Tab, skipping widgets that the user can't see.

        These are widgets behind another tab, and Qt's tab bars, which are replaced by the titles of the
        docks.

        Args:
            window: Window in which the focus moves.
            forward: True for Tab, False for Shift+Tab.

        Returns:
            False if no widget had to be skipped; the focus is then unchanged.
        """
        focus = QApplication.focusWidget()
        if focus is None:
            return False
        has_skipped = False
        for stop in tab_stops(window, focus, forward=forward):
            if not isinstance(stop, QTabBar) and not self._is_covered(stop):
                if has_skipped:
                    reason = Qt.FocusReason.TabFocusReason if forward else Qt.FocusReason.BacktabFocusReason
                    stop.setFocus(reason)
                return has_skipped
            has_skipped = True
        return False

    def _is_covered(self, widget: QWidget) -> bool:
        bench = self._bench()
        docks = bench.docks.values() if bench is not None else ()
        return any(dock.isAncestorOf(widget) and not dock.is_front for dock in docks)

    def focused_dock(self) -> Dock | None:
        """Return the dock that contains the focused widget, or None."""
        focus, bench = QApplication.focusWidget(), self._bench()
        if bench is None or focus is None:
            return None
        return next((dock for dock in bench.docks.values() if _contains(dock, focus)), None)

    def _on_focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        bench = self._bench()
        if new is None or bench is None:
            return
        for dock in bench.docks.values():
            has_focus = _contains(dock, new)
            dock.title.set_active(has_focus)
            if has_focus:
                bench.record_use(dock)


def _contains(dock: Dock, widget: QWidget) -> bool:
    return dock is widget or dock.isAncestorOf(widget)
