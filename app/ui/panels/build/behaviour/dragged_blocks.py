"""Drag and drop of blocks from the page onto the tabs of other behaviours."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import QPoint, Qt, QTimer
from PySide6.QtGui import QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QWidget

from app.core.session import Session
from app.ui.blockly.messages import (
    BlocksDraggedOutside,
    BlocksDroppedOutside,
    BlocksTransferred,
    DragImageRendered,
    DragMessage,
    PagePosition,
    reject_unhandled,
)
from app.ui.intents import SelectTab
from app.ui.panels.base import PanelContext
from app.ui.panels.build.behaviour.tabs import NEW_TAB, BehaviourTabs
from nep.i18n import _, ngettext

SCROLL_INTERVAL_MS = 16
OPEN_DELAY_MS = 500  # like spring-loaded folders in file managers
POINTER_OFFSET = QPoint(14, 16)  # offset from the mouse, so that the tab under it stays readable
OPACITY = 0.85


class DragSource(Protocol):
    """Interface of the block editor for dragging blocks out of its page."""

    def to_screen(self, position: PagePosition) -> QPoint: ...
    def move_dragged_blocks(self) -> None: ...
    def undo_block_move(self) -> None: ...


class DragImage(QWidget):
    """Image of the dragged blocks, which follows the mouse pointer outside the page.

    The widget is an overlay of the window, because the page can't paint outside its own area. It is
    transparent for mouse events, and hidden until it has a position and an image.

    Args:
        window: Window to cover.
    """

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._picture = QPixmap()
        self._position: QPoint | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()

    def set_picture(self, data: bytes, ratio: float) -> None:
        """Set the image; ignored after the drag has ended.

        Args:
            data: Image as PNG.
            ratio: Device pixels per pixel of the page.
        """
        picture = QPixmap()
        if self._position is None or not picture.loadFromData(data):
            return
        picture.setDevicePixelRatio(ratio)
        self._picture = picture
        self.resize(picture.deviceIndependentSize().toSize())
        self.move_to(self._position)

    def move_to(self, position: QPoint | None) -> None:
        """Move the image to a position on the screen; None ends the drag."""
        self._position = position
        if position is None:
            self._picture = QPixmap()
        window = self.parentWidget()
        if position is None or window is None or self._picture.isNull():
            self.hide()
            return
        self.move(window.mapFromGlobal(position) + POINTER_OFFSET)
        if not self.isVisible():
            self.show()
            self.raise_()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setOpacity(OPACITY)
        painter.drawPixmap(0, 0, self._picture)
        painter.end()


class BlockDrag:
    """Drag and drop of blocks from the page onto tabs.

    The tab under the mouse pointer is highlighted. A tab opens after the pointer has hovered over it for a
    while, and the drag continues on its page. A drop on "+" creates a behaviour; a drop outside the tab bar
    returns the blocks to their place. Near an end of the tab bar, the tabs scroll.

    Args:
        flush: Fetches pending edits, then calls its argument.
        show: Shows the active behaviour at once.
    """

    def __init__(
        self,
        context: PanelContext,
        session: Session,
        tabs: BehaviourTabs,
        editor: DragSource,
        flush: Callable[[Callable[[], None]], None],
        show: Callable[[], None],
    ) -> None:
        self._context, self._session, self._tabs, self._editor = context, session, tabs, editor
        self._flush, self._show = flush, show
        self._home = ""  # key of the tab that the drag started on
        self._drag_position: QPoint | None = None
        self._picture: DragImage | None = None
        self._hovered_target = ""
        self._open_timer = QTimer(tabs)
        self._open_timer.setSingleShot(True)
        self._open_timer.setInterval(OPEN_DELAY_MS)
        self._open_timer.timeout.connect(self._open_target)
        self._scroll_timer = QTimer(tabs)
        self._scroll_timer.setInterval(SCROLL_INTERVAL_MS)
        self._scroll_timer.timeout.connect(self._scroll)

    def handle(self, message: DragMessage) -> None:
        """Handle a message from the page about dragged blocks."""
        match message:
            case BlocksDraggedOutside():
                position = message.position
                self._drag_moved(
                    self._editor.to_screen(position) if position is not None else None, message.tab
                )
            case DragImageRendered():
                if self._picture is not None:
                    self._picture.set_picture(message.png, message.ratio)
            case BlocksDroppedOutside():
                self._on_dropped(self._editor.to_screen(message.position))
            case BlocksTransferred():
                self._on_transferred(message.count, message.mode, message.source_tab)
            case _:
                reject_unhandled(message)

    def _target(self, position: QPoint) -> str:
        target = self._tabs.target_at(position)
        return target if target != self._home else ""

    def _drag_moved(self, position: QPoint | None, home: str) -> None:
        self._drag_position = position
        if position is not None:  # None after the drop: the visible tab may already be another one
            self._home = home
        self._move_image(position)
        self._update_target(position)
        if position is None:
            self._scroll_timer.stop()
        elif not self._scroll_timer.isActive():
            self._scroll_timer.start()

    def _scroll(self) -> None:
        position = self._drag_position
        if position is not None and self._tabs.scroll_at(position):
            self._update_target(position)
        else:
            self._scroll_timer.stop()  # the next mouse move starts it again

    def _update_target(self, position: QPoint | None) -> None:
        self._tabs.highlight_target(self._target(position) if position is not None else "")
        target = self._tabs.target_at(position) if position is not None else ""
        if target == self._hovered_target:
            return
        self._hovered_target = target
        if target in {"", NEW_TAB, self._session.document.key}:
            self._open_timer.stop()
        else:
            self._open_timer.start()

    def _open_target(self) -> None:
        if self._drag_position is not None and self._hovered_target not in {"", NEW_TAB}:
            self._context.request(SelectTab(self._hovered_target))
            self._show()

    def _move_image(self, position: QPoint | None) -> None:
        window = self._tabs.window()
        if position is not None and (self._picture is None or self._picture.parentWidget() is not window):
            if self._picture is not None:
                self._picture.deleteLater()
            self._picture = DragImage(window)
        if self._picture is not None:
            self._picture.move_to(position)

    def _on_dropped(self, position: QPoint) -> None:
        target = self._target(position)
        self._drag_position = None
        self._scroll_timer.stop()
        self._move_image(None)
        self._update_target(None)
        if not target:
            return
        if target != NEW_TAB:
            self._context.request(SelectTab(target))
            self._transfer()
            return
        self._context.run("file.new")
        self._flush(self._transfer)  # after the flush of file.new, which shows the new behaviour

    def _transfer(self) -> None:
        if self._session.document.key != self._home:
            self._show()
            self._editor.move_dragged_blocks()

    def _on_transferred(self, count: int, how: str, home: str) -> None:
        project = self._session.document
        message = transfer_text(count, how, self._session.documents.title(project))

        def undo() -> None:
            self._context.request(SelectTab(home))
            self._editor.undo_block_move()

        self._context.show_toast(message, _("Undo"), undo)


def transfer_text(count: int, how: str, name: str) -> str:
    """Format the text of the toast after blocks were dropped on a tab.

    Args:
        count: Number of blocks; 0 if a note was dropped.
        how: "moved", "copied" or "added".
        name: Name of the target behaviour.
    """
    if not count:
        template = _("Moved the note to {name}") if how == "moved" else _("Copied the note to {name}")
    elif how == "moved":
        template = ngettext("Moved {count} block to {name}", "Moved {count} blocks to {name}", count)
    elif how == "copied":
        template = ngettext("Copied {count} block to {name}", "Copied {count} blocks to {name}", count)
    else:
        template = ngettext("Added {count} block to {name}", "Added {count} blocks to {name}", count)
    return template.format(count=count, name=name)
