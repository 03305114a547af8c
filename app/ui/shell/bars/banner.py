"""The alert under the run bar: one at a time, with its next step, where it moves nothing under the mouse.

It lies over the upper edge of the pages as soon as it is wanted, or over the lower one while the mouse is at
the upper. Room is made for it, and taken away, only while the mouse is neither over the pages nor pressed:
then a click that was aimed at something lands there.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from html import escape
from typing import Protocol

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt, Signal
from PySide6.QtGui import QCursor, QMoveEvent, QResizeEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QSizePolicy, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button, IconButton
from app.ui.widgets.cards import AlertBox
from app.ui.widgets.labels import label
from nep.i18n import _, ngettext

FIGURES = re.compile(r"\d+")
LEAST_HEIGHT = 52
STEP_ICONS = {
    "help.doctor": "stethoscope",
    "help.report": "message-square-warning",
    "robots.virtual": "bot",
    "file.open": "folder-open",
}
FRESH_S = 0.5
"""So long after it came under a mouse the banner lets a press through to what was there before."""


class AlertLike(Protocol):
    """What the banner needs of an alert (`app.core.alerts.ActiveAlert`)."""

    @property
    def id(self) -> str:
        """Its identity."""

    @property
    def severity(self) -> str:
        """Its severity: "error", "warn" or "info"."""

    @property
    def title(self) -> str:
        """What is wrong, one sentence."""

    @property
    def detail(self) -> str:
        """What it means."""

    @property
    def button(self) -> str | None:
        """The words of the next step."""

    @property
    def action(self) -> str | None:
        """The next step's name in the table of actions."""


class Banner(AlertBox):
    """Icon, a bold sentence, a plain one, one button with the next step, perhaps a second one, and close."""

    icon_side, icon_left, left, high, gap = 20, 16, 48, 8, 8
    least_words = 360

    pressed = Signal()
    second_pressed = Signal()
    more_pressed = Signal()
    closed = Signal()
    mouse_left = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self.setMinimumHeight(LEAST_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._words = ("", "")
        self._announced = ""
        self.words = label("", "lead", wrap=True)
        self.words.setTextFormat(Qt.TextFormat.RichText)
        theme.changed.connect(self._write)
        self.more = Button(theme, "", kind="ghost", size="small")
        self.button = Button(theme, "", size="form")
        self.second = Button(theme, "", size="form")
        self.close_button = IconButton(theme, "x", _("Close this message"), size=32)
        self.text_column.addWidget(self.words)
        for widget in (self.more, self.second, self.button, self.close_button):
            self.button_row.addWidget(widget)
        self.button.clicked.connect(self.pressed)
        self.second.clicked.connect(self.second_pressed)
        self.more.clicked.connect(self.more_pressed)
        self.close_button.clicked.connect(self.closed)

    def show_words(
        self,
        status: str,
        title: str,
        detail: str,
        button: str | None,
        others: int = 0,
        *,
        second: str | None = None,
        icon: str | None = None,
    ) -> None:
        """Say what is wrong; ``others`` counts the alerts that wait behind this one."""
        self.button.icon_name = icon
        self.set_status(status)
        self._words = (title, detail)
        self._write()
        spoken = f"{title} {detail}".strip()
        self.setAccessibleName(spoken)
        news = FIGURES.sub("", spoken)
        if news != self._announced:  # a count that goes on is no news
            self._announced = news
            paint.announce(self, spoken)
        for widget, text in ((self.button, button), (self.second, second)):
            widget.set_word(text or "")
            paint.show_when(widget, bool(text))
        more = ngettext("and {count} more", "and {count} more", others).format(count=others)
        self.more.set_word(more if others else "")
        paint.show_when(self.more, others > 0)

    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self.mouse_left.emit()

    def _write(self) -> None:
        title, detail = (escape(words) for words in self._words)
        quiet = self._theme.hex("textSecondary")
        self.words.setText(
            f'<span style="font-weight:600">{title}</span> <span style="color:{quiet}">{detail}</span>'
        )

    def icon_top(self) -> float:
        return (self.height() - self.icon_side) / 2


class AlertBanner(QWidget):
    """Where the banner is: shows the worst alert that was not closed, and goes when it is cured."""

    def __init__(self, theme: Theme, banner: Banner | None = None) -> None:
        super().__init__()
        self.banner = banner if banner is not None else Banner(theme)
        self._alert: AlertLike | None = None
        self._alerts: Sequence[AlertLike] = ()
        self._offer: tuple[Callable[[], object], Callable[[], object]] | None = None
        self.on_action: Callable[[str], object] = lambda _name: None
        self.on_dismiss: Callable[[str], object] = lambda _alert_id: None
        self.on_more: Callable[[], object] = lambda: None
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 8, 8, 0)
        row.addWidget(self.banner)
        self.banner.pressed.connect(self._next_step)
        self.banner.second_pressed.connect(lambda: self._answer(1))
        self.banner.more_pressed.connect(self._more)
        self.banner.closed.connect(self._close)
        self.banner.mouse_left.connect(lambda: self.show_alerts(self._alerts))
        self.hide()

    @property
    def identity(self) -> str:
        """What is shown, whatever its words say now: an alert's id, "offer", or "" for nothing."""
        if self._offer is not None:
            return "offer"
        return self._alert.id if self._alert is not None else ""

    @property
    def alert(self) -> AlertLike | None:
        """The alert that is shown."""
        return self._alert

    @property
    def offers(self) -> bool:
        """Whether something is offered that nobody has answered yet."""
        return self._offer is not None

    def offer(
        self,
        title: str,
        detail: str,
        yes: tuple[str, Callable[[], object]],
        no: tuple[str, Callable[[], object]],
    ) -> None:
        """Offer something once, with two answers; alerts wait until it is answered."""
        self._offer = (yes[1], no[1])
        self.banner.show_words("info", title, detail, yes[0], second=no[0])
        self.show()

    def show_alerts(self, alerts: Sequence[AlertLike]) -> None:
        """The alerts that are active and not closed, worst first."""
        self._alerts = alerts
        if self._offer is not None:
            return
        first = self._first(alerts)
        self._alert = first
        if first is None:
            self.hide()
            return
        others = len(alerts) - 1
        icon = STEP_ICONS.get(first.action or "")
        self.banner.show_words(first.severity, first.title, first.detail, first.button, others, icon=icon)
        self.show()

    def _first(self, alerts: Sequence[AlertLike]) -> AlertLike | None:
        """The worst; while the mouse is on the banner the one that is shown, whose button may be pressed."""
        shown = self._alert
        if shown is not None and self.banner.underMouse():
            still = next((alert for alert in alerts if alert.id == shown.id), None)
            if still is not None:
                return still
        return alerts[0] if alerts else None

    def _answer(self, which: int) -> None:
        if self._offer is not None:
            answer = self._offer[which]
            self._offer = None
            answer()
            self.show_alerts(self._alerts)

    def _next_step(self) -> None:
        if self._offer is not None:
            self._answer(0)
        elif self._alert is not None and self._alert.action is not None:
            self.on_action(self._alert.action)

    def _close(self) -> None:
        if self._offer is not None:
            self._offer = None
            self.show_alerts(self._alerts)
        elif self._alert is not None:
            closed = self._alert.id
            self.show_alerts([alert for alert in self._alerts if alert.id != closed])
            self.on_dismiss(closed)

    def _more(self) -> None:
        self.on_more()


class BannerSpacer(QWidget):
    """The room between bars and pages; the banner lies over it, or over pages that may not move yet."""

    def __init__(
        self,
        place: AlertBanner,
        pages: QWidget,
        *,
        mouse_at: Callable[[], QPoint] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """All three have the same parent; ``mouse_at`` tells where the mouse is on the screen."""
        super().__init__()
        self._place, self._pages = place, pages
        self.mouse_at: Callable[[], QPoint] = mouse_at or QCursor.pos
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
        if not wanted and not self.height():
            self._said = ""
            return  # where the mouse is costs a way to the screen and back, 30 times a second
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
