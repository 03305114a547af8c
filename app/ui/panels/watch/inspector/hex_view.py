"""Hex view of a message: offset, bytes and printable characters. Only visible lines are formatted."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QFontMetricsF, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractScrollArea

from app.ui.theme.theme import Theme
from nep.i18n import _

WIDE_BYTES, NARROW_BYTES = 16, 8
MARGIN = 12


def hex_line(data: memoryview, offset: int, count: int) -> tuple[str, str, str]:
    """Format one line of a hex dump.

    Args:
        data: Bytes of the message.
        offset: Index of the first byte of the line.
        count: Number of bytes per line.

    Returns:
        Offset, bytes and characters. Unprintable characters are replaced by dots.
    """
    part = bytes(data[offset : offset + count])
    text = "".join(chr(byte) if 32 <= byte < 127 else "·" for byte in part)
    return f"{offset:04x}", part.hex(" "), text


class HexView(QAbstractScrollArea):
    """Hex view with sixteen bytes per line, or eight in a narrow panel."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._data = memoryview(b"")
        self.setAccessibleName(_("Raw bytes"))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setFrameShape(QAbstractScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)

    def show_bytes(self, data: memoryview | bytes) -> None:
        """Replace the bytes. The scroll position stays the same."""
        self._data = memoryview(data)
        self._update_scroll_range()
        self.viewport().update()

    def text(self) -> str:
        """Return all lines as text."""
        count = self.bytes_per_line()
        return "\n".join(
            "  ".join(hex_line(self._data, offset, count)) for offset in range(0, len(self._data), count)
        )

    def bytes_per_line(self) -> int:
        """Return the number of bytes per line at the current width."""
        char_width = QFontMetricsF(self._theme.font("code")).horizontalAdvance("0")
        return (
            WIDE_BYTES
            if self.viewport().width() >= (6 + WIDE_BYTES * 4 + 3) * char_width + 2 * MARGIN
            else NARROW_BYTES
        )

    def _line_height(self) -> int:
        return round(self._theme.scaled(20))

    def _update_scroll_range(self) -> None:
        lines = -(-len(self._data) // self.bytes_per_line())
        bar = self.verticalScrollBar()
        bar.setPageStep(max(1, self.viewport().height() // self._line_height()))
        bar.setRange(0, max(0, lines - bar.pageStep()))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._update_scroll_range()

    def scrollContentsBy(self, _dx: int, _dy: int) -> None:
        self.viewport().update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self.viewport())
        painter.fillRect(self.viewport().rect(), self._theme.colour("panel"))
        font = self._theme.font("code")
        painter.setFont(font)
        char_width = QFontMetricsF(font).horizontalAdvance("0")
        count, height = self.bytes_per_line(), self._line_height()
        first = self.verticalScrollBar().value()
        columns = (MARGIN, MARGIN + 6 * char_width, MARGIN + (7 + count * 3) * char_width)
        for row in range(self.viewport().height() // height + 1):
            offset = (first + row) * count
            if offset >= len(self._data):
                break
            parts = zip(
                hex_line(self._data, offset, count), columns, ("textTertiary", "text", "ok"), strict=True
            )
            for text, x, role in parts:
                painter.setPen(self._theme.colour(role))
                box = QRectF(x, 4 + row * height, self.viewport().width(), height)
                painter.drawText(box, int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter), text)
        painter.end()
