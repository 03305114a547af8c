"""Dock: a panel with a title bar and a frame, which can be moved, floated and closed."""

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

from app.core.faults import CONSOLE_EXTRA, error_text
from app.ui.panels.base import ANY_TYPE, Density, Panel, PanelContext, PanelWidget, numbered_title
from app.ui.shell.docking.dock_title import DockTitle
from app.ui.theme.theme import Theme
from app.ui.widgets import EmptyAction, EmptyState, paint
from app.ui.widgets.keyboard import focus_proxy, tab_stops
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _

MIN_BODY_SIZE = QSize(160, 60)
SUSPEND_DELAY_S = 2.0
"""Delay in s before a hidden panel is suspended, so that quick tab changes don't resubscribe to topics."""
CAUGHT_ERRORS = (Exception, SystemExit)
"""Exceptions of panels that are caught; SystemExit because a plug-in's panel may call `sys.exit`."""
MAX_MESSAGE_LENGTH = 400

_log = logging.getLogger(__name__)


class _Corner(QWidget):
    """Widget over a lower corner of a panel that paints the rounded corner of the frame."""

    def __init__(self, theme: Theme, parent: QWidget, is_right: bool) -> None:
        super().__init__(parent)
        self._theme, self._is_right = theme, is_right
        side = theme.radius("panel")
        self.setFixedSize(side, side)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def paintEvent(self, _event: QPaintEvent) -> None:
        side = float(self.width())
        centre = QPointF(0.0 if self._is_right else side, 0.0)
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
    """Lower part of the frame, with the panel or, after a failure, an error message."""

    def __init__(self, theme: Theme, panel: PanelWidget, parent: QWidget) -> None:
        super().__init__(parent)
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
        # The panel scrolls its contents, so the user can resize it freely.
        return MIN_BODY_SIZE

    def resizeEvent(self, _event: object) -> None:
        left, right = self._corners
        left.move(0, self.height() - left.height())
        right.move(self.width() - right.width(), self.height() - right.height())
        left.raise_()
        right.raise_()

    def show_error(self, message: str, retry: Callable[[], object]) -> None:
        """Show an error in place of the panel.

        Args:
            message: Error message.
            retry: Callback of the button "Try again".
        """
        if self._failure is None:
            self._failure = EmptyState(self._theme, "circle-x", _("This panel stopped"), message)
            self._stack.addWidget(self._failure)
        self._failure.set_texts(_("This panel stopped"), message)
        self._failure.set_actions([EmptyAction(_("Try again"), retry, "rotate-ccw")])
        self._stack.setCurrentWidget(self._failure)

    def show_panel(self) -> None:
        """Show the panel in place of the error message."""
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
    """Placeholder for a panel that couldn't be created.

    The first refresh raises the original error, which the dock displays; later ones create the panel
    again. The panel's saved state is stored until then.
    """

    def __init__(self, context: PanelContext, description: Panel, error: BaseException) -> None:
        super().__init__(context, _(description.title))
        self._description = description
        self._error: BaseException | None = error
        self._state: Mapping[str, object] = {}
        self.on_created: Callable[[PanelWidget], object] = lambda _panel: None
        """Called with the panel when its creation succeeds."""

    def refresh(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error
        panel = self._description.make(self.context)
        self.on_created(panel)
        panel.restore_state(self._state)

    def save_state(self) -> dict[str, object]:
        return dict(self._state)

    def restore_state(self, state: Mapping[str, object]) -> None:
        self._state = state


class Dock(QDockWidget):
    """Dock widget of a panel in a workbench.

    `closed` is emitted with the dock's key, and `another_requested` with the key when the user opens
    another panel of the same kind.

    Attributes:
        description: Description of the kind of panel.
        panel: Panel, or its placeholder if the panel couldn't be created.
        number: Number among the docks of the same kind, counted from 1.
        key: Unique name in the workbench.
        has_failed: True after an exception of the panel, which is then not refreshed any more.
        is_front: True if the dock is open and isn't covered by another tab.
    """

    another_requested = Signal(str)
    closed = Signal(str)

    def __init__(
        self,
        theme: Theme,
        description: Panel,
        panel: PanelWidget,
        density: Density,
        number: int = 1,
        parent: QWidget | None = None,
    ) -> None:
        # `number` distinguishes docks of the same kind; `key` is the unique name in a workbench.
        # The parent is set early, because Qt styles a widget and its children again when it changes.
        super().__init__(numbered_title(_(description.title), number), parent)
        self.description, self.panel = description, panel
        self.number, self.key = number, format_key(description.name, number)
        self.has_failed = False
        self.is_front = False
        self._last_displayed_s = -SUSPEND_DELAY_S
        self._theme, self._density = theme, density
        self.setObjectName(f"panel.{self.key}")
        self.setAccessibleName(self.windowTitle())
        self._set_panel(panel)
        self.visibilityChanged.connect(self._on_visibility_changed)
        theme.changed.connect(self._restyle)

    def _set_panel(self, panel: PanelWidget) -> None:
        panel.set_number(self.number)
        title = DockTitle(self._theme, panel, self._density, self)
        body = DockBody(self._theme, panel, self)
        panel.set_density(self._density)
        panel.setFont(panel.text_font())
        title.menu_requested.connect(self._show_menu)
        self.panel, self.title, self.body = panel, title, body
        self.setTitleBarWidget(title)
        self.setWidget(body)

    @property
    def is_placeholder(self) -> bool:
        """True if the panel couldn't be created."""
        return isinstance(self.panel, FailedPanel)

    def replace(self, panel: PanelWidget) -> None:
        """Replace the placeholder with a panel."""
        old = (self.title, self.body)
        self._set_panel(panel)
        for widget in old:
            widget.deleteLater()
        self.visibilityChanged.emit(self.is_front)  # the new title needs the tabs, too

    def _restyle(self) -> None:
        self.panel.setFont(self.panel.text_font())
        self.title.updateGeometry()

    def _on_visibility_changed(self, visible: bool) -> None:
        self.is_front = visible

    def is_displayed(self) -> bool:
        """Return True if the panel is visible to the user: open, in front, and in a window on the screen."""
        return self.is_front and self.isVisible() and is_on_screen(self.window())

    def update_suspension(self, now: float) -> str | None:
        """Resume the panel if it is displayed; suspend it after it has been hidden for `SUSPEND_DELAY_S`.

        Called on every tick. Has no effect if the panel has failed.

        Args:
            now: Monotonic time in s.

        Returns:
            The error message if the panel has just failed, else None.
        """
        if self.has_failed:
            return None
        if self.is_displayed():
            self._last_displayed_s = now
            return self._try(self.panel.resume)
        return self._try(self.panel.suspend) if now - self._last_displayed_s >= SUSPEND_DELAY_S else None

    def refresh(self) -> str | None:
        """Refresh the panel if it is displayed and hasn't failed.

        Returns:
            The error message if the panel has just failed, else None.
        """
        if self.has_failed or not self.is_displayed():
            return None
        return self._try(self.panel.refresh)

    def badge(self) -> tuple[str, str] | None:
        """Return text and status of the badge on the panel's tab, or None.

        There is no badge if the panel is in front, has failed, or has nothing new.
        """
        if self.is_front or self.has_failed:
            return None
        badges: list[tuple[str, str] | None] = []
        self._try(lambda: badges.append(self.panel.badge()))
        return badges[0] if badges else None

    def _try(self, act: Callable[[], object]) -> str | None:
        try:
            act()
        except CAUGHT_ERRORS as error:  # no exception of a panel may close the window
            self.has_failed = True
            with suppress(*CAUGHT_ERRORS):  # a failed panel needs no subscriptions
                self.panel.suspend()
            message = error_text(error)[:MAX_MESSAGE_LENGTH]
            log_args = ("the panel '%s' stopped: %s", self.description.name, message)
            _log.error(*log_args, exc_info=error, extra=CONSOLE_EXTRA)
            traceback.clear_frames(error.__traceback__)
            self.body.show_error(message, self.retry)
            return message
        return None

    def retry(self) -> None:
        """Show a failed panel again and resume its refreshes. Has no effect if the panel hasn't failed."""
        if self.has_failed:
            self.has_failed = False
            self.body.show_panel()

    def saved_state(self) -> dict[str, object]:
        """Return the state of the panel to save.

        Returns:
            The state, or {} if the panel raises an exception or the state can't be encoded as JSON.
        """
        try:
            state = self.panel.save_state()
            json.dumps(state)
        except CAUGHT_ERRORS:
            _log.exception("saving the state of panel '%s' failed", self.description.name)
            return {}
        return state

    def restore_state(self, state: Mapping[str, object]) -> None:
        """Restore the state of the panel.

        An exception is logged and not raised, so that the rest of the layout is restored.
        """
        try:
            self.panel.restore_state(state)
        except CAUGHT_ERRORS:
            _log.exception("restoring panel '%s' failed", self.description.name)

    def dispose(self) -> None:
        """Release the resources of the panel before the dock is deleted or the window closes.

        An exception is logged and not raised.
        """
        try:
            self.panel.dispose()
        except CAUGHT_ERRORS:
            _log.exception("closing panel '%s' failed", self.description.name)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the focus to the panel's filter on "/", and from a field to the panel on Esc."""
        if event.text() == "/" and self.panel.focus_filter():
            event.accept()
        elif event.key() == Qt.Key.Key_Escape:
            if isinstance(QApplication.focusWidget(), QLineEdit):
                self.panel.setFocus(Qt.FocusReason.OtherFocusReason)
            event.accept()
        else:
            super().keyPressEvent(event)

    def menu(self) -> Menu:
        """Return a new menu with the actions of the panel, and entries to float, dock or close it.

        If the panel allows multiple instances, the menu has an entry to open another one.
        """
        menu = Menu(self._theme, self)
        actions: list[QAction] = []
        try:
            actions.extend(self.panel.more_actions())
        except CAUGHT_ERRORS:  # the dock can still be closed
            _log.exception("reading the actions of panel '%s' failed", self.description.name)
        menu.addActions(actions)
        if actions:
            menu.addSeparator()
        if self.description.allows_multiple:
            another_action = menu.addAction(self._theme.icon("plus"), _("Open another panel to the side"))
            another_action.triggered.connect(lambda: self.another_requested.emit(self.key))
        icon = self._theme.icon("picture-in-picture-2")
        float_action = menu.addAction(icon, _("Dock") if self.isFloating() else _("Float"))
        float_action.triggered.connect(self._float)
        menu.addAction(self._theme.icon("x"), _("Close")).triggered.connect(self.close)
        return menu

    def focus_target(self) -> QWidget:
        """Return the widget that gets the focus: focus proxy, first tab stop, or else the panel itself."""
        proxy = focus_proxy(self.panel)
        if proxy is not None and proxy.isVisible():
            return proxy
        stops = tab_stops(self.panel, self.panel)
        first = next(stops, self.panel)
        if isinstance(first, QScrollArea):  # the first item inside is a better target than the whole area
            inner = next(stops, None)
            return inner if inner is not None and first.isAncestorOf(inner) else first
        return first

    def _float(self) -> None:
        self._clear_focus()
        self.setFloating(not self.isFloating())
        self.activateWindow()
        self.focus_target().setFocus(Qt.FocusReason.OtherFocusReason)

    def closeEvent(self, event: QCloseEvent) -> None:
        self._clear_focus()
        super().closeEvent(event)
        if event.isAccepted():
            self.closed.emit(self.key)

    def _clear_focus(self) -> None:
        # Clears the focus first: otherwise Qt would move it as by Tab, and the editor would open a category.
        focus = QApplication.focusWidget()
        if focus is not None and self.isAncestorOf(focus):
            focus.clearFocus()

    def _show_menu(self, anchor: QWidget | None) -> None:
        menu = self.menu()
        menu.aboutToHide.connect(lambda: QTimer.singleShot(0, menu.deleteLater))
        if anchor is not None:
            open_below(menu, anchor)
        else:
            menu.popup(QCursor.pos())


def format_key(name: str, number: int) -> str:
    """Return the key of a dock from the name of the panel and the dock's number, such as "plot#2".

    The first dock of a kind has the name as key.
    """
    return name if number < 2 else f"{name}#{number}"


def parse_key(key: str) -> tuple[str, int]:
    """Split the key of a dock into name and number; a key in another format is a name with the number 1."""
    name, _sign, number = key.rpartition("#")
    if name and number.isascii() and number.isdigit() and format_key(name, int(number[:9])) == key:
        return name, int(number)
    return key, 1


def create_dock(
    description: Panel,
    context: PanelContext,
    density: Density,
    number: int = 1,
    parent: QWidget | None = None,
) -> Dock:
    """Return a dock with a new panel, or with a `FailedPanel` if the panel raises an exception."""
    try:
        return Dock(context.theme, description, description.make(context), density, number, parent)
    except CAUGHT_ERRORS as error:
        traceback.clear_frames(error.__traceback__)
        failed_panel = FailedPanel(context, description, error)
    dock = Dock(context.theme, description, failed_panel, density, number, parent)
    failed_panel.on_created = dock.replace
    return dock


def is_on_screen(window: QWidget) -> bool:
    """Return False if a window is minimised, on another desktop or fully covered.

    A covered window is detected only where the system reports it.
    """
    return not window.isMinimized() and window.windowHandle().isExposed()


def dock_for_kinds(docks: Mapping[str, Dock], names: Iterable[str], kinds: set[str]) -> Dock | None:
    """Return the first dock whose panel can show a topic, or None.

    A panel that accepts one of the topic's kinds takes precedence over one that accepts any type.

    Args:
        docks: Docks by key.
        names: Keys of the docks to check, in order.
        kinds: Message type and codec of the topic; empty if the topic is unknown.
    """
    candidates = [docks[name] for name in names]
    for accepted in (kinds, {ANY_TYPE}):
        for dock in candidates:
            if accepted & set(dock.description.accepted_types):
                return dock
    return None
