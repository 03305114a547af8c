"""Labels for texts and icons, with the font of a kind and the colour of a role, and separators."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QRectF, QSize, Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint


def label(text: str = "", kind: str = "body", *, role: str = "text", wrap: bool = False) -> QLabel:
    """Create a label for plain text.

    Args:
        text: Text.
        kind: Kind of text, such as "body", "small" or "title", which determines the font.
        role: Colour role.
        wrap: True for word wrap.
    """
    result = QLabel(text)
    result.setTextFormat(Qt.TextFormat.PlainText)
    result.setProperty("kind", kind)
    result.setProperty("role", role)
    result.setWordWrap(wrap)
    return result


def set_role(widget: QLabel, role: str) -> None:
    """Set the colour role of a label."""
    paint.set_style_property(widget, "role", role)


class ElidedLabel(QLabel):
    """Label whose text is elided in the middle if it doesn't fit; the tooltip has the full text."""

    mode = Qt.TextElideMode.ElideMiddle

    def __init__(self, kind: str, role: str, min_width: int = 0, *, min_elided_width: int = 0) -> None:
        # `min_width` is the minimum width in px; a text elided to less than `min_elided_width` isn't painted.
        super().__init__()
        self._min_width, self._min_elided_width = min_width, min_elided_width
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setProperty("kind", kind)
        self.setProperty("role", role)

    def minimumSizeHint(self) -> QSize:
        return QSize(min(self._min_width, super().sizeHint().width()), super().minimumSizeHint().height())

    def displayed_text(self) -> str:
        """Return the text as it is painted."""
        width = self.contentsRect().width()
        elided = self.fontMetrics().elidedText(self.text(), self.mode, width + 1)
        return elided if elided == self.text() or width >= self._min_elided_width else ""

    def paintEvent(self, _event: QPaintEvent) -> None:
        displayed_text = self.displayed_text()
        full_text = self.text() if displayed_text != self.text() else ""
        if plain.tip(full_text) != self.toolTip():
            self.setToolTip(plain.tip(full_text))
        painter = QPainter(self)
        painter.setPen(self.palette().color(self.foregroundRole()))
        painter.drawText(self.contentsRect(), int(paint.LEFT), displayed_text)
        painter.end()


class FixedWidthLabel(ElidedLabel):
    """Label for a text that changes often, whose size doesn't depend on the text.

    With a normal label, each change of the text causes a relayout of the whole window.
    """

    def __init__(self, kind: str, role: str) -> None:
        self._text = ""
        super().__init__(kind, role)
        super().setText("0")  # space for one line

    def text(self) -> str:
        return self._text

    def setText(self, text: str) -> None:
        if text != self._text:
            self._text = text
            self.setAccessibleName(text)
            self.update()


class SteadyLabel(ElidedLabel):
    """Label for a text that changes about once a second, as wide as the widest text so far."""

    def __init__(self, kind: str, role: str, min_width: int = 0) -> None:
        self._text = ""
        super().__init__(kind, role, min_width)

    def text(self) -> str:
        return self._text

    def setText(self, text: str) -> None:
        if text == self._text:
            return
        self._text = text
        self.setAccessibleName(text)
        metrics = self.fontMetrics()
        if not text or metrics.horizontalAdvance(text) > metrics.horizontalAdvance(super().text()):
            super().setText(text)
        else:
            self.update()


class PartlyBoldLabel(QWidget):
    """Label for one line of text, in which one part is bold.

    Args:
        theme: Theme.
        text: Text.
        subject: Part of the text to show in bold.
        kind: Kind of text, which determines the font.
    """

    def __init__(self, theme: Theme, text: str, subject: str, kind: str = "bodyLarge") -> None:
        super().__init__()
        self._theme, self._kind = theme, kind
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setAccessibleName(text)
        self.setToolTip(plain.tip(text))
        before, match, after = text.partition(subject) if subject else (text, "", "")
        self._parts = ((before, False), (match, True), (after, False))

    def sizeHint(self) -> QSize:
        return QSize(200, round(QFontMetricsF(self._theme.font(self._kind)).height()) + 2)

    def full_width(self) -> float:
        """Return the width in px of the full text."""
        return sum(paint.width_of(self._font(strong=strong), text) for text, strong in self._parts)

    def _font(self, *, strong: bool) -> QFont:
        font = self._theme.font(self._kind)
        if strong:
            font.setWeight(font.Weight.Bold)
        return font

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = QRectF(self.rect())
        for index, (text, strong) in enumerate(self._parts):
            font = self._font(strong=strong)
            next_text = "".join(part for part, _strong in self._parts[index + 1 :])
            if next_text and paint.width_of(font, f"{text}…") > rect.width():
                # no space for an ellipsis in the next part, so that this part is elided
                paint.text_line(painter, rect, text + next_text, font, self._theme.colour("text"))
                break
            paint.text_line(painter, rect, text, font, self._theme.colour("text"))
            rect.setLeft(rect.left() + paint.width_of(font, text))
        painter.end()


class IconLabel(QLabel):
    """Icon in the colour of a role, next to a text with the same meaning.

    Args:
        theme: Theme.
        icon: Name of the icon.
        role: Colour role.
        side: Size in px.
        scales: True to scale the icon with the text size.
    """

    def __init__(
        self, theme: Theme, icon: str, role: str = "textSecondary", side: int = 16, *, scales: bool = True
    ) -> None:
        super().__init__()
        self._theme, self._icon, self._role, self._side, self._scales = theme, icon, role, side, scales
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        theme.changed.connect(self._update_pixmap)
        self._update_pixmap()

    def set_icon(self, icon: str, role: str) -> None:
        """Set the icon and the colour role."""
        if (icon, role) != (self._icon, self._role):
            self._icon, self._role = icon, role
            self._update_pixmap()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange:
            self._update_pixmap()
        return super().event(event)

    def _update_pixmap(self) -> None:
        side = round(self._theme.scaled(self._side)) if self._scales else self._side
        icon = self._theme.icon(self._icon, self._role)
        self.setPixmap(icon.pixmap(QSize(side, side), self.devicePixelRatioF()))


class LinedWidget(QWidget):
    """Widget with a line of 1 px along an edge. The style sheet paints the background.

    Args:
        theme: Theme.
        edge: Edge with the line.
        parent: Parent.
    """

    def __init__(
        self, theme: Theme, edge: Qt.Edge = Qt.Edge.BottomEdge, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._theme, self._edge = theme, edge

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint.hairline(painter, QRectF(self.rect()), self._edge, self._theme.colour("border"))
        painter.end()


class Separator(LinedWidget):
    """Line of 1 px: vertical between groups of buttons, or horizontal between parts of a panel."""

    def __init__(self, theme: Theme, *, upright: bool = False, length: int = 0) -> None:
        super().__init__(theme, Qt.Edge.LeftEdge if upright else Qt.Edge.TopEdge)
        if upright:
            self.setFixedWidth(1)
        else:
            self.setFixedHeight(1)
        if length:
            (self.setFixedHeight if upright else self.setFixedWidth)(length)
