"""Parts of the run bar and the tool bar: the state's mark, its sentence, and the last stop's result."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QFont, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.core.run.view import RunView
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

DOT = 10
HALO = 16
MARKS = {
    "ready": "ring",
    "proven": "ring",
    "running": "dot",
    "stopping": "dot",
    "paused": "pause",
    "unanswered": "circle-x",
}


class Mark(QWidget):
    """Ring: nothing runs; amber dot: something runs; pause; crossed circle: somebody must act."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._state = "ready"
        self.setFixedSize(20, 20)

    def show_state(self, state: str) -> None:
        """One of the six states of Run and Stop."""
        if state != self._state:
            self._state = state
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        centre = QRectF(self.rect()).center()
        mark = MARKS.get(self._state, "ring")
        if mark == "ring":
            painter.setPen(QPen(theme.colour("textTertiary"), 2))
            painter.drawEllipse(centre, 4, 4)
        elif mark == "dot":
            painter.setPen(Qt.PenStyle.NoPen)
            halo = theme.colour("running")
            halo.setAlphaF(0.3)
            painter.setBrush(halo)
            if self._state == "running":
                painter.drawEllipse(centre, HALO / 2, HALO / 2)
            painter.setBrush(theme.colour("running"))
            painter.drawEllipse(centre, DOT / 2, DOT / 2)
        else:
            role = theme.status("error").colour if mark == "circle-x" else "textSecondary"
            side = 18 if mark == "circle-x" else 16
            square = QRectF(centre.x() - side / 2, centre.y() - side / 2, side, side)
            paint_icon(painter, square, mark, theme.colour(role))
        painter.end()


class Sentence(QWidget):
    """What happens now: a title and a detail, one line each."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._title, self._detail, self._is_alarm = "", "", False
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        theme.changed.connect(self.updateGeometry)

    @property
    def colour_role(self) -> str:
        """The colour of the title: that of errors when somebody must act."""
        return self._theme.status("error").colour if self._is_alarm else "text"

    def show_words(self, title: str, detail: str, *, is_alarm: bool = False) -> None:
        """Say something else; `is_alarm`: somebody must act, so the title is red."""
        if (title, detail, is_alarm) != (self._title, self._detail, self._is_alarm):
            self._title, self._detail, self._is_alarm = title, detail, is_alarm
            self.setAccessibleName(f"{title}. {detail}")
            self.setToolTip(plain.tip(f"{title}\n{detail}"))
            self.update()

    def _title_font(self) -> QFont:
        font = self._theme.font("label")
        font.setWeight(font.Weight.DemiBold)
        return font

    def sizeHint(self) -> QSize:
        high = paint.height_of(self._title_font()) + paint.height_of(self._theme.font("body"))
        return QSize(320, round(high))

    def minimumSizeHint(self) -> QSize:
        return QSize(60, self.sizeHint().height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        bold, plain = self._title_font(), theme.font("body")
        upper, lower = paint.height_of(bold), paint.height_of(plain)
        top = (self.height() - upper - lower) / 2
        paint.words(
            painter, QRectF(0, top, self.width(), upper), self._title, bold, theme.colour(self.colour_role)
        )
        second = QRectF(0, top + upper, self.width(), lower)
        paint.words(painter, second, self._detail, plain, theme.colour("textSecondary"))
        painter.end()


class Result(QWidget):
    """What a stop brought, beside the button: proven, counted, not answered; while running a reminder."""

    def __init__(self, theme: Theme, *, compact: bool = False) -> None:
        super().__init__()
        self._theme, self._compact = theme, compact
        self._look, self._text = "", ""
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)
        self.hide()

    @property
    def text(self) -> str:
        """The words shown now."""
        return self._text

    @property
    def look(self) -> str:
        """How they are shown: "ok", "error", "counting", "reminder" or ""."""
        return self._look

    def show_view(self, view: RunView) -> None:
        """Show what a stop brought."""
        look, text = "", ""
        if view.state == "unanswered":
            look, text = "error", (view.compact if self._compact else view.result or "")
        elif view.state == "stopping" and view.result:
            look, text = "counting", view.result
        elif view.result:
            look, text = ("ok" if view.result_ok else "error"), view.result
        elif view.last_stop and not self._compact:
            look, text = "reminder", view.last_stop
        if (look, text) != (self._look, self._text):
            self._look, self._text = look, text
            self.setAccessibleName(text)
            if look in {"ok", "error"}:
                paint.announce(self, text)
            paint.show_when(self, bool(text))
            self.updateGeometry()
            self.update()

    def _font(self) -> QFont:
        if self._compact or self._look == "reminder":
            font = self._theme.font("small" if self._compact else "body")
            font.setWeight(font.Weight.Medium)
            return font
        return self._theme.font("button")

    def _icon(self) -> int:
        return 14 if self._compact else 16 if self._look == "reminder" else 20

    def sizeHint(self) -> QSize:
        width = paint.width_of(self._font(), self._text)
        if self._look == "counting":
            return QSize(round(width) + 10, 44 if not self._compact else 28)
        width += self._icon() + (6 if self._compact or self._look == "reminder" else 10)
        if self._look != "reminder":
            width += 17 if self._compact else 28
        least = 28 if self._compact else 44
        return QSize(round(width) + 2, max(least, round(paint.height_of(self._font())) + 10))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        if self._look == "counting":
            area, ink = rect.adjusted(0, 0, -8, 0), theme.colour("textSecondary")
            paint.words(painter, area, self._text, self._font(), ink, paint.RIGHT)
        elif self._look == "reminder":
            self._paint_reminder(painter, rect)
        else:
            status = theme.status(self._look)
            radius = theme.radius("small" if self._compact else "large")
            paint.box(painter, rect, radius, theme.colour(status.tint or "panel"))
            self._paint_line(painter, rect.adjusted(8 if self._compact else 13, 0, 0, 0), self._look)
        painter.end()

    def _paint_reminder(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        high = paint.height_of(theme.font("body"))
        upper = QRectF(rect.left(), rect.center().y() - high - 1, rect.width(), high)
        paint.words(
            painter, upper, "Last stop", theme.font("body"), theme.colour("textSecondary"), paint.RIGHT
        )
        self._paint_line(painter, QRectF(rect.left(), rect.center().y() + 1, rect.width(), high), "ok")

    def _paint_line(self, painter: QPainter, rect: QRectF, name: str) -> None:
        theme = self._theme
        status = theme.status(name)
        side = self._icon()
        square = QRectF(rect.left(), rect.center().y() - side / 2, side, side)
        paint_icon(painter, square, status.icon, theme.colour(status.colour))
        left = side + (6 if self._compact or self._look == "reminder" else 10)
        paint.words(
            painter, rect.adjusted(left, 0, 0, 0), self._text, self._font(), theme.colour(status.colour)
        )


class Bar(QWidget):
    """The surface below the app bar, with its line."""

    def __init__(self, theme: Theme, height: int) -> None:
        super().__init__()
        self._theme = theme
        self.setMinimumHeight(height)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = self.rect()
        painter.fillRect(rect, self._theme.colour("panel"))
        paint.hairline(painter, QRectF(rect), Qt.Edge.BottomEdge, self._theme.colour("border"))
        painter.end()
