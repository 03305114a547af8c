"""Menus with rounded corners, for the menu bar, panels and text fields.

Where the system composites windows (Wayland, macOS, Windows) the corners are transparent. Under X11,
where a compositor may be missing and the corners would be black, a mask clips the window.
"""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, QSize, Qt
from PySide6.QtGui import (
    QAction,
    QActionEvent,
    QFontMetricsF,
    QGuiApplication,
    QIcon,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QRegion,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import QAbstractButton, QApplication, QLineEdit, QMenu, QPlainTextEdit, QWidget

from app.ui.text.numbers import shortcut_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets.buttons import Button, StopButton
from app.ui.widgets.keyboard import is_keyboard_navigation
from app.ui.widgets.mnemonics import key_of, mnemonic_positions, strip_mnemonic
from app.ui.widgets.paint import RIGHT, box, text_line, width_of

MASKED_PLATFORMS = frozenset({"xcb"})
MARK_SIZE, MAX_MARK_SIZE, TEXT_LEFT = 15, 22, 33
SCROLLER_HEIGHT = 22  # px, as in the style sheet
HEURISTIC_ROLE = QAction.MenuRole.TextHeuristicRole
MIN_WIDTH = 160  # px; narrower menus are unreadable and better placed over Stop


def set_round_corners(widget: QWidget) -> None:
    """Set the window flags of a popup for rounded corners; call this before the popup is first shown."""
    widget.setWindowFlag(Qt.WindowType.FramelessWindowHint, True)
    widget.setWindowFlag(
        Qt.WindowType.NoDropShadowWindowHint, QGuiApplication.platformName() in MASKED_PLATFORMS
    )
    if QGuiApplication.platformName() not in MASKED_PLATFORMS:
        widget.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)


def clip_corners(widget: QWidget, radius: float) -> None:
    """Clip a popup to rounded corners, on platforms that may have no compositor.

    Args:
        widget: Popup.
        radius: Corner radius in px.
    """
    if QGuiApplication.platformName() in MASKED_PLATFORMS:
        widget.setMask(round_region(widget.size(), radius))


def round_region(size: QSize, radius: float) -> QRegion:
    """Return the region of a rectangle with rounded corners."""
    path = QPainterPath()
    path.addRoundedRect(QRectF(0, 0, size.width(), size.height()), radius, radius)
    return QRegion(path.toFillPolygon().toPolygon())


def geometry_beside_stop(menu: QRect, stop: QRect, screen: QRect) -> QRect:
    """Return the geometry of a menu, changed so that it doesn't cover Stop.

    The menu is moved to the left of Stop or below it, or is made narrower. If none is possible on the
    screen, the geometry isn't changed.
    """
    if not menu.intersects(stop):
        return menu
    moved_left = menu.translated(stop.left() - menu.right() - 1, 0)
    moved_down, narrowed = QRect(menu), QRect(menu)
    moved_down.moveTop(stop.bottom() + 1)
    narrowed.setLeft(screen.left())
    narrowed.setRight(stop.left() - 1)
    if narrowed.width() < MIN_WIDTH:
        narrowed = menu
    return next((rect for rect in (moved_left, moved_down) if screen.contains(rect)), narrowed)


def stop_button_at(position: QPoint) -> QAbstractButton | None:
    """Return the Stop button at a screen position; None if there is none or a popup covers it."""
    windows = [window for window in QApplication.topLevelWidgets() if window.isVisible()]
    candidates = [window for window in windows if window.rect().contains(window.mapFromGlobal(position))]
    if any(window.windowType() == Qt.WindowType.Popup for window in candidates):
        return None
    for window in candidates:
        widget = window.childAt(window.mapFromGlobal(position))
        if isinstance(widget, StopButton) or (isinstance(widget, Button) and widget.kind == "stop"):
            return widget
    return None


def press_stop(position: QPoint) -> bool:
    """Close all popups and click the Stop button at a screen position; return False if there is none."""
    stop = stop_button_at(position)
    if stop is None:
        return False
    while (popup := QApplication.activePopupWidget()) is not None and popup.close():
        continue
    stop.click()
    return True


class Menu(QMenu):
    """Menu with icons and check marks in the same column, and shortcuts on the right.

    Each entry has a mnemonic letter, which is underlined if the menu was opened by the keyboard. On
    macOS, only entries with an explicit role are moved to the application menu.
    """

    def __init__(self, theme: Theme, parent: QWidget | None = None, title: str = "") -> None:
        super().__init__(title, parent)
        self._theme = theme
        self._is_opened_by_keyboard = False
        self.menuAction().setMenuRole(QAction.MenuRole.NoRole)
        set_round_corners(self)

    def actionEvent(self, event: QActionEvent) -> None:
        """Clear the role of a new entry if Qt would derive it from the text.

        On macOS, a file, layout or robot named "About us", "Quit" or "Setup" would otherwise be moved
        to the application menu.
        """
        action = event.action()
        if event.type() == QEvent.Type.ActionAdded and action.menuRole() == HEURISTIC_ROLE:
            action.setMenuRole(QAction.MenuRole.NoRole)
        super().actionEvent(event)

    def mnemonics(self) -> dict[QAction, int]:
        """Return the position of the mnemonic letter in the text of each entry, or -1 for none."""
        entries = [action for action in self.actions() if action.isVisible() and not action.isSeparator()]
        positions = mnemonic_positions([strip_mnemonic(action.text()) for action in entries])
        return dict(zip(entries, positions, strict=True))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Activate an entry when its mnemonic letter is pressed."""
        self._is_opened_by_keyboard = True
        self.update()
        modifiers = event.modifiers() & ~(Qt.KeyboardModifier.ShiftModifier | Qt.KeyboardModifier.AltModifier)
        key = "" if modifiers else key_of(event.text())
        for action, position in self.mnemonics().items() if key else ():
            if (
                position >= 0
                and key_of(strip_mnemonic(action.text())[position]) == key
                and action.isEnabled()
            ):
                self.setActiveAction(action)
                if action.menu() is None:
                    no_modifiers = Qt.KeyboardModifier.NoModifier
                    super().keyPressEvent(QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Return, no_modifiers))
                return
        super().keyPressEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        modifiers = QGuiApplication.queryKeyboardModifiers() & Qt.KeyboardModifier.AltModifier
        self._is_opened_by_keyboard = bool(modifiers) or is_keyboard_navigation()
        clip_corners(self, self._theme.radius("panel"))
        self._avoid_stop()

    def _avoid_stop(self) -> None:
        # Moves the menu if it covers Stop, because Qt may have moved it in a small window.
        owner = self.parentWidget()
        while isinstance(owner, QMenu):
            owner = owner.parentWidget()
        if owner is None:
            return
        screen = self.screen().availableGeometry()
        for stop in owner.window().findChildren(StopButton):
            if stop.isVisible():
                stop_rect = QRect(stop.mapToGlobal(QPoint()), stop.size())
                self.setGeometry(geometry_beside_stop(self.geometry(), stop_rect, screen))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Trigger Stop on a click on a Stop button; otherwise close the menu on a click outside.

        `app.ui.shell.stop_keys` doesn't receive this event for submenus, because they don't become the
        active window.
        """
        is_left_button = event.button() == Qt.MouseButton.LeftButton
        if not (is_left_button and press_stop(event.globalPosition().toPoint())):
            super().mousePressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        clip_corners(self, self._theme.radius("panel"))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect())
        box(painter, rect, theme.radius("panel"), theme.colour("raised"), theme.colour("borderStrong"))
        visible_actions = [action for action in self.actions() if action.isVisible()]
        above, below = self._hidden_ends(visible_actions)
        contents = rect.adjusted(1, 1 + above * SCROLLER_HEIGHT, -1, -1 - below * SCROLLER_HEIGHT)
        for is_hidden, icon, top in (
            (above, "chevron-up", 1),
            (below, "chevron-down", rect.height() - SCROLLER_HEIGHT),
        ):
            if is_hidden:
                icon_rect = QRectF((rect.width() - 14) / 2, top + (SCROLLER_HEIGHT - 14) / 2, 14, 14)
                paint_icon(painter, icon_rect, icon, theme.colour("textSecondary"))
        painter.setClipRect(contents)
        mnemonic_positions_by_action = self.mnemonics()
        for action in visible_actions:
            action_rect = QRectF(self.actionGeometry(action))
            action_rect.setRight(min(action_rect.right(), rect.right() - 6))
            if action_rect.intersects(contents):
                self._paint_action(painter, action_rect, action, mnemonic_positions_by_action.get(action, -1))
        painter.end()

    def _hidden_ends(self, visible_actions: list[QAction]) -> tuple[bool, bool]:
        # On a low screen some entries are hidden; the mouse at the edge scrolls to them.
        if not visible_actions:
            return False, False
        first, last = self.actionGeometry(visible_actions[0]), self.actionGeometry(visible_actions[-1])
        return first.top() < 0, last.bottom() > self.height()

    def _paint_underline(self, painter: QPainter, text_rect: QRectF, text: str, letter: int) -> None:
        font = self.font()
        left, width = width_of(font, text[:letter]), width_of(font, text[letter])
        underline_y = text_rect.center().y() + QFontMetricsF(font).ascent() / 2 + 1
        painter.fillRect(QRectF(text_rect.left() + left, round(underline_y), width, 1), painter.pen().color())

    def _paint_action(self, painter: QPainter, action_rect: QRectF, action: QAction, letter: int) -> None:
        theme = self._theme
        if action.isSeparator():
            line = QRectF(
                action_rect.left() + 6, round(action_rect.center().y()), action_rect.width() - 12, 1
            )
            painter.fillRect(line, theme.colour("border"))
            return
        if action is self.activeAction() and action.isEnabled():
            box(painter, action_rect, theme.radius("small"), theme.colour("hover"))
        side = min(theme.scaled(MARK_SIZE), MAX_MARK_SIZE)
        mark = QRectF(
            action_rect.left() + 9 - (side - MARK_SIZE) / 4, action_rect.center().y() - side / 2, side, side
        )
        if action.isChecked():
            paint_icon(painter, mark, "check", theme.colour("accentText"))
        elif not action.icon().isNull():
            mode = QIcon.Mode.Normal if action.isEnabled() else QIcon.Mode.Disabled
            action.icon().paint(painter, mark.toRect(), Qt.AlignmentFlag.AlignCenter, mode)
        shortcut = action.shortcut().toString(QKeySequence.SequenceFormat.PortableText)
        key = shortcut_text(shortcut or action.text().partition("\t")[2])
        colour = theme.colour("text" if action.isEnabled() else "textDisabled")
        text_rect = action_rect.adjusted(TEXT_LEFT, 0, -12, 0)
        text = strip_mnemonic(action.text())
        text_width = width_of(self.font(), text)
        if text_width + 12 + width_of(self.font(), key) > text_rect.width():
            key = ""  # in a narrow menu the text takes precedence; shortcuts are listed on F1
        text_line(painter, text_rect, text, self.font(), colour)
        if self._is_opened_by_keyboard and letter >= 0 and text_width <= text_rect.width():
            self._paint_underline(painter, text_rect, text, letter)
        if action.menu() is not None:
            chevron = QRectF(text_rect.right() - 12, action_rect.center().y() - 7, 14, 14)
            paint_icon(painter, chevron, "chevron-right", theme.colour("textTertiary"))
        elif key:
            quiet = theme.colour("textTertiary" if action.isEnabled() else "textDisabled")
            text_line(painter, text_rect, key, self.font(), quiet, RIGHT)


def open_below(menu: Menu, anchor: QWidget) -> None:
    """Open a menu below a button, aligned so that the menu stays within the window's width."""
    position = anchor.rect().bottomLeft() + QPoint(0, 3)
    overflow = anchor.mapTo(anchor.window(), position).x() + menu.sizeHint().width() - anchor.window().width()
    if overflow > 0:
        position.setX(anchor.width() - menu.sizeHint().width())
    menu.popup(anchor.mapToGlobal(position))


class FieldContextMenu(QObject):
    """Context menu of a text field in Studio's style, in place of the standard one."""

    def __init__(self, theme: Theme, field: QLineEdit | QPlainTextEdit) -> None:
        super().__init__(field)
        self._theme, self._field = theme, field
        field.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        field.customContextMenuRequested.connect(self._show)

    def _show(self, position: QPoint) -> None:
        standard = self._field.createStandardContextMenu()
        menu = Menu(self._theme, self._field)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.destroyed.connect(standard.deleteLater)  # the standard menu owns the actions
        menu.addActions(standard.actions())
        menu.popup(self._field.mapToGlobal(position))
