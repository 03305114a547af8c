"""A dock with our title and our frame around a panel; "more" floats and closes it."""

from __future__ import annotations

import json
import logging
import traceback
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QCloseEvent, QCursor, QKeyEvent, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import (
    QApplication,
    QDockWidget,
    QLineEdit,
    QScrollArea,
    QStackedLayout,
    QVBoxLayout,
    QWidget,
)

from app.core.faults import IN_CONSOLE, error_words
from app.ui.panels.base import ANY_TYPE, Density, Panel, PanelContext, PanelWidget, numbered
from app.ui.shell.docking.dock_title import DockTitle
from app.ui.theme.theme import Theme
from app.ui.widgets import EmptyAction, EmptyState, paint
from app.ui.widgets.keyboard import proxy_of, tab_stops
from app.ui.widgets.menus import Menu, drop_below
from nep.i18n import _

LEAST_BODY = QSize(160, 60)
RESTS_AFTER_S = 2.0
"""A panel that is hidden for a moment, by a quick change of tabs, stays subscribed."""
FAULTS = (Exception, SystemExit)
"""What a panel may raise without ending the window; one of a plug-in may call `sys.exit`."""
SENTENCE_LIMIT = 400

_log = logging.getLogger(__name__)


class _Corner(QWidget):
    """Rounds one lower corner of a panel over whatever the panel paints."""

    def __init__(self, theme: Theme, parent: QWidget, right: bool) -> None:
        super().__init__(parent)
        self._theme, self._right = theme, right
        side = theme.radius("panel")
        self.setFixedSize(side, side)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def paintEvent(self, _event: QPaintEvent) -> None:
        side = float(self.width())
        centre = QPointF(0.0 if self._right else side, 0.0)
        outside = QPainterPath()
        outside.addRect(QRectF(self.rect()))
        disc = QPainterPath()
        disc.addEllipse(centre, side, side)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillPath(outside.subtracted(disc), self._theme.colour("window"))
        painter.setPen(QPen(self._theme.colour("border"), 1))
        painter.drawEllipse(centre, side - 0.5, side - 0.5)
        painter.end()


class DockBody(QWidget):
    """The lower half of the frame, around the panel or what is shown in its place."""

    def __init__(self, theme: Theme, panel: PanelWidget) -> None:
        super().__init__()
        self._theme = theme
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 0, 1, 1)
        column.setSizeConstraint(QVBoxLayout.SizeConstraint.SetNoConstraint)
        self._stack = QStackedLayout()
        column.addLayout(self._stack)
        self._stack.addWidget(panel)
        self._failure: EmptyState | None = None
        self._corners = (_Corner(theme, self, False), _Corner(theme, self, True))

    def minimumSizeHint(self) -> QSize:
        # What does not fit scrolls inside its panel: people decide how large panels are, not contents.
        return LEAST_BODY

    def resizeEvent(self, _event: object) -> None:
        left, right = self._corners
        left.move(0, self.height() - left.height())
        right.move(self.width() - right.width(), self.height() - right.height())
        left.raise_()
        right.raise_()

    def fail(self, sentence: str, again: Callable[[], object]) -> None:
        """Show in place of the panel that it failed, with a way to try again."""
        if self._failure is None:
            self._failure = EmptyState(self._theme, "circle-x", _("This panel stopped"), sentence)
            self._stack.addWidget(self._failure)
        self._failure.say(_("This panel stopped"), sentence)
        self._failure.set_actions([EmptyAction(_("Try again"), again, "rotate-ccw")])
        self._stack.setCurrentWidget(self._failure)

    def show_panel(self) -> None:
        """Show the panel itself again."""
        self._stack.setCurrentIndex(0)

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        radius = theme.radius("panel")
        tall = rect.adjusted(0, -2 * radius, 0, 0)
        paint.box(painter, tall, radius, theme.colour("panel"), theme.colour("border"))
        painter.end()


class FailedPanel(PanelWidget):
    """Has the place of a panel that could not be made, and keeps what that is to be given back.

    Its first refresh raises what the making raised; each one after that makes the panel.
    """

    def __init__(self, context: PanelContext, description: Panel, error: BaseException) -> None:
        super().__init__(context, _(description.title))
        self._description = description
        self._error: BaseException | None = error
        self._state: Mapping[str, object] = {}
        self.take: Callable[[PanelWidget], object] = lambda _panel: None
        """What is done with the panel when it could be made."""

    def refresh(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error
        panel = self._description.make(self.context)
        self.take(panel)
        panel.restore_state(self._state)

    def save_state(self) -> dict[str, object]:
        return dict(self._state)

    def restore_state(self, state: Mapping[str, object]) -> None:
        self._state = state


class Dock(QDockWidget):
    """One panel in a workbench: moves, floats, closes, shares its place; `failed` panels are skipped."""

    another_wanted = Signal(str)
    closed = Signal(str)

    def __init__(
        self, theme: Theme, description: Panel, panel: PanelWidget, density: Density, number: int = 1
    ) -> None:
        """``number`` tells it from others of its kind; `key` is its name among all docks of a workbench."""
        super().__init__(numbered(_(description.title), number))
        self.description, self.panel = description, panel
        self.number, self.key = number, key_of(description.name, number)
        self.failed = False
        self.front = False
        self._seen_s = -RESTS_AFTER_S
        self._theme, self._density = theme, density
        self.setObjectName(f"panel.{self.key}")
        self.setAccessibleName(self.windowTitle())
        self._hold(panel)
        self.visibilityChanged.connect(self._visibility)
        theme.changed.connect(self._restyle)

    def _hold(self, panel: PanelWidget) -> None:
        panel.set_number(self.number)
        title, body = DockTitle(self._theme, panel, self._density), DockBody(self._theme, panel)
        panel.set_density(self._density)
        panel.setFont(panel.text_font())
        title.menu_wanted.connect(self._show_menu)
        self.panel, self.title, self.body = panel, title, body
        self.setTitleBarWidget(title)
        self.setWidget(body)

    def replace(self, panel: PanelWidget) -> None:
        """Hold another panel from now on, in the place of one that could not be made."""
        old = (self.title, self.body)
        self._hold(panel)
        for each in old:
            each.deleteLater()
        self.visibilityChanged.emit(self.front)  # whose tabs are in the new title, too

    def _restyle(self) -> None:
        self.panel.setFont(self.panel.text_font())
        self.title.updateGeometry()

    def _visibility(self, visible: bool) -> None:
        self.front = visible

    def shown(self) -> bool:
        """Whether a person can see the panel now: it is open, in front, and its window is on the screen."""
        return self.front and self.isVisible() and on_screen(self.window())

    def follow(self, now: float) -> str | None:
        """Let a panel rest that nobody has seen for two seconds, and wake one that is seen; called each tick.

        ``now`` is monotonic seconds. The sentence of its failure when it just failed.
        """
        if self.failed:
            return None
        if self.shown():
            self._seen_s = now
            return self._try(self.panel.wake)
        return self._try(self.panel.rest) if now - self._seen_s >= RESTS_AFTER_S else None

    def refresh(self) -> str | None:
        """Let the panel show what is new; the sentence of its failure when it just failed."""
        if self.failed or not self.shown():
            return None
        return self._try(self.panel.refresh)

    def badge(self) -> tuple[str, str] | None:
        """What its tab says while it stands behind another panel."""
        if self.front or self.failed:
            return None
        found: list[tuple[str, str] | None] = []
        self._try(lambda: found.append(self.panel.badge()))
        return found[0] if found else None

    def _try(self, act: Callable[[], object]) -> str | None:
        try:
            act()
        except FAULTS as error:  # whatever a panel raises, the window lives on
            self.failed = True
            with suppress(*FAULTS):  # it shows nothing now, so it looks at nothing
                self.panel.rest()
            sentence = error_words(error)[:SENTENCE_LIMIT]
            said = ("the panel '%s' stopped: %s", self.description.name, sentence)
            _log.error(*said, exc_info=error, extra=IN_CONSOLE)
            traceback.clear_frames(error.__traceback__)
            self.body.fail(sentence, self.try_again)
            return sentence
        return None

    def try_again(self) -> None:
        """Show a panel that failed again, from the next refresh on; nothing happens to one that did not."""
        if self.failed:
            self.failed = False
            self.body.show_panel()

    def saved_state(self) -> dict[str, object]:
        """What the panel wants back at the next start; nothing of one that can't tell.

        What JSON can't say would keep everything else from being kept, too.
        """
        try:
            found = self.panel.save_state()
            json.dumps(found)
        except FAULTS:
            _log.exception("the panel '%s' can't tell its state", self.description.name)
            return {}
        return found

    def give_back(self, state: Mapping[str, object]) -> None:
        """Let the panel be as it was; one that can't does not keep its layout from coming back."""
        try:
            self.panel.restore_state(state)
        except FAULTS:
            _log.exception("the panel '%s' can't be as it was", self.description.name)

    def shut(self) -> None:
        """The window closes: the panel ends its watches; one that fails does not keep the window open."""
        try:
            self.panel.shut()
        except FAULTS:
            _log.exception("the panel '%s' can't end in order", self.description.name)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """``/`` goes to the panel's filter, Esc leaves a field; also while the panel floats."""
        if event.text() == "/" and self.panel.focus_filter():
            event.accept()
        elif event.key() == Qt.Key.Key_Escape:
            if isinstance(QApplication.focusWidget(), QLineEdit):
                self.panel.setFocus(Qt.FocusReason.OtherFocusReason)
            event.accept()
        else:
            super().keyPressEvent(event)

    def menu(self) -> Menu:
        """The panel's own actions, then floating and closing."""
        menu = Menu(self._theme, self)
        own: list[QAction] = []
        try:
            own.extend(self.panel.more_actions())
        except FAULTS:  # it can still be closed
            _log.exception("the panel '%s' can't tell what it can do", self.description.name)
        menu.addActions(own)
        if own:
            menu.addSeparator()
        if self.description.several:
            more = menu.addAction(self._theme.icon("plus"), _("Open another panel to the side"))
            more.triggered.connect(lambda: self.another_wanted.emit(self.key))
        icon = self._theme.icon("picture-in-picture-2")
        floating = menu.addAction(icon, _("Dock") if self.isFloating() else _("Float"))
        floating.triggered.connect(self._float)
        menu.addAction(self._theme.icon("x"), _("Close")).triggered.connect(self.close)
        return menu

    def first_stop(self) -> QWidget:
        """Where the keyboard goes in the panel: what it is about, else the first thing that takes keys."""
        about = proxy_of(self.panel)
        if about is not None and about.isVisible():
            return about
        stops = tab_stops(self.panel, self.panel)
        first = next(stops, self.panel)
        if isinstance(first, QScrollArea):  # its first row says more than all of them
            inside = next(stops, None)
            return inside if inside is not None and first.isAncestorOf(inside) else first
        return first

    def _float(self) -> None:
        self._let_go()
        self.setFloating(not self.isFloating())
        self.activateWindow()
        self.first_stop().setFocus(Qt.FocusReason.OtherFocusReason)

    def closeEvent(self, event: QCloseEvent) -> None:
        self._let_go()
        super().closeEvent(event)
        if event.isAccepted():
            self.closed.emit(self.key)

    def _let_go(self) -> None:
        """Give up the keyboard: Qt would hand it on as by Tab, and the editor then opens a category."""
        focus = QApplication.focusWidget()
        if focus is not None and self.isAncestorOf(focus):
            focus.clearFocus()

    def _show_menu(self, anchor: QWidget | None) -> None:
        menu = self.menu()
        menu.aboutToHide.connect(lambda: QTimer.singleShot(0, menu.deleteLater))
        if anchor is not None:
            drop_below(menu, anchor)
        else:
            menu.popup(QCursor.pos())


def key_of(name: str, number: int) -> str:
    """What tells the docks of a workbench apart: "plot" is the first plot, "plot#2" the second one."""
    return name if number < 2 else f"{name}#{number}"


def kind_of(key: str) -> tuple[str, int]:
    """What `key_of` made a key of. Anything else is a name, and the first of its kind."""
    name, _sign, number = key.rpartition("#")
    if name and number.isascii() and number.isdigit() and key_of(name, int(number[:9])) == key:
        return name, int(number)
    return key, 1


def make_dock(description: Panel, context: PanelContext, density: Density, number: int = 1) -> Dock:
    """A dock with a new panel; when that can't be made, what stands in its place says so when it is seen."""
    try:
        return Dock(context.theme, description, description.make(context), density, number)
    except FAULTS as error:
        traceback.clear_frames(error.__traceback__)
        unmade = FailedPanel(context, description, error)
    dock = Dock(context.theme, description, unmade, density, number)
    unmade.take = dock.replace
    return dock


def on_screen(window: QWidget) -> bool:
    """Whether a window is not minimised, on another desktop, or wholly behind others where systems tell."""
    return not window.isMinimized() and window.windowHandle().isExposed()


def fitting(docks: Mapping[str, Dock], names: Iterable[str], kinds: set[str]) -> Dock | None:
    """The one of these panels that shows such a kind: one made for it before one that shows anything."""
    there = [docks[name] for name in names]
    for wanted in (kinds, {ANY_TYPE}):
        for dock in there:
            if wanted & set(dock.description.accepts):
                return dock
    return None
