"""Where the banner is without moving anything under the mouse.

It lies over the upper edge of the pages as soon as it is wanted, or over the lower one while the mouse is at
the upper. Room is made for it, and taken away, only while the mouse is neither over the pages nor pressed:
then a click that was aimed at something lands there.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt
from PySide6.QtGui import QCursor, QMoveEvent, QResizeEvent
from PySide6.QtWidgets import QApplication, QSizePolicy, QWidget

from app.ui.shell.bars.banner import BannerPlace

FRESH_S = 0.5
"""So long after it came under a mouse the banner lets a press through to what was there before."""


class BannerRoom(QWidget):
    """The room between bars and pages; the banner lies over it, or over pages that may not move yet."""

    def __init__(
        self,
        place: BannerPlace,
        pages: QWidget,
        *,
        mouse_at: Callable[[], QPoint] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """All three have the same parent; ``mouse_at`` tells where the mouse is on the screen."""
        super().__init__()
        self._place, self._pages = place, pages
        self.mouse_at: Callable[[], QPoint] = mouse_at or _mouse_on_screen
        self.clock = clock
        self._is_low = False
        self._said = ""
        self._fresh_until = 0.0
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(0)
        place.installEventFilter(self)

    @property
    def height_wanted(self) -> int:
        """The height of the banner in this width; 0 while there is none."""
        layout = self._place.layout()
        if self._place.isHidden() or layout is None:
            return 0
        return max(layout.totalHeightForWidth(self.width()), self._place.minimumSizeHint().height())

    def follow(self) -> None:
        """Put the banner where it may be now, and make room when nothing moves under the mouse; each tick."""
        wanted = self.height_wanted
        mouse = self._mouse()
        if wanted:
            self._note_change(mouse)
        if wanted != self.height() and self._may_move(mouse, wanted):
            self.setFixedHeight(wanted)
            self._is_low = False
        if wanted:
            if self._is_low and self._may_rise(mouse, wanted):
                self._is_low = False
            self._lay(wanted)
            fresh = self.clock() < self._fresh_until
            self._place.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents, fresh)
        else:
            self._said = ""

    def _note_change(self, mouse: QPoint) -> None:
        """Another banner: it goes where the mouse is not, and is not pressed by a click meant for another."""
        said = self._place.identity
        if said == self._said:
            return
        first, self._said = not self._said, said
        self._place.raise_()
        wanted = self.height_wanted
        top = QRect(0, self.y(), self.width(), wanted)
        if first:
            self._is_low = wanted > self.height() and top.contains(mouse)
        if wanted > self.height() or self._place.geometry().contains(mouse):
            self._fresh_until = self.clock() + FRESH_S

    def _may_move(self, mouse: QPoint, wanted: int) -> bool:
        """Whether the pages may move: the mouse is not over them, nor over what would come under it."""
        if QApplication.mouseButtons() or QApplication.activePopupWidget() is not None:
            return False
        if wanted and not self._is_low and self._place.geometry().contains(mouse):
            return mouse.y() < self.y() + wanted  # the banner stays where it is
        return not self.geometry().united(self._pages.geometry()).contains(mouse)

    def _may_rise(self, mouse: QPoint, wanted: int) -> bool:
        """Whether the mouse is neither where the banner is, at the lower edge, nor where it would go.

        Nothing that it covers down there can be uncovered by going to it, as it can be at the upper edge.
        """
        if QApplication.mouseButtons() or QApplication.activePopupWidget() is not None:
            return False
        above = QRect(self.x(), self.y(), self.width(), wanted)
        return not above.contains(mouse) and not self._place.geometry().contains(mouse)

    def _lay(self, wanted: int) -> None:
        top = self._pages.geometry().bottom() + 1 - wanted if self._is_low else self.y()
        place = QRect(self.x(), top, self.width(), wanted)
        if place != self._place.geometry():
            self._place.setGeometry(place)

    def _mouse(self) -> QPoint:
        at, parent = self.mouse_at(), self.parentWidget()
        return parent.mapFromGlobal(at) if parent is not None else at

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in {QEvent.Type.Show, QEvent.Type.Hide, QEvent.Type.LayoutRequest}:
            self.follow()
        return super().eventFilter(watched, event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if event.size().width() != event.oldSize().width():
            self.follow()

    def moveEvent(self, event: QMoveEvent) -> None:
        super().moveEvent(event)
        self.follow()


def _mouse_on_screen() -> QPoint:
    return QCursor.pos()
