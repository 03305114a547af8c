"""Images of the package made from Studio's logo: icons and the disk image's background.

    QT_QPA_PLATFORM=offscreen python -m installers.macos.pictures FOLDER

No screen is needed.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QApplication

from app.ui.shell.bars.logo import paint_logo
from app.ui.theme.theme import Theme
from installers.icons import paint_behaviour
from installers.macos.disk_image import APP_AT, APPLICATIONS_AT, ICON_SIDE, WINDOW
from installers.macos.information import APP_ICON, DOCUMENT_ICON

__all__ = ["BACKGROUND", "SIDES", "icns", "write_pictures"]

BACKGROUND = "background.png"
SIDES: Mapping[bytes, int] = {
    b"ic04": 16, b"ic11": 32, b"ic05": 32, b"ic12": 64, b"ic07": 128, b"ic13": 256,
    b"ic08": 256, b"ic14": 512, b"ic09": 512, b"ic10": 1024,
}  # fmt: skip
"""Icon types with sizes in pixels: 16, 32, 128, 256 and 512 points, each also at Retina resolution."""
_RAW = frozenset({b"ic04", b"ic05"})
"""Icon types that contain four channels one after the other instead of a PNG, as Apple's iconutil does."""
_MAX_RUN = 128

Paint = Callable[[QPainter, float, Theme], None]


def paint_app(painter: QPainter, side: float, theme: Theme) -> None:
    """Paint the logo with the margin of Apple's icons, whose shape fills 824 of 1024 pixels."""
    margin = round(side * 100 / 1024)
    paint_logo(painter, QRectF(margin, margin, side - 2 * margin, side - 2 * margin), theme)


def paint_document(painter: QPainter, side: float, theme: Theme) -> None:
    """Paint the icon of documents, which is the same on all systems."""
    paint_behaviour(painter, QRectF(0, 0, side, side), theme)


def paint_background(painter: QPainter, scale: float, theme: Theme) -> None:
    """Paint a light background with an arrow from the application to the folder, without text."""
    painter.scale(scale, scale)
    painter.fillRect(QRectF(0, 0, *WINDOW), QColor("#f4f5f7"))
    gap = ICON_SIDE / 2 + 26
    start, end = APP_AT[0] + gap, APPLICATIONS_AT[0] - gap
    line = QPen(theme.colour("accent"), 7)
    line.setCapStyle(Qt.PenCapStyle.RoundCap)
    line.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(line)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    middle = float(APP_AT[1])
    painter.drawLine(QPointF(start, middle), QPointF(end, middle))
    tip = [QPointF(end - 22, middle - 20), QPointF(end, middle), QPointF(end - 22, middle + 20)]
    painter.drawPolyline(QPolygonF(tip))


def _paint_image(width: int, height: int, paint: Paint, size: float, theme: Theme) -> QImage:
    image = QImage(width, height, QImage.Format.Format_ARGB32)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    paint(painter, size, theme)
    painter.end()
    return image


def _encode_argb(image: QImage) -> bytes:
    # Channels alpha, red, green, blue in runs, each preceded by its length minus one.
    converted = image.convertToFormat(QImage.Format.Format_RGBA8888)  # must outlive its bits
    pixels = bytes(converted.constBits())
    encoded = bytearray(b"ARGB")
    for channel in (pixels[3::4], pixels[0::4], pixels[1::4], pixels[2::4]):
        for start in range(0, len(channel), _MAX_RUN):
            run = channel[start : start + _MAX_RUN]
            encoded.append(len(run) - 1)
            encoded += run
    return bytes(encoded)


def _encode_png(image: QImage) -> bytes:
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    # The stubs of PySide require str, the method itself bytes.
    if not image.save(buffer, "PNG"):  # type: ignore[call-overload]
        raise OSError("Qt can't encode PNG")
    return bytes(buffer.data().data())


def icns(paint: Paint, theme: Theme) -> bytes:
    """Return an .icns file with the icon in all `SIDES`.

    Args:
        paint: Function that paints the icon.
        theme: Theme with the colours.
    """
    pieces = []
    for kind, side in SIDES.items():
        image = _paint_image(side, side, paint, side, theme)
        content = _encode_argb(image) if kind in _RAW else _encode_png(image)
        pieces.append(kind + struct.pack(">I", len(content) + 8) + content)
    body = b"".join(pieces)
    return b"icns" + struct.pack(">I", len(body) + 8) + body


def write_pictures(folder: Path) -> None:
    """Write both icons and the background, the latter also at Retina resolution (@2x)."""
    folder.mkdir(parents=True, exist_ok=True)
    theme = Theme("light")
    (folder / APP_ICON).write_bytes(icns(paint_app, theme))
    (folder / DOCUMENT_ICON).write_bytes(icns(paint_document, theme))
    width, height = WINDOW
    for scale, name in ((1, BACKGROUND), (2, BACKGROUND.replace(".", "@2x."))):
        picture = _paint_image(width * scale, height * scale, paint_background, scale, theme)
        (folder / name).write_bytes(_encode_png(picture))
    theme.deleteLater()


if __name__ == "__main__":
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    _application = QApplication([])
    write_pictures(Path(sys.argv[1]))
