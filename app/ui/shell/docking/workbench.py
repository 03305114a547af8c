"""The workbench: the docks of one layout, where a person moves them, and how they come back."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping, Sequence

from PySide6.QtCore import QByteArray, QEvent, Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QMouseEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QMainWindow

from app.ui.panels.base import Panel, PanelContext, PanelWidget, numbered
from app.ui.shell.docking.dock import Dock, key_of, kind_of, make_dock
from app.ui.shell.docking.layouts import Fold, Layout
from app.ui.shell.docking.sizes import fit, shrink_above
from app.ui.theme.theme import Theme
from nep.i18n import _

ACROSS = Qt.Orientation.Horizontal
DOWN = Qt.Orientation.Vertical
AREA = Qt.DockWidgetArea.LeftDockWidgetArea
BELOW = Qt.DockWidgetArea.BottomDockWidgetArea
MOST_BELOW = 0.42
"""Of the window's height."""
STATE_VERSION = 1  # with another one, app.core.storage.settings.FORMAT is another one, too
MOST_OF_A_KIND = 8


class Workbench(QMainWindow):
    """The docks of one layout, by their keys. Panels are made when they are first opened.

    One that is closed is kept as it is. Of a kind of which several may be open the others end when they are
    closed: whoever made many plots does not pay for those that are gone.
    """

    panel_failed = Signal(str, str)

    def __init__(
        self,
        theme: Theme,
        layout: Layout,
        panels: Mapping[str, Panel],
        context: PanelContext,
    ) -> None:
        super().__init__()
        self._theme, self._layout, self._panels, self._context = theme, layout, panels, context
        self.docks: dict[str, Dock] = {}
        self._ahead: dict[str, Dock] = {}  # made before anybody opened them
        self._floating: list[Dock] = []
        self._sharing: dict[Dock, list[Dock]] = {}  # the panels of a place, in the order of its tabs
        self._folded: tuple[Fold, ...] = ()  # which panels a small window, or large text, made tabs of
        self._wide = QByteArray()  # the state before that
        self._arranged = False
        self._moved = False  # a person moved the lines between panels
        self._used: list[str] = []  # the panels that had the keyboard, the last one at the end
        self._halves: tuple[Dock, Dock] | None = None  # to be made equally large
        self._heights: dict[str, int] = {}  # of panels below all others, as they were closed
        self._set_aside: dict[str, Mapping[str, object]] = {}  # of panels that ended when all were put back
        self._reopened: Dock | None = None  # to have its height again
        self.setWindowFlags(Qt.WindowType.Widget)
        self.setProperty("density", layout.density)
        # the width of the gaps was asked for before the property was there, and is remembered
        self.style().unpolish(self)
        QApplication.sendEvent(self, QEvent(QEvent.Type.StyleChange))
        self.setAccessibleName(_("{layout} layout").format(layout=_(layout.title)))
        gap = theme.size("gap", layout.density)
        self.setContentsMargins(gap, gap, gap, gap)
        self.setDockOptions(QMainWindow.DockOption.AllowNestedDocks | QMainWindow.DockOption.AllowTabbedDocks)
        self.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, self.tabPosition(AREA))
        self._tabs_timer = QTimer(self)
        self._tabs_timer.setSingleShot(True)
        self._tabs_timer.timeout.connect(self._show_tabs)
        self._size_timer = QTimer(self)  # sizes hold only when Qt has laid the docks out
        self._size_timer.setSingleShot(True)
        self._size_timer.timeout.connect(self._size)
        self._fold_timer = QTimer(self)
        self._fold_timer.setSingleShot(True)
        self._fold_timer.timeout.connect(self._adapt)
        theme.changed.connect(self._text_changed)

    # -- opening ----------------------------------------------------------------------------------

    def make_ahead(self, name: str) -> None:
        """Make a panel before it is opened, so that nobody waits for it then; it rests until it is seen."""
        description = self._panels.get(name)
        if description is not None and name not in self.docks and name not in self._ahead:
            self._ahead[name] = made = make_dock(description, self._context, self._layout.density)
            made.follow(0.0)

    def arrange(self) -> None:
        """Put the panels where the layout has them at first; what a person moved is put back."""
        for old in list(self.docks.values()):
            old.setFloating(False)
            self.removeDockWidget(old)
            if old.description.several and old.key not in self._layout.at_first:
                if old.number == 1:
                    self._set_aside[old.key] = old.saved_state()
                self._end(old)  # a plot would go on to look at its topics
        self._halves = None
        # All columns first, then what is below in each: the other way round the rows would cross the columns.
        waiting: list[tuple[Dock, list[tuple[str, ...]]]] = []
        last: Dock | None = None
        for column in self._layout.columns:
            rows = [names for names, _ in column.rows if any(n in self._panels for n in names)]
            rows = [names for names in rows if not set(names) <= self._layout.later]
            head = self._put(rows[0], None, last) if rows else None
            if head is not None:
                waiting.append((head, rows[1:]))
                last = head
        for head, rows in waiting:
            above = head
            for names in rows:
                above = self._put(names, above, None) or above
        self._arranged, self._moved, self._folded = True, False, ()
        self._size()
        self._size_timer.start(0)
        self._adapt()

    def _put(self, names: Sequence[str], above: Dock | None, left: Dock | None) -> Dock | None:
        """Put panels that share a place below ``above``, or right of ``left``."""
        first: Dock | None = None
        for name in names:
            dock = self._dock(name)
            if dock is None:
                continue
            if first is not None:
                self.tabifyDockWidget(first, dock)
            elif above is not None:
                self.splitDockWidget(above, dock, DOWN)
            elif left is not None:
                self.splitDockWidget(left, dock, ACROSS)
            else:
                self.addDockWidget(AREA, dock)
            dock.show()
            first = first or dock
        if first is not None:
            first.raise_()
        return first

    def _size(self) -> None:
        """Give everything its size, unless a person moved the lines between the panels."""
        halves, self._halves = self._halves, None
        if halves is not None:
            way = ACROSS if halves[0].y() == halves[1].y() else DOWN
            self.resizeDocks(halves, [1, 1], way)
        reopened, self._reopened = self._reopened, None
        if reopened is not None and self._moved:
            gap = self._theme.size("gap", self._layout.density)
            below = self._size_below(self._theme.scaled(1))
            shrink_above(self, self.docks.values(), AREA, gap, below=below + gap)
        if self._arranged and not self._moved and not self._fold_timer.isActive():
            gap, scale = self._theme.size("gap", self._layout.density), self._theme.scaled(1)
            below = self._size_below(scale)
            fit(self, self._layout, self.docks, gap, scale, self._behind(), below=below + gap if below else 0)

    def _size_below(self, scale: float) -> int:
        """Give what stands below all others its height, which is told."""
        for name, height in self._layout.below.items():
            dock = self.docks.get(name)
            if dock is None or dock.isHidden() or dock.isFloating() or self.dockWidgetArea(dock) != BELOW:
                continue
            high = self._heights.get(name) if self._moved else None
            high = high or round(min(height * scale, MOST_BELOW * self.height()))
            self.resizeDocks([dock], [high], DOWN)
            return high
        return 0

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.MouseButtonPress and isinstance(event, QMouseEvent):
            self._moved = self._moved or self.isSeparator(event.position().toPoint())
        return super().event(event)

    def _dock(self, key: str) -> Dock | None:
        """The dock of a panel, made when it is the first time; None when there is no such panel."""
        if key in self.docks:
            return self.docks[key]
        name, number = kind_of(key)
        description = self._panels.get(name)
        if description is None or number > (MOST_OF_A_KIND if description.several else 1):
            return None
        dock = self._ahead.pop(key, None)
        dock = dock or make_dock(description, self._context, self._layout.density, number)
        dock.another_wanted.connect(self.open_another)
        dock.closed.connect(self._closed)
        dock.dockLocationChanged.connect(self._tabs_soon)
        dock.topLevelChanged.connect(self._tabs_soon)
        dock.visibilityChanged.connect(self._tabs_soon)
        if name in self._layout.taller:
            dock.visibilityChanged.connect(lambda: self._size_timer.start(0))
        self.docks[key] = dock
        if key in self._set_aside:
            dock.give_back(self._set_aside.pop(key))
        return dock

    def open(self, name: str) -> Dock | None:
        """Show a panel, in front and where it was; None when there is no such panel.

        The first time it brings the panel that belongs to it.
        """
        brought = self._layout.brings.get(name, "")
        if brought and name not in self.docks and brought not in self.docks:
            self.open(brought)
        dock = self._dock(name)
        if dock is None:
            return None
        if dock.parent() is not self or self.dockWidgetArea(dock) == Qt.DockWidgetArea.NoDockWidgetArea:
            join(self, self._layout, self.docks, dock)
            self._size_timer.start(0)
        if dock.isHidden() and name in self._layout.below:  # Qt gives it half of what it had
            self._reopened = dock
            self._size_timer.start(0)
        dock.try_again()
        dock.show()
        dock.raise_()
        self._tabs_soon()
        return dock

    def open_latest(self, name: str) -> Dock | None:
        """Show, of the panels of a kind that are open, the one that a person used last; else the first."""
        return self.open(next((key for key in self.by_use() if kind_of(key)[0] == name), name))

    def open_another(self, key: str) -> Dock | None:
        """Open one more panel of a kind, beside the one that is there; None when there can't be one more."""
        name = kind_of(key)[0]
        free = (number for number in range(1, MOST_OF_A_KIND + 1) if not self._is_open(key_of(name, number)))
        number = next(free, 0)
        if not number:
            said = _("{count} are already open, the maximum")
            self._context.toast(said.format(count=MOST_OF_A_KIND))
            return None
        if number == 1:
            return self.open(name)
        dock = self._dock(key_of(name, number))
        if dock is None:
            return None
        old = self.docks.get(key)
        put_beside(self, self._layout, self.docks, dock, old)
        self._moved, self._halves = True, (old, dock) if old is not None else None
        self._size_timer.start(0)
        dock.show()
        dock.raise_()
        self._tabs_soon()
        self.focus_panel(dock)
        return dock

    def _is_open(self, key: str) -> bool:
        return key in self.docks and not self.docks[key].isHidden()

    def source_changed(self) -> None:
        """Tell all panels, also those that are closed, that another source is shown."""
        for dock in (*self.docks.values(), *self._ahead.values()):
            dock.panel.source_changed()

    def used(self, dock: Dock) -> None:
        """A panel has the keyboard now."""
        if self._used[-1:] != [dock.key]:
            self._used = [*(key for key in self._used if key != dock.key), dock.key]

    def by_use(self) -> tuple[str, ...]:
        """The panels that are open, those that had the keyboard last first."""
        opened = self.open_names()
        return tuple(sorted(opened, key=lambda key: -self._used.index(key) if key in self._used else 1))

    def _closed(self, key: str) -> None:
        """A panel was closed: one beside the first of its kind ends, unless it is wanted back at once."""
        dock = self.docks.get(key)
        if dock is not None and key in self._layout.below and not dock.isFloating():
            self._heights[key] = dock.height()
        if dock is None or dock.number == 1:
            return
        state = dock.saved_state()
        self._end(dock)
        self._tabs_soon()

        def bring_back() -> None:
            again = self.open(key)
            if again is not None:
                again.give_back(state)

        title = numbered(_(dock.description.title), dock.number)
        self._context.toast(_("Closed {panel}").format(panel=title), _("Undo"), bring_back)

    def _end(self, dock: Dock) -> None:
        self.docks.pop(dock.key, None)
        self._sharing.pop(dock, None)
        for together in self._sharing.values():
            if dock in together:
                together.remove(dock)
        self._used = [key for key in self._used if key != dock.key]
        self._floating = [each for each in self._floating if each is not dock]
        self._halves = None
        dock.shut()
        self.removeDockWidget(dock)
        dock.deleteLater()

    def open_names(self) -> tuple[str, ...]:
        """The panels that are open, also those behind a tab."""
        return tuple(name for name, dock in self.docks.items() if not dock.isHidden())

    # -- tabs in the titles -----------------------------------------------------------------------

    def _tabs_soon(self, *_what: object) -> None:
        self._tabs_timer.start(0)

    def _show_tabs(self) -> None:
        later = {name: place for place, name in enumerate(n for f in self._folded for n in f.panels)}
        order = sorted(self.docks.values(), key=lambda dock: later.get(dock.key, -1))
        for dock in order:
            together = [
                other
                for other in order
                if other is dock or (other in self.tabifiedDockWidgets(dock) and not other.isHidden())
            ]
            if dock.isFloating() or len(together) < 2:
                together = []
                dock.title.set_tabs(())
            else:
                dock.title.set_tabs(
                    [
                        (other.panel.title(), other.description.icon, other is dock, _raiser(other))
                        for other in together
                    ]
                )
            self._sharing[dock] = together

    # -- little room ------------------------------------------------------------------------------

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._adapt()
        self._size()

    def _text_changed(self) -> None:
        """Larger text leaves less room."""
        self._adapt()
        self._size_timer.start(0)

    def _adapt(self) -> None:
        """Make tabs of panels where there is too little room for all, and end that where there is enough."""
        scale = self._theme.scaled(1)
        room = self.width() / scale, self.height() / scale
        wanted = tuple(fold for fold in self._layout.folds if fold.wanted(*room) and self._can(fold))
        if not self._arranged or wanted == self._folded or self._fold_timer.isActive():
            return
        if set(self._folded) - set(wanted):
            self._fold_timer.start(0)  # Qt makes no tabs in the turn in which it puts docks back
            self._unfold()
            return
        if not self._folded and wanted:
            self._wide = self.saveState(STATE_VERSION)
        for fold in wanted:
            if fold not in self._folded:
                self._fold(fold)
        self._folded = wanted
        self._size_timer.start(0)
        self._tabs_soon()

    def _can(self, fold: Fold) -> bool:
        """Whether the panels are there for a fold: what was folded stays so wherever a person put it then."""
        if fold in self._folded:
            return True
        docks = [self.docks.get(name) for name in (fold.into, *fold.panels)]
        return all(dock is not None and not dock.isFloating() for dock in docks)

    def _fold(self, fold: Fold) -> None:
        """Make these panels, with those that share their place, tabs of another one, which stays in front."""
        into = self.docks[fold.into]
        for name in fold.panels:
            dock = self.docks[name]
            if dock in self.tabifiedDockWidgets(into):
                continue
            for each in (dock, *self.tabifiedDockWidgets(dock)):
                self.tabifyDockWidget(into, each)
        into.raise_()

    def _behind(self) -> set[str]:
        """The panels that a fold made tabs of, and that a person left there."""
        return {
            name
            for fold in self._folded
            for name in fold.panels
            if self.docks[name] in self.tabifiedDockWidgets(self.docks[fold.into])
        }

    def _unfold(self) -> None:
        """Put back what was before the tabs: Qt makes a tab of whatever is split off a tab."""
        self._folded = ()
        opened = self.open_names()
        if not self.restoreState(self._wide, STATE_VERSION):
            self.arrange()
        for name, dock in list(self.docks.items()):
            if name not in opened:
                dock.close()
            elif dock.isHidden():
                self.open(name)
        self._size_timer.start(0)
        self._tabs_soon()

    def hideEvent(self, event: QHideEvent) -> None:
        self._floating = [dock for dock in self.docks.values() if dock.isFloating() and dock.isVisible()]
        for dock in self._floating:
            dock.hide()
        super().hideEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        for dock in self._floating:
            dock.show()
        self._floating = []

    # -- the tick ---------------------------------------------------------------------------------

    def follow(self, now: float) -> None:
        """Panels that nobody can see rest, others wake; called with every tick, also while it is hidden."""
        for name, dock in list(self.docks.items()):
            self._tell_failure(name, dock.follow(now))

    def shown_panels(self) -> list[PanelWidget]:
        """The panels that can be seen now."""
        return [dock.panel for dock in self.docks.values() if dock.shown()]

    def shows_pictures(self) -> bool:
        """Whether a person sees a panel of pictures, which want to be refreshed twice as often."""
        return any(dock.panel.shows_pictures and dock.shown() for dock in self.docks.values())

    def refresh(self, *, pictures: bool = False) -> None:
        """Let every panel that can be seen show what is new, or only those with ``pictures``."""
        for name, dock in list(self.docks.items()):
            if pictures and not dock.panel.shows_pictures:
                continue
            self._tell_failure(name, dock.refresh())
            if dock.shown():
                dock.title.show_badges([other.badge() for other in self._sharing.get(dock, ())])

    def _tell_failure(self, name: str, sentence: str | None) -> None:
        if sentence is not None:
            self.panel_failed.emit(name, sentence)

    def focus_home(self) -> None:
        """Give the keyboard to the panel that the layout is about: the first that shows."""
        dock = next((dock for dock in self.docks.values() if not dock.isHidden()), None)
        if dock is not None:
            dock.first_stop().setFocus(Qt.FocusReason.OtherFocusReason)

    def focus_panel(self, dock: Dock) -> None:
        """Bring a panel to the front and give it the keyboard."""
        dock.show()
        dock.raise_()
        if dock.isFloating():
            dock.activateWindow()
        dock.first_stop().setFocus(Qt.FocusReason.ShortcutFocusReason)

    # -- kept between starts ----------------------------------------------------------------------

    def save(self) -> dict[str, object]:
        """Where everything is, for `restore`."""
        return {
            "open": [
                name for name, dock in self.docks.items() if not dock.isHidden() or dock in self._floating
            ],
            "docks": state_text(self.saveState(STATE_VERSION)),
            "wide": state_text(self._wide),
            "panels": {name: dock.saved_state() for name, dock in self.docks.items()},
            "folds": [fold.panels[0] for fold in self._folded],
            "moved": self._moved,
        }

    def restore(self, saved: Mapping[str, object]) -> bool:
        """Put everything where `save` found it; False (and the first arrangement) if it does not fit."""
        self.arrange()
        names, panels = saved.get("open"), saved.get("panels")
        if not isinstance(names, list):
            return False
        for name in names:
            if isinstance(name, str) and name not in self.docks:
                self.open(name)
        if not self.restoreState(state_of(saved.get("docks")), STATE_VERSION):
            self.arrange()
            return False
        self._size_timer.stop()  # a person's sizes, not those of `arrange`
        self._wide = state_of(saved.get("wide"))
        self._folded, self._moved = self._folds_of(saved), saved.get("moved") is True
        for name, dock in self.docks.items():
            kept = panels.get(name) if isinstance(panels, Mapping) else None
            if isinstance(kept, Mapping):
                dock.give_back(kept)
        self._adapt()  # the window, or its text, may have another size than then
        self._tabs_soon()
        return True

    def _folds_of(self, saved: Mapping[str, object]) -> tuple[Fold, ...]:
        """What was folded when that was saved; older settings know the first fold alone, as "narrow"."""
        names = saved.get("folds")
        if not isinstance(names, list):
            return self._layout.folds[:1] if saved.get("narrow") is True else ()
        return tuple(fold for fold in self._layout.folds if fold.panels[0] in names)

    def shut(self) -> None:
        """The window closes: every panel ends its watches."""
        for dock in (*self.docks.values(), *self._ahead.values()):
            dock.shut()


def _raiser(dock: Dock) -> Callable[[], object]:
    def bring() -> None:
        dock.raise_()
        dock.panel.setFocus(Qt.FocusReason.OtherFocusReason)

    return bring


def join(bench: QMainWindow, layout: Layout, docks: Mapping[str, Dock], dock: Dock) -> None:
    """Give a panel a place: below the row above its own, beside its home, else beside the last panel."""
    name = dock.description.name
    placed = {
        other.key: other
        for other in docks.values()
        if other is not dock
        and not other.isFloating()
        and bench.dockWidgetArea(other) != Qt.DockWidgetArea.NoDockWidgetArea
    }
    if name in layout.below:
        bench.addDockWidget(BELOW, dock)
        return
    above = _above(layout, name)
    home = name if dock.number > 1 else layout.homes.get(name, "")
    if above in placed and not placed[above].isHidden() and not bench.tabifiedDockWidgets(placed[above]):
        bench.splitDockWidget(placed[above], dock, Qt.Orientation.Vertical)
    elif placed:
        bench.tabifyDockWidget(placed[home] if home in placed else list(placed.values())[-1], dock)
    else:
        bench.addDockWidget(AREA, dock)


def put_beside(
    bench: QMainWindow, layout: Layout, docks: Mapping[str, Dock], dock: Dock, other: Dock | None
) -> None:
    """Give a panel half the place of another one, along its longer side, also where that has tabs."""
    if other is None or other.isHidden() or other.isFloating():
        join(bench, layout, docks, dock)
        return
    ways = (ACROSS, DOWN) if other.width() >= other.height() else (DOWN, ACROSS)
    # Qt makes a tab of whatever is split off a tab: for a moment the place has one panel only. Along one of
    # the two ways that is still a place with tabs for Qt; where both are so, one more tab is what remains.
    together = [each for each in bench.tabifiedDockWidgets(other) if isinstance(each, Dock)]
    shown = [each for each in together if not each.isHidden()]
    for way in ways:
        for each in together:
            bench.removeDockWidget(each)
        bench.splitDockWidget(other, dock, way)
        is_tab = dock in bench.tabifiedDockWidgets(other)
        for each in together:
            bench.tabifyDockWidget(other, each)
        for each in shown:
            each.show()
        if not is_tab and dock not in bench.tabifiedDockWidgets(other):
            break
        if way is ways[0]:
            bench.removeDockWidget(dock)
    other.raise_()


def _above(layout: Layout, name: str) -> str:
    """The panel of the row above that of one which comes later."""
    if name in layout.later:
        for column in layout.columns:
            for (names, _), (below, _) in zip(column.rows, column.rows[1:], strict=False):
                if name in below:
                    return names[0]
    return ""


def state_text(state: QByteArray) -> str:
    """Qt's state of the docks as text for the settings."""
    return base64.b64encode(state.data()).decode("ascii")


def state_of(text: object) -> QByteArray:
    """What `state_text` made of a state; empty when it is something else."""
    if not isinstance(text, str):
        return QByteArray()
    try:
        return QByteArray(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        return QByteArray()
