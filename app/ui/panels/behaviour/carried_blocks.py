"""Blocks that are carried out of the page: a tab under them opens, and takes them when they are let go."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import QPoint, Qt, QTimer, SignalInstance
from PySide6.QtGui import QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QWidget

from app.core.session import Session
from app.ui.panels.base import PanelContext
from app.ui.panels.behaviour.tabs import NEW, BehaviourTabs
from nep.i18n import _, ngettext

SCROLL_MS = 16
OPENS_MS = 500  # as folders in a file manager
BESIDE = QPoint(14, 16)  # from the mouse to the picture: what is under the mouse can be read
OPACITY = 0.85


class Carrier(Protocol):
    """The editor, as far as blocks leave it."""

    block_carried: SignalInstance
    carried_seen: SignalInstance
    block_dropped: SignalInstance
    blocks_brought: SignalInstance

    def bring_blocks(self) -> None: ...
    def give_blocks_back(self) -> None: ...


class CarriedPicture(QWidget):
    """What is carried, at the mouse: the page shows nothing outside of itself.

    It lies over a window, takes no clicks, and is hidden until it has a place and a picture.
    """

    def __init__(self, window: QWidget) -> None:
        """``window`` is the one in which things are carried."""
        super().__init__(window)
        self._picture = QPixmap()
        self._place: QPoint | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()

    def set_picture(self, data: bytes, ratio: float) -> None:
        """How it looks: a PNG with so many pixels in one of the page; too late, it is nothing."""
        picture = QPixmap()
        if self._place is None or not picture.loadFromData(data):
            return
        picture.setDevicePixelRatio(ratio)
        self._picture = picture
        self.resize(picture.deviceIndependentSize().toSize())
        self.move_to(self._place)

    def move_to(self, place: QPoint | None) -> None:
        """The mouse is at this place of the screen; None: nothing is carried any more."""
        self._place = place
        if place is None:
            self._picture = QPixmap()
        window = self.parentWidget()
        if place is None or window is None or self._picture.isNull():
            self.hide()
            return
        self.move(window.mapFromGlobal(place) + BESIDE)
        if not self.isVisible():
            self.show()
            self.raise_()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setOpacity(OPACITY)
        painter.drawPixmap(0, 0, self._picture)
        painter.end()


class CarriedBlocks:
    """Marks the tab under a block that is carried out of the page, and lets it have the block there.

    A tab on which it is held for a while opens, and the block can be dragged on there. Let go on "+" a new
    behaviour takes it; let go elsewhere it is where it was. Held near an end of the row it brings the tabs
    that are out of sight there.
    """

    def __init__(
        self,
        context: PanelContext,
        session: Session,
        tabs: BehaviourTabs,
        editor: Carrier,
        flush: Callable[[Callable[[], None]], None],
        show: Callable[[], None],
    ) -> None:
        """``flush`` calls back once the newest edits are known; ``show`` shows the current behaviour now."""
        self._context, self._session, self._tabs, self._editor = context, session, tabs, editor
        self._flush, self._show = flush, show
        self._home = ""  # the tab that it comes from
        self._held_at: QPoint | None = None
        self._picture: CarriedPicture | None = None
        self._aimed = ""
        self._opening = QTimer(tabs)
        self._opening.setSingleShot(True)
        self._opening.setInterval(OPENS_MS)
        self._opening.timeout.connect(self._open)
        self._scrolling = QTimer(tabs)
        self._scrolling.setInterval(SCROLL_MS)
        self._scrolling.timeout.connect(self._scroll)
        editor.block_carried.connect(self._carried)
        editor.carried_seen.connect(self._seen)
        editor.block_dropped.connect(self._dropped)
        editor.blocks_brought.connect(self._brought)

    def _target(self, place: QPoint) -> str:
        """The tab there which can take blocks of their behaviour, by its key, or `NEW`; "" for none."""
        found = self._tabs.target_at(place)
        return found if found != self._home else ""

    def _carried(self, place: QPoint | None, home: str) -> None:
        self._held_at = place
        if place is not None:  # else it has been let go, and what shows now says nothing about where it was
            self._home = home
        self._show_at(place)
        self._aim(place)
        if place is None:
            self._scrolling.stop()
        elif not self._scrolling.isActive():
            self._scrolling.start()

    def _scroll(self) -> None:
        place = self._held_at
        if place is not None and self._tabs.scroll_at(place):
            self._aim(place)
        else:
            self._scrolling.stop()  # what is moved from here on starts it again

    def _aim(self, place: QPoint | None) -> None:
        """Mark the tab there; it opens when it stays the one, unless it is the one that shows."""
        self._tabs.aim(self._target(place) if place is not None else "")
        found = self._tabs.target_at(place) if place is not None else ""
        if found == self._aimed:
            return
        self._aimed = found
        if found in {"", NEW, self._session.document.key}:
            self._opening.stop()
        else:
            self._opening.start()

    def _open(self) -> None:
        """Let the tab show on which something is held; the page keeps it in the hand."""
        if self._held_at is not None and self._aimed not in {"", NEW}:
            self._context.run(f"tab:{self._aimed}")
            self._show()

    def _seen(self, data: bytes, ratio: float) -> None:
        if self._picture is not None:
            self._picture.set_picture(data, ratio)

    def _show_at(self, place: QPoint | None) -> None:
        """Let the picture follow the mouse, in the window in which the tabs are now."""
        window = self._tabs.window()
        if place is not None and (self._picture is None or self._picture.parentWidget() is not window):
            if self._picture is not None:
                self._picture.deleteLater()
            self._picture = CarriedPicture(window)
        if self._picture is not None:
            self._picture.move_to(place)

    def _dropped(self, place: QPoint) -> None:
        target = self._target(place)
        self._held_at = None
        self._scrolling.stop()
        self._show_at(None)
        self._aim(None)
        if not target:
            return
        if target != NEW:
            self._context.run(f"tab:{target}")
            self._bring()
            return
        self._context.run("file.new")
        self._flush(self._bring)  # after its own flush, with which the new behaviour comes

    def _bring(self) -> None:
        if self._session.document.key != self._home:
            self._show()
            self._editor.bring_blocks()

    def _brought(self, count: int, how: str, home: str) -> None:
        document = self._session.document
        words = brought_words(count, how, self._session.documents.title(document))

        def give_back() -> None:
            self._context.run(f"tab:{home}")
            self._editor.give_blocks_back()

        self._context.toast(words, _("Undo"), give_back)


def brought_words(count: int, how: str, name: str) -> str:
    """That so many blocks ("moved", "copied", "added") are in the behaviour of that name; 0: a note."""
    if not count:
        words = _("Moved the note to {name}") if how == "moved" else _("Copied the note to {name}")
    elif how == "moved":
        words = ngettext("Moved {count} block to {name}", "Moved {count} blocks to {name}", count)
    elif how == "copied":
        words = ngettext("Copied {count} block to {name}", "Copied {count} blocks to {name}", count)
    else:
        words = ngettext("Added {count} block to {name}", "Added {count} blocks to {name}", count)
    return words.format(count=count, name=name)
