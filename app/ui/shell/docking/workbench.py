"""Workbench that holds the docks of one layout, and saves and restores their arrangement."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping, Sequence

from PySide6.QtCore import QByteArray, QEvent, Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QMouseEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QWidget

from app.ui.panels.base import Panel, PanelContext, PanelWidget, numbered_title
from app.ui.shell.docking.dock import Dock, create_dock, format_key, parse_key
from app.ui.shell.docking.layouts import Fold, Layout, arranged
from app.ui.shell.docking.sizes import fit, shrink_above
from app.ui.theme.theme import Theme
from nep.i18n import _

HORIZONTAL = Qt.Orientation.Horizontal
VERTICAL = Qt.Orientation.Vertical
MAIN_AREA = Qt.DockWidgetArea.LeftDockWidgetArea
BOTTOM_AREA = Qt.DockWidgetArea.BottomDockWidgetArea
MAX_BOTTOM_SHARE = 0.42
"""Maximum height of a panel below all columns, as a share of the workbench's height."""
STATE_VERSION = 1  # a change also requires a change of app.core.storage.settings.FORMAT_VERSION
MAX_PANELS_PER_KIND = 8


class Workbench(QMainWindow):
    """Window with the docks of one layout. Panels are created when they are first opened.

    A closed panel stays alive, except for the second and further panels of a kind, which are deleted to
    release their resources. `panel_failed` is emitted with the key of a dock and the error message.

    Attributes:
        docks: Docks by key, in the order of their creation.
    """

    panel_failed = Signal(str, str)

    def __init__(
        self,
        theme: Theme,
        layout: Layout,
        panels: Mapping[str, Panel],
        context: PanelContext,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._theme, self._panels, self._context = theme, panels, context
        self._layout = arranged(layout, panels.values())
        self.docks: dict[str, Dock] = {}
        self._prepared_docks: dict[str, Dock] = {}  # created in advance
        self._floating_docks: list[Dock] = []
        self._tab_groups: dict[Dock, list[Dock]] = {}  # panels of a shared place in tab order
        self._active_folds: tuple[Fold, ...] = ()  # active folds, because of a small window or large text
        self._unfolded_state = QByteArray()  # state before folding
        self._is_arranged = False
        self._has_moved_separator = False  # the user has moved a separator
        self._focus_order: list[str] = []  # panels by last focus, latest at the end
        self._split_pair: tuple[Dock, Dock] | None = None  # two docks to be resized to equal sizes
        self._bottom_heights: dict[str, int] = {}  # last heights of closed panels below all others
        self._deleted_states: dict[str, Mapping[str, object]] = {}  # states of panels that a reset deleted
        self._reopened_dock: Dock | None = None  # dock whose height is to be restored
        self.setWindowFlags(Qt.WindowType.Widget)
        self.setProperty("density", layout.density)
        # the style caches the separator width from before the property was set
        self.style().unpolish(self)
        QApplication.sendEvent(self, QEvent(QEvent.Type.StyleChange))
        self.setAccessibleName(_("{layout} layout").format(layout=_(layout.title)))
        gap = theme.size("gap", layout.density)
        self.setContentsMargins(gap, gap, gap, gap)
        self.setDockOptions(QMainWindow.DockOption.AllowNestedDocks | QMainWindow.DockOption.AllowTabbedDocks)
        self.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, self.tabPosition(MAIN_AREA))
        self._tabs_timer = QTimer(self)
        self._tabs_timer.setSingleShot(True)
        self._tabs_timer.timeout.connect(self._update_tabs)
        self._size_timer = QTimer(self)  # resizing works only after Qt has laid out the docks
        self._size_timer.setSingleShot(True)
        self._size_timer.timeout.connect(self._resize_docks)
        self._fold_timer = QTimer(self)
        self._fold_timer.setSingleShot(True)
        self._fold_timer.timeout.connect(self._update_folds)
        theme.changed.connect(self._on_text_size_changed)

    def preload(self, name: str) -> None:
        """Create a panel in advance to avoid a delay when it is opened. The panel is suspended until then."""
        description = self._panels.get(name)
        if description is not None and name not in self.docks and name not in self._prepared_docks:
            self._prepared_docks[name] = dock = create_dock(
                description, self._context, self._layout.density, parent=self
            )
            dock.update_suspension(0.0)

    def reset_layout(self) -> None:
        """Restore the default arrangement of the panels."""
        for old in list(self.docks.values()):
            old.setFloating(False)
            self.removeDockWidget(old)
            if old.description.allows_multiple and old.key not in self._layout.default_panels:
                if old.number == 1:
                    self._deleted_states[old.key] = old.saved_state()
                self._delete_dock(old)  # otherwise a plot would keep its subscriptions
        self._split_pair = None
        # All columns first, then the rows of each: otherwise the rows would extend across the columns.
        pending_columns: list[tuple[Dock, list[tuple[str, ...]]]] = []
        last: Dock | None = None
        for column in self._layout.columns:
            rows = [names for names, _ in column.rows if any(n in self._panels for n in names)]
            rows = [names for names in rows if not set(names) <= self._layout.deferred_panels]
            top_dock = self._add_docks(rows[0], None, last) if rows else None
            if top_dock is not None:
                pending_columns.append((top_dock, rows[1:]))
                last = top_dock
        for top_dock, rows in pending_columns:
            above = top_dock
            for names in rows:
                above = self._add_docks(names, above, None) or above
        self._is_arranged, self._has_moved_separator, self._active_folds = True, False, ()
        self._resize_docks()
        self._size_timer.start(0)
        self._update_folds()

    def _add_docks(self, names: Sequence[str], above: Dock | None, left: Dock | None) -> Dock | None:
        # `names` share a place below "above" or right of "left".
        first: Dock | None = None
        for name in names:
            dock = self._dock(name)
            if dock is None:
                continue
            if first is not None:
                self.tabifyDockWidget(first, dock)
            elif above is not None:
                self.splitDockWidget(above, dock, VERTICAL)
            elif left is not None:
                self.splitDockWidget(left, dock, HORIZONTAL)
            else:
                self.addDockWidget(MAIN_AREA, dock)
            dock.show()
            first = first or dock
        if first is not None:
            first.raise_()
        return first

    def _resize_docks(self) -> None:
        # Has no effect if the user has moved a separator.
        split_pair, self._split_pair = self._split_pair, None
        if split_pair is not None:
            orientation = HORIZONTAL if split_pair[0].y() == split_pair[1].y() else VERTICAL
            self.resizeDocks(split_pair, [1, 1], orientation)
        reopened_dock, self._reopened_dock = self._reopened_dock, None
        if reopened_dock is not None and self._has_moved_separator:
            gap = self._theme.size("gap", self._layout.density)
            bottom_height = self._resize_bottom_dock(self._theme.scaled(1))
            shrink_above(self, self.docks.values(), MAIN_AREA, gap, bottom_height=bottom_height + gap)
        if self._is_arranged and not self._has_moved_separator and not self._fold_timer.isActive():
            gap, scale = self._theme.size("gap", self._layout.density), self._theme.scaled(1)
            bottom_height = self._resize_bottom_dock(scale)
            fit(
                self,
                self._layout,
                self.docks,
                gap,
                scale,
                self._folded_names(),
                bottom_height=bottom_height + gap if bottom_height else 0,
            )

    def _resize_bottom_dock(self, scale: float) -> int:
        # Returns the height.
        for name, height in self._layout.bottom_heights.items():
            dock = self.docks.get(name)
            if (
                dock is None
                or dock.isHidden()
                or dock.isFloating()
                or self.dockWidgetArea(dock) != BOTTOM_AREA
            ):
                continue
            dock_height = self._bottom_heights.get(name) if self._has_moved_separator else None
            dock_height = dock_height or round(min(height * scale, MAX_BOTTOM_SHARE * self.height()))
            self.resizeDocks([dock], [dock_height], VERTICAL)
            return dock_height
        return 0

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.MouseButtonPress and isinstance(event, QMouseEvent):
            self._has_moved_separator = self._has_moved_separator or self.isSeparator(
                event.position().toPoint()
            )
        return super().event(event)

    def _dock(self, key: str) -> Dock | None:
        # Creates the dock on first use.
        if key in self.docks:
            return self.docks[key]
        name, number = parse_key(key)
        description = self._panels.get(name)
        if description is None or number > (MAX_PANELS_PER_KIND if description.allows_multiple else 1):
            return None
        dock = self._prepared_docks.pop(key, None)
        dock = dock or create_dock(description, self._context, self._layout.density, number, self)
        dock.another_requested.connect(self.open_another)
        dock.closed.connect(self._on_dock_closed)
        dock.dockLocationChanged.connect(self._schedule_tabs)
        dock.topLevelChanged.connect(self._schedule_tabs)
        dock.visibilityChanged.connect(self._schedule_tabs)
        if name in self._layout.min_heights:
            dock.visibilityChanged.connect(lambda: self._size_timer.start(0))
        self.docks[key] = dock
        if key in self._deleted_states:
            dock.restore_state(self._deleted_states.pop(key))
        return dock

    def open(self, name: str) -> Dock | None:
        """Show a panel in front, at its last position; return None if the panel isn't available.

        When a panel is opened for the first time, its companion panel is opened too.

        Args:
            name: Key of the dock, which is the name of the panel for the first one of a kind.
        """
        companion = self._layout.companions.get(name, "")
        if companion and name not in self.docks and companion not in self.docks:
            self.open(companion)
        dock = self._dock(name)
        if dock is None:
            return None
        if dock.parent() is not self or self.dockWidgetArea(dock) == Qt.DockWidgetArea.NoDockWidgetArea:
            insert_dock(self, self._layout, self.docks, dock)
            self._size_timer.start(0)
        # otherwise Qt gives the dock half of its previous height
        if dock.isHidden() and name in self._layout.bottom_heights:
            self._reopened_dock = dock
            self._size_timer.start(0)
        dock.retry()
        dock.show()
        dock.raise_()
        self._schedule_tabs()
        return dock

    def open_latest(self, name: str) -> Dock | None:
        """Show the most recently used open panel of a kind, or else the first one of the kind.

        Returns:
            The dock, or None if the panel isn't available.
        """
        return self.open(next((key for key in self.recently_used() if parse_key(key)[0] == name), name))

    def open_another(self, key: str) -> Dock | None:
        """Open an additional panel of a kind next to an existing one.

        If the first panel of this kind is closed, it is opened at its last position.

        Args:
            key: Key of the existing dock.

        Returns:
            The new dock, or None if the panel isn't available or the maximum number of panels is open, which
            a toast explains.
        """
        name = parse_key(key)[0]
        free_numbers = (
            number
            for number in range(1, MAX_PANELS_PER_KIND + 1)
            if not self._is_open(format_key(name, number))
        )
        number = next(free_numbers, 0)
        if not number:
            message = _("The maximum of {count} panels of this kind is already open")
            self._context.show_toast(message.format(count=MAX_PANELS_PER_KIND))
            return None
        if number == 1:
            return self.open(name)
        dock = self._dock(format_key(name, number))
        if dock is None:
            return None
        old = self.docks.get(key)
        insert_beside(self, self._layout, self.docks, dock, old)
        self._has_moved_separator, self._split_pair = True, (old, dock) if old is not None else None
        self._size_timer.start(0)
        dock.show()
        dock.raise_()
        self._schedule_tabs()
        self.focus_panel(dock)
        return dock

    def _is_open(self, key: str) -> bool:
        return key in self.docks and not self.docks[key].isHidden()

    def notify_source_changed(self) -> None:
        """Notify all panels, including closed ones, that the source has changed."""
        for dock in (*self.docks.values(), *self._prepared_docks.values()):
            dock.panel.source_changed()

    def record_use(self, dock: Dock) -> None:
        """Mark a panel as the most recently used one."""
        if self._focus_order[-1:] != [dock.key]:
            self._focus_order = [*(key for key in self._focus_order if key != dock.key), dock.key]

    def recently_used(self) -> tuple[str, ...]:
        """Return the keys of the open docks, most recently used first."""
        open_keys = self.open_names()
        order = self._focus_order
        return tuple(sorted(open_keys, key=lambda key: -order.index(key) if key in order else 1))

    def _on_dock_closed(self, key: str) -> None:
        # An additional panel is deleted unless it is reopened immediately.
        dock = self.docks.get(key)
        if dock is not None and key in self._layout.bottom_heights and not dock.isFloating():
            self._bottom_heights[key] = dock.height()
        if dock is None or dock.number == 1:
            return
        state = dock.saved_state()
        self._delete_dock(dock)
        self._schedule_tabs()

        def reopen() -> None:
            reopened = self.open(key)
            if reopened is not None:
                reopened.restore_state(state)

        title = numbered_title(_(dock.description.title), dock.number)
        self._context.show_toast(_("Closed {panel}").format(panel=title), _("Undo"), reopen)

    def _delete_dock(self, dock: Dock) -> None:
        self.docks.pop(dock.key, None)
        self._tab_groups.pop(dock, None)
        for tab_group in self._tab_groups.values():
            if dock in tab_group:
                tab_group.remove(dock)
        self._focus_order = [key for key in self._focus_order if key != dock.key]
        self._floating_docks = [each for each in self._floating_docks if each is not dock]
        self._split_pair = None
        dock.dispose()
        self.removeDockWidget(dock)
        dock.deleteLater()

    def open_names(self) -> tuple[str, ...]:
        """Return the keys of the open docks, including those behind other tabs."""
        return tuple(name for name, dock in self.docks.items() if not dock.isHidden())

    def _schedule_tabs(self, *_what: object) -> None:
        self._tabs_timer.start(0)

    def _update_tabs(self) -> None:
        folded_names = [name for fold in self._active_folds for name in fold.panels]
        fold_order = {name: index for index, name in enumerate(folded_names)}
        order = sorted(self.docks.values(), key=lambda dock: fold_order.get(dock.key, -1))
        for dock in order:
            tab_group = [
                other
                for other in order
                if other is dock or (other in self.tabifiedDockWidgets(dock) and not other.isHidden())
            ]
            if dock.isFloating() or len(tab_group) < 2:
                tab_group = []
                dock.title.set_tabs(())
            else:
                dock.title.set_tabs(
                    [
                        (other.panel.title(), other.description.icon, other is dock, _create_raiser(other))
                        for other in tab_group
                    ]
                )
            self._tab_groups[dock] = tab_group

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._update_folds()
        self._resize_docks()

    def _on_text_size_changed(self) -> None:
        # Larger text leaves less room.
        self._update_folds()
        self._size_timer.start(0)

    def _update_folds(self) -> None:
        # Folds or unfolds panels depending on the available space.
        scale = self._theme.scaled(1)
        room = self.width() / scale, self.height() / scale
        folds = tuple(fold for fold in self._layout.folds if fold.applies(*room) and self._can_fold(fold))
        if not self._is_arranged or folds == self._active_folds or self._fold_timer.isActive():
            return
        if set(self._active_folds) - set(folds):
            self._fold_timer.start(0)  # Qt creates no tabs in the event loop turn in which it restores docks
            self._unfold()
            return
        if not self._active_folds and folds:
            self._unfolded_state = self.saveState(STATE_VERSION)
        for fold in folds:
            if fold not in self._active_folds:
                self._fold(fold)
        self._active_folds = folds
        self._size_timer.start(0)
        self._schedule_tabs()

    def _can_fold(self, fold: Fold) -> bool:
        # A fold that was active stays valid wherever its panels were moved.
        if fold in self._active_folds:
            return True
        docks = [self.docks.get(name) for name in (fold.target, *fold.panels)]
        return all(dock is not None and not dock.isFloating() for dock in docks)

    def _fold(self, fold: Fold) -> None:
        # Moves the panels with those that share their places; the target panel stays in front.
        target = self.docks[fold.target]
        for name in fold.panels:
            dock = self.docks[name]
            if dock in self.tabifiedDockWidgets(target):
                continue
            for tab_dock in (dock, *self.tabifiedDockWidgets(dock)):
                self.tabifyDockWidget(target, tab_dock)
        target.raise_()

    def _folded_names(self) -> set[str]:
        return {
            name
            for fold in self._active_folds
            for name in fold.panels
            if self.docks[name] in self.tabifiedDockWidgets(self.docks[fold.target])
        }

    def _unfold(self) -> None:
        # Restores the state before folding, because splitting a dock off a tab would create a new tab.
        self._active_folds = ()
        open_keys = self.open_names()
        if not self.restoreState(self._unfolded_state, STATE_VERSION):
            self.reset_layout()
        for name, dock in list(self.docks.items()):
            if name not in open_keys:
                dock.close()
            elif dock.isHidden():
                self.open(name)
        self._size_timer.start(0)
        self._schedule_tabs()

    def hideEvent(self, event: QHideEvent) -> None:
        self._floating_docks = [
            dock for dock in self.docks.values() if dock.isFloating() and dock.isVisible()
        ]
        for dock in self._floating_docks:
            dock.hide()
        super().hideEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        for dock in self._floating_docks:
            dock.show()
        self._floating_docks = []

    def update_suspension(self, now: float) -> None:
        """Suspend hidden panels and resume visible ones.

        Called on every tick, even if the workbench is hidden.

        Args:
            now: Monotonic time in s.
        """
        for name, dock in list(self.docks.items()):
            self._report_failure(name, dock.update_suspension(now))

    def visible_panels(self) -> list[PanelWidget]:
        """Return the panels that are visible to the user."""
        return [dock.panel for dock in self.docks.values() if dock.is_displayed()]

    def shows_video(self) -> bool:
        """Return True if a panel with video is visible; such panels are refreshed at twice the rate."""
        return any(dock.panel.shows_video and dock.is_displayed() for dock in self.docks.values())

    def refresh(self, *, video_only: bool = False) -> None:
        """Refresh the visible panels.

        Args:
            video_only: True to refresh only panels with video.
        """
        for name, dock in list(self.docks.items()):
            if video_only and not dock.panel.shows_video:
                continue
            self._report_failure(name, dock.refresh())
            if dock.is_displayed():
                dock.title.show_badges([other.badge() for other in self._tab_groups.get(dock, ())])

    def _report_failure(self, name: str, message: str | None) -> None:
        if message is not None:
            self.panel_failed.emit(name, message)

    def focus_main_panel(self) -> None:
        """Set the focus to the main panel of the layout, which is the first open one."""
        dock = next((dock for dock in self.docks.values() if not dock.isHidden()), None)
        if dock is not None:
            dock.focus_target().setFocus(Qt.FocusReason.OtherFocusReason)

    def focus_panel(self, dock: Dock) -> None:
        """Bring a panel to the front and set the focus to it."""
        dock.show()
        dock.raise_()
        if dock.isFloating():
            dock.activateWindow()
        dock.focus_target().setFocus(Qt.FocusReason.ShortcutFocusReason)

    def save(self) -> dict[str, object]:
        """Return the arrangement as a JSON-serializable dict for `restore`."""
        return {
            "open": [
                name
                for name, dock in self.docks.items()
                if not dock.isHidden() or dock in self._floating_docks
            ],
            "docks": encode_state(self.saveState(STATE_VERSION)),
            "wide": encode_state(self._unfolded_state),
            "panels": {name: dock.saved_state() for name, dock in self.docks.items()},
            "folds": [fold.panels[0] for fold in self._active_folds],
            "moved": self._has_moved_separator,
        }

    def restore(self, saved: Mapping[str, object]) -> bool:
        """Restore an arrangement returned by `save`.

        Returns:
            False if the arrangement is invalid; the default arrangement is then shown.
        """
        self.reset_layout()
        names, panels = saved.get("open"), saved.get("panels")
        if not isinstance(names, list):
            return False
        for name in names:
            if isinstance(name, str) and name not in self.docks:
                self.open(name)
        if not self.restoreState(decode_state(saved.get("docks")), STATE_VERSION):
            self.reset_layout()
            return False
        self._size_timer.stop()  # keep the saved sizes instead of those of `_resize_docks`
        self._unfolded_state = decode_state(saved.get("wide"))
        self._active_folds, self._has_moved_separator = self._folds_of(saved), saved.get("moved") is True
        for name, dock in self.docks.items():
            panel_state = panels.get(name) if isinstance(panels, Mapping) else None
            if isinstance(panel_state, Mapping):
                dock.restore_state(panel_state)
        self._update_folds()  # the size of window or text may have changed
        self._schedule_tabs()
        return True

    def _folds_of(self, saved: Mapping[str, object]) -> tuple[Fold, ...]:
        # Older settings contain only the first fold, as "narrow".
        names = saved.get("folds")
        if not isinstance(names, list):
            return self._layout.folds[:1] if saved.get("narrow") is True else ()
        return tuple(fold for fold in self._layout.folds if fold.panels[0] in names)

    def dispose(self) -> None:
        """Release the resources of all panels before the window closes."""
        for dock in (*self.docks.values(), *self._prepared_docks.values()):
            dock.dispose()


def _create_raiser(dock: Dock) -> Callable[[], object]:
    def raise_dock() -> None:
        dock.raise_()
        dock.panel.setFocus(Qt.FocusReason.OtherFocusReason)

    return raise_dock


def insert_dock(bench: QMainWindow, layout: Layout, docks: Mapping[str, Dock], dock: Dock) -> None:
    """Insert a new dock into a workbench.

    A panel with a height in ``layout.bottom_heights`` is placed in the bottom area. A deferred panel is
    placed below the row above its own, if that row is open and has no tabs. Any other panel becomes a
    tab of the first panel of its kind (if its number is larger than 1), of its tab target, or of the
    last panel. The first panel is placed in the main area.
    """
    name = dock.description.name
    docks_by_key = {
        other.key: other
        for other in docks.values()
        if other is not dock
        and not other.isFloating()
        and bench.dockWidgetArea(other) != Qt.DockWidgetArea.NoDockWidgetArea
    }
    if name in layout.bottom_heights:
        bench.addDockWidget(BOTTOM_AREA, dock)
        return
    above = _panel_above(layout, name)
    tab_target = name if dock.number > 1 else layout.tab_targets.get(name, "")
    if (
        above in docks_by_key
        and not docks_by_key[above].isHidden()
        and not bench.tabifiedDockWidgets(docks_by_key[above])
    ):
        bench.splitDockWidget(docks_by_key[above], dock, Qt.Orientation.Vertical)
    elif docks_by_key:
        bench.tabifyDockWidget(
            docks_by_key[tab_target] if tab_target in docks_by_key else list(docks_by_key.values())[-1], dock
        )
    else:
        bench.addDockWidget(MAIN_AREA, dock)


def insert_beside(
    bench: QMainWindow, layout: Layout, docks: Mapping[str, Dock], dock: Dock, other: Dock | None
) -> None:
    """Insert a dock by splitting another dock in half along its longer side.

    Args:
        bench: Window with the docks.
        layout: Layout of the window.
        docks: Docks by key.
        dock: Dock to insert.
        other: Dock to split; if it is None, closed or floating, the default position is used.
    """
    if other is None or other.isHidden() or other.isFloating():
        insert_dock(bench, layout, docks, dock)
        return
    orientations = (HORIZONTAL, VERTICAL) if other.width() >= other.height() else (VERTICAL, HORIZONTAL)
    # Qt adds a tab when a tabbed dock is split, so the place is reduced to one panel for a moment. In one
    # direction Qt may still see tabs; if in both, an additional tab is the result.
    tab_docks = [tab_dock for tab_dock in bench.tabifiedDockWidgets(other) if isinstance(tab_dock, Dock)]
    visible_docks = [tab_dock for tab_dock in tab_docks if not tab_dock.isHidden()]
    for orientation in orientations:
        for tab_dock in tab_docks:
            bench.removeDockWidget(tab_dock)
        bench.splitDockWidget(other, dock, orientation)
        is_tab = dock in bench.tabifiedDockWidgets(other)
        for tab_dock in tab_docks:
            bench.tabifyDockWidget(other, tab_dock)
        for tab_dock in visible_docks:
            tab_dock.show()
        if not is_tab and dock not in bench.tabifiedDockWidgets(other):
            break
        if orientation is orientations[0]:
            bench.removeDockWidget(dock)
    other.raise_()


def _panel_above(layout: Layout, name: str) -> str:
    # Panel in the row above that of a deferred panel.
    if name in layout.deferred_panels:
        for column in layout.columns:
            for (names, _), (below, _) in zip(column.rows, column.rows[1:], strict=False):
                if name in below:
                    return names[0]
    return ""


def encode_state(state: QByteArray) -> str:
    """Encode Qt's dock state as Base64 text for the settings."""
    return base64.b64encode(state.data()).decode("ascii")


def decode_state(text: object) -> QByteArray:
    """Decode a dock state from Base64 text; empty if the text is invalid."""
    if not isinstance(text, str):
        return QByteArray()
    try:
        return QByteArray(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        return QByteArray()
