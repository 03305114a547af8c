"""QR code of the test page for tablets, black on white in all themes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import segno
else:  # imported with the first code
    segno = lazy_module("segno")

SIDE = 140
QUIET_ZONE = 4
"""Width of the quiet zone on each side in modules, as required by ISO/IEC 18004."""
_PADDING = 12


def encode_modules(text: str) -> tuple[bytes, ...]:
    """Encode a text as a QR code and return the rows of its modules.

    Each byte is a module, 1 for dark and 0 for light. The quiet zone isn't included.

    Raises:
        ImportError: segno isn't installed.
    """
    return tuple(bytes(row) for row in segno.make_qr(text, error="m").matrix)


class QrCode(QWidget):
    """Widget that shows the QR code of a text, or a message in an empty frame."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._text, self._message = "", ""
        self._modules: tuple[bytes, ...] = ()
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)

    @property
    def text(self) -> str:
        """Encoded text, or "" while a message is shown."""
        return self._text

    def show_code(self, text: str, address: str) -> None:
        """Show the QR code of a text, or a message if segno isn't installed.

        Args:
            text: Text to encode, which may contain the token.
            address: Part of the text for screen readers.
        """
        if text == self._text:
            return
        try:
            modules = encode_modules(text)
        except ImportError:
            self.show_message(_("Install segno to show the QR code: pip install segno"))
            return
        self._text, self._modules, self._message = text, modules, ""
        self.setAccessibleName(
            _("QR code that opens {address} on a tablet. It contains the token.").format(address=address)
        )
        self.update()

    def show_message(self, message: str) -> None:
        """Show a message that explains why there is no code."""
        if message != self._message:
            self._text, self._modules, self._message = "", (), message
            self.setAccessibleName(message)
            self.update()

    def sizeHint(self) -> QSize:
        side = round(self._theme.scaled(SIDE))
        return QSize(side, side)

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        if self._modules:
            self._paint_code(painter)
        else:
            self._paint_message(painter)
        painter.end()

    def _paint_code(self, painter: QPainter) -> None:
        theme, rect = self._theme, QRectF(self.rect())
        paint.box(painter, rect, theme.radius("panel"), Qt.GlobalColor.white, theme.colour("borderStrong"))  # type: ignore[arg-type]
        ratio = painter.device().devicePixelRatioF()
        count = len(self._modules) + 2 * QUIET_ZONE
        side = (
            max(1, math.floor(rect.width() * ratio / count)) / ratio
        )  # whole pixels, since cameras need sharp edges
        left = round((rect.width() - side * len(self._modules)) / 2 * ratio) / ratio
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        for row, modules in enumerate(self._modules):
            for column, is_dark in enumerate(modules):
                if is_dark:
                    square = QRectF(left + column * side, left + row * side, side, side)
                    painter.fillRect(square, Qt.GlobalColor.black)

    def _paint_message(self, painter: QPainter) -> None:
        theme, rect = self._theme, QRectF(self.rect())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        pen = QPen(theme.colour("controlBorder"), 1)
        pen.setDashPattern([5, 4])
        painter.setPen(pen)
        painter.drawRoundedRect(
            rect.adjusted(0.5, 0.5, -0.5, -0.5), theme.radius("panel"), theme.radius("panel")
        )
        painter.setFont(theme.font("small"))
        painter.setPen(theme.colour("textSecondary"))
        text_area = rect.adjusted(_PADDING, _PADDING, -_PADDING, -_PADDING)
        flags = int(Qt.AlignmentFlag.AlignCenter) | int(Qt.TextFlag.TextWordWrap)
        painter.drawText(text_area, flags, self._message)
