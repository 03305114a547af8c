"""Banner that shows an alert over the free area of the current bar, with a button for the next step.

One alert is shown at a time. The banner is an overlay, because a widget in the layout would move the
panels under the mouse pointer when it appears.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from PySide6.QtCore import QEvent, QPoint, QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QCursor, QFont, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.intents import ConnectRobot, Intent, OpenBehaviour, OpenDoctor, ReportProblem
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button, IconButton, Size
from app.ui.widgets.cards import AlertBox
from nep.i18n import _, ngettext

DIGITS = re.compile(r"\d+")
MIN_WIDTH = 220  # px at 100 % text; below it only the status bar shows alerts
MIN_TEXT_WIDTH = 160  # px at 100 % text; below it the next step is only an icon
TEXT_KINDS = ("bodyLarge", "body", "small")
MIN_TALL_HEIGHT = 44  # px at 100 % text; lower banners have small buttons
STEP_ICONS: Mapping[type[Intent], str] = {
    OpenDoctor: "stethoscope",
    ReportProblem: "message-square-warning",
    ConnectRobot: "bot",
    OpenBehaviour: "folder-open",
}
NARROW_BUTTON_ICON = "arrow-right"
CLICK_GUARD_S = 0.5
"""Time in s during which a banner that appeared under the mouse pointer ignores clicks."""


class AlertLike(Protocol):
    """Interface of `app.core.alerts.alerts.ActiveAlert` that the banner uses."""

    @property
    def id(self) -> str:
        """Unique id of the alert."""

    @property
    def severity(self) -> str:
        """Severity of the alert: "error", "warn" or "info"."""

    @property
    def title(self) -> str:
        """Problem, described in one sentence."""

    @property
    def detail(self) -> str:
        """Explanation of the problem, or ""."""

    @property
    def button(self) -> str | None:
        """Text of the button for the next step, or None for no button."""

    @property
    def intent(self) -> Intent | None:
        """Next step that the button carries out, or None."""


class BannerText(QWidget):
    """Title in bold and detail of an alert, wrapped to the available lines; the tooltip has the full text."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._title, self._detail = "", ""
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        theme.changed.connect(self.update)

    def show_text(self, title: str, detail: str) -> None:
        """Set the title and the detail."""
        if (title, detail) != (self._title, self._detail):
            self._title, self._detail = title, detail
            self.setToolTip(plain.tip(f"{title}\n{detail}".strip()))
            self.update()

    def minimumSizeHint(self) -> QSize:
        return QSize(0, 0)

    def sizeHint(self) -> QSize:
        return QSize(200, round(2 * paint.height_of(self._theme.font("body"))))

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        # the largest font in which the full text fits, else the smallest one
        kind = next((each for each in TEXT_KINDS if self.lines(each)[1]), TEXT_KINDS[-1])
        lines, line_height = self.lines(kind)[0], paint.height_of(self._theme.font(kind))
        top = (self.height() - line_height * len(lines)) / 2
        for line in lines:
            x = 0.0
            for text, font, role in line:
                area = QRectF(x, top, self.width() - x, line_height)
                paint.text_line(painter, area, text, font, self._theme.colour(role))
                x += paint.width_of(font, text + " ")
            top += line_height
        painter.end()

    def lines(self, kind: str) -> tuple[list[list[tuple[str, QFont, str]]], bool]:
        """Break the text into lines for a font.

        Args:
            kind: Kind of text, which determines the font.

        Returns:
            The lines, each as a list of (text, font, colour role), and True if the full text fits. If
            it doesn't, the last line is elided when it is painted.
        """
        plain_font, bold = self._theme.font(kind), self._theme.font(kind)
        bold.setWeight(QFont.Weight.DemiBold)
        max_lines = max(1, int(self.height() / paint.height_of(plain_font)))
        lines: list[list[tuple[str, QFont, str]]] = [[]]
        x = 0.0
        for text, font, role in (
            (self._title, bold, "text"),
            (self._detail, plain_font, "textSecondary"),
        ):
            remaining_words = text.split()
            while remaining_words:
                fitting_count = _fitting_word_count(font, remaining_words, self.width() - x)
                if fitting_count < len(remaining_words) and len(lines) == max_lines:
                    lines[-1].append((" ".join(remaining_words), font, role))
                    return lines, False
                if not fitting_count and not lines[-1]:
                    fitting_count = 1
                if fitting_count:
                    piece = " ".join(remaining_words[:fitting_count])
                    lines[-1].append((piece, font, role))
                    x += paint.width_of(font, piece + " ")
                    del remaining_words[:fitting_count]
                if remaining_words:
                    lines.append([])
                    x = 0.0
        return lines, True


def _fitting_word_count(font: QFont, words: Sequence[str], width: float) -> int:
    count = len(words)
    while count and paint.width_of(font, " ".join(words[:count])) > width:
        count -= 1
    return count


class Banner(AlertBox):
    """Banner with an icon, a title, a detail, up to two buttons, and a close button."""

    vertical_margin, gap = 0, 6
    icon_alignment = Qt.AlignmentFlag.AlignVCenter

    pressed = Signal()
    second_pressed = Signal()
    more_pressed = Signal()
    closed = Signal()
    mouse_exited = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self._other_count = 0
        self._step_text = ""
        self._icon: str | None = None
        self._announced_text = ""
        self.text_label = BannerText(theme)
        self.more_button = Button(theme, "", kind="ghost", size="small")
        self.button = Button(theme, "", size="form")
        self.second_button = Button(theme, "", size="form")
        for button in (self.button, self.second_button):
            button.allow_shrinking()
        self.close_button = IconButton(theme, "x", _("Dismiss"), size=26)
        self.text_column.addWidget(self.text_label)
        for widget in (self.more_button, self.second_button, self.button, self.close_button):
            self.button_row.addWidget(widget)
        self.button.clicked.connect(self.pressed)
        self.second_button.clicked.connect(self.second_pressed)
        self.more_button.clicked.connect(self.more_pressed)
        self.close_button.clicked.connect(self.closed)

    def show_text(
        self,
        status: str,
        title: str,
        detail: str,
        button: str | None,
        other_count: int = 0,
        *,
        second: str | None = None,
        icon: str | None = None,
    ) -> None:
        """Set the contents of the banner.

        Args:
            status: Status that determines the colours and, unless `icon` is given, the icon.
            title: Problem, described in one sentence.
            detail: Explanation.
            button: Text of the button for the next step, or None.
            other_count: Number of further alerts.
            second: Text of the second button, or None.
            icon: Icon of the button in a narrow banner, or None for an arrow.
        """
        self._icon = self.button.icon_name = icon
        self.set_status(status)
        self.text_label.show_text(title, detail)
        message = f"{title} {detail}".strip()
        self.setAccessibleName(message)
        text_without_digits = DIGITS.sub("", message)
        if text_without_digits != self._announced_text:  # changes of numbers alone aren't announced again
            self._announced_text = text_without_digits
            paint.announce(self, message)
        self._step_text, self._other_count = button or "", other_count
        self.second_button.set_label(second or "")
        for widget, label in (
            (self.button, button),
            (self.second_button, second),
            (self.more_button, other_count),
        ):
            paint.show_when(widget, bool(label))
        self._fit()

    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self.mouse_exited.emit()

    def _fit(self) -> None:
        scaled = self._theme.scaled
        size: Size = "form" if self.height() >= scaled(MIN_TALL_HEIGHT) else "small"
        for button in (self.button, self.second_button):
            button.set_size(size)
        template = ngettext("and {count} more", "and {count} more", self._other_count)
        count = template.format(count=self._other_count)
        widths = (
            self.more_button.width_with(count),
            self.button.width_with(self._step_text),
            self.second_button.sizeHint().width(),
        )
        button_widths = zip((self.more_button, self.button, self.second_button), widths, strict=True)
        buttons_width = sum(width + self.gap for button, width in button_widths if not button.isHidden())
        room = self.width() - self.left - self.close_button.sizeHint().width() - self.gap - buttons_width
        is_narrow = room < scaled(MIN_TEXT_WIDTH)
        self.more_button.set_label(f"+{self._other_count}" if is_narrow else count, name=count)
        self.button.icon_name = NARROW_BUTTON_ICON if is_narrow and self._icon is None else self._icon
        self.button.set_label("" if is_narrow else self._step_text, name=self._step_text)
        self.button.setToolTip(plain.tip(self._step_text if is_narrow else ""))


class AlertBanner(QWidget):
    """Overlay over the current bar that shows the most severe undismissed alert until it is resolved.

    The overlay can also show an offer, which takes precedence over alerts.
    """

    def __init__(
        self,
        theme: Theme,
        banner: Banner | None = None,
        *,
        mouse_at: Callable[[], QPoint] = QCursor.pos,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # `mouse_at` returns the mouse position on the screen; `clock` returns monotonic seconds.
        super().__init__()
        self.banner = banner if banner is not None else Banner(theme)
        self.mouse_at, self.clock = mouse_at, clock
        self._theme = theme
        self._alert: AlertLike | None = None
        self._alerts: Sequence[AlertLike] = ()
        self._offer: tuple[Callable[[], object], Callable[[], object]] | None = None
        self._positioned_identity = ""
        self._guarded_until_s = 0.0
        self.on_action: Callable[[Intent], object] = lambda _intent: None
        self.on_dismiss: Callable[[str], object] = lambda _alert_id: None
        self.on_more: Callable[[], object] = lambda: None
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.banner)
        self.banner.pressed.connect(self._run_next_step)
        self.banner.second_pressed.connect(lambda: self._run_offer_action(1))
        self.banner.more_pressed.connect(self._show_more)
        self.banner.closed.connect(self._close)
        self.banner.mouse_exited.connect(lambda: self.show_alerts(self._alerts))
        self.hide()

    @property
    def identity(self) -> str:
        """Identity of the contents: the id of the alert, "offer", or "" if the banner is empty.

        Independent of the texts, which can change while the same alert is shown.
        """
        if self._offer is not None:
            return "offer"
        return self._alert.id if self._alert is not None else ""

    @property
    def alert(self) -> AlertLike | None:
        """Alert that is shown, or that was shown before the current offer; None if there is none."""
        return self._alert

    @property
    def has_offer(self) -> bool:
        """True while an offer is shown and the user hasn't chosen yet."""
        return self._offer is not None

    def offer(
        self,
        title: str,
        detail: str,
        yes: tuple[str, Callable[[], object]],
        no: tuple[str, Callable[[], object]],
    ) -> None:
        """Show an offer with two buttons; alerts are shown again after the user's choice.

        If the user closes the banner, neither callback is called.

        Args:
            title: Offer, as a question.
            detail: Explanation.
            yes: Text and callback of the first button.
            no: Text and callback of the second button.
        """
        self._offer = (yes[1], no[1])
        self.banner.show_text("info", title, detail, yes[0], second=no[0])
        self.show()

    def show_alerts(self, alerts: Sequence[AlertLike]) -> None:
        """Set the active alerts that are not dismissed, most severe first; a current offer stays visible."""
        self._alerts = alerts
        if self._offer is not None:
            return
        first = self._alert_to_show(alerts)
        self._alert = first
        if first is None:
            self.hide()
            return
        others = len(alerts) - 1
        icon = None if first.intent is None else STEP_ICONS.get(type(first.intent))
        self.banner.show_text(first.severity, first.title, first.detail, first.button, others, icon=icon)
        self.show()

    def _alert_to_show(self, alerts: Sequence[AlertLike]) -> AlertLike | None:
        # Keeps the current alert while the mouse is over the banner, so that the button under it doesn't
        # change.
        current = self._alert
        if current is not None and self.banner.underMouse():
            updated = next((alert for alert in alerts if alert.id == current.id), None)
            if updated is not None:
                return updated
        return alerts[0] if alerts else None

    def _run_offer_action(self, index: int) -> None:
        if self._offer is not None:
            action = self._offer[index]
            self._offer = None
            action()
            self.show_alerts(self._alerts)

    def _run_next_step(self) -> None:
        if self._offer is not None:
            self._run_offer_action(0)
        elif self._alert is not None and self._alert.intent is not None:
            self.on_action(self._alert.intent)

    def _close(self) -> None:
        if self._offer is not None:
            self._offer = None
            self.show_alerts(self._alerts)
        elif self._alert is not None:
            alert_id = self._alert.id
            self.show_alerts([alert for alert in self._alerts if alert.id != alert_id])
            self.on_dismiss(alert_id)

    def _show_more(self) -> None:
        self.on_more()

    def move_to(self, area: QRect) -> None:
        """Move the banner to an area of its parent, or hide it if the area is too narrow.

        Called on every tick, because the bars change their layout. A banner that appears under the
        mouse pointer ignores clicks for `CLICK_GUARD_S`.
        """
        if not self.identity:
            self._positioned_identity = ""
            return
        paint.show_when(self, area.width() >= self._theme.scaled(MIN_WIDTH))
        if area != self.geometry() or self.identity != self._positioned_identity:
            self._positioned_identity = self.identity
            self.setGeometry(area)
            self.raise_()
            self._guarded_until_s = self.clock() + CLICK_GUARD_S if self._is_under_mouse() else 0.0
        is_guarded = self.clock() < self._guarded_until_s
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents, is_guarded)

    def _is_under_mouse(self) -> bool:
        return self.rect().contains(self.mapFromGlobal(self.mouse_at()))
